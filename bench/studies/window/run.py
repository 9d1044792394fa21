"""What the windows of PIV do to mu(I), and what averaging the network's velocity over them mends.

`python -m bench.studies.window.run FLOW.h5... --out results/rows.json [settings]`: each flow is a
simulation with all cells (`granpinn simulate --stride 1`). Its velocity is averaged over squares,
of grains alone, and kept at every fourth cell. So a window of four cells is one spacing wide.
"""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import convolve1d

from bench.studies import raw
from granpinn import identify
from granpinn.data import Flow, read_flow
from granpinn.data.flow import WINDOW
from granpinn.results import Result
from granpinn.results.summary import true_friction

SPACING = 4  # cells
WINDOWS = (0, 1, 2, 4)  # spacings
Array = npt.NDArray[np.floating[Any]]


def top_hat(values: Array, cells: int) -> Array:
    """Means [T, Y, X] over squares of an even number of cells around the centers of cells."""
    kernel = np.ones(cells + 1) / cells
    kernel[[0, -1]] /= 2
    for axis in (1, 2):
        values = convolve1d(values, kernel, axis=axis, mode="constant")
    return values


def measured(flow: Flow, spacings: int) -> Flow:
    """The flow as windows see it, 0 = at points; it does not state the window."""
    full = flow.c == 1
    u, v = (np.where(full, a, 0).astype(np.float64) for a in (flow.u, flow.v))
    if spacings:
        weight = np.maximum(top_hat(full.astype(np.float64), spacings * SPACING), 1e-9)
        u, v = (top_hat(a, spacings * SPACING) / weight for a in (u, v))
    kept = slice(SPACING // 2, None, SPACING)

    def coarse(values: Array) -> Array:
        return np.ascontiguousarray(values[:, kept, kept])

    return dataclasses.replace(
        flow,
        x=flow.x[kept].copy(),
        y=flow.y[kept].copy(),
        u=coarse(np.where(full, u, np.nan).astype(np.float32)),
        v=coarse(np.where(full, v, np.nan).astype(np.float32)),
        c=coarse(flow.c),
        p=None if flow.p is None else coarse(flow.p),
        path=None,
        sha256="",
    )


def errors(result: Result) -> list[float]:
    """Errors of mu in percent at both ends of the range of I."""
    assert result.law.I_range is not None
    I = np.array(result.law.I_range)
    true = true_friction(result, I)
    assert true is not None
    found = result.friction_law.friction(I, *result.theta)
    return [round(100 * float(e), 2) for e in found / true - 1]


def band(result: Result) -> list[list[float]]:
    """The 90 % band of mu at both ends of the range of I."""
    curve = result.law.curve
    assert curve is not None
    assert curve.low is not None
    assert curve.high is not None
    return [[round(float(side[k]), 3) for side in (curve.low, curve.high)] for k in (0, -1)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("flows", nargs="+", type=Path)
    parser.add_argument("--windows", type=int, nargs="+", default=WINDOWS, help="in spacings")
    parser.add_argument("--out", type=Path)
    options, _, config = raw.parse(parser)
    rows = []
    for path in options.flows:
        flow = read_flow(path)
        for spacings in options.windows:
            seen = measured(flow, spacings)
            window = {WINDOW: spacings * float(seen.x[1] - seen.x[0])}
            stated = dataclasses.replace(seen, attributes=seen.attributes | window)
            for averaged in (False, True)[: 1 + bool(spacings)]:
                result = identify(stated if averaged else seen, config)
                row = {"mu_s": flow.truth.mu_s} if flow.truth else {}
                row |= {"spacings": spacings, "averaged": averaged, "errors": errors(result)}
                rows.append(row | {"band": band(result)})
                print(rows[-1], flush=True)
            raw.write(options.out, {"steps": config.steps, "rows": rows})


if __name__ == "__main__":
    main()
