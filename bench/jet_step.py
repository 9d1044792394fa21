"""The fused jets of `granpinn.kernels.ops.network_jet` beside torch, on another equation.

Claim (docs/guides/other-equations.md): loss and gradient of examples/navier_stokes.py take a small
part of the CPU time of nested automatic differentiation with the fused jets, and less than with
Taylor jets written by hand. Compiled by torch.compile, the jets by hand take about as long.

    python -m bench.jet_step --out bench/results/jet_step.json
"""

from __future__ import annotations

import argparse
import runpy
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from bench.studies import raw
from granpinn.kernels.network import views

EXAMPLE = Path(__file__).parents[1] / "examples" / "navier_stokes.py"
POINTS, ROUNDS = 1024, 40
CHANNELS = 7  # value, x, y, t, xx, xy, yy
PAIRS = ((0, 0), (0, 1), (1, 1))  # of the second derivatives

Step = Callable[[], Tensor]


def taylor_network(params: Tensor, points: Tensor, widths: list[int]) -> list[Tensor]:
    """Raw outputs [B, K] of each channel; the channels of a layer are one matrix product."""
    jet: list[Tensor] = []
    for layer, (W, b) in enumerate(views(params, widths)):
        if layer == 0:
            value = points @ W.T + b
            first = [W[:, i].expand_as(value) for i in range(3)]
            jet = [value, *first, *[torch.zeros_like(value)] * len(PAIRS)]
        else:
            value, *rest = (torch.cat(swish(jet)) @ W.T).chunk(CHANNELS)
            jet = [value + b, *rest]
    return jet


def swish(z: list[Tensor]) -> list[Tensor]:
    """swish of a jet."""
    s = torch.sigmoid(z[0])
    q = s * (1 - s)
    f1, f2 = s + z[0] * q, q * (2 + z[0] * (1 - 2 * s))
    second = (
        f2 * z[1 + i] * z[1 + j] + f1 * z_ij for (i, j), z_ij in zip(PAIRS, z[4:], strict=True)
    )
    return [z[0] * s, *(f1 * z_i for z_i in z[1:4]), *second]


def by_hand(
    params: Tensor, where: Tensor, widths: list[int], shift: list[float], scale: list[float]
) -> list[Tensor]:
    """Taylor jets written by hand, in the units of the points."""
    at = (where - where.new_tensor(shift)) * where.new_tensor(scale)
    value, *rest = taylor_network(params, at, widths)
    first = [part * factor for part, factor in zip(rest, scale, strict=False)]
    second = [part * scale[i] * scale[j] for part, (i, j) in zip(rest[3:], PAIRS, strict=True)]
    return [value, *first, *second]


def steps(compiled: bool = False) -> dict[str, Step]:
    """Loss and gradient by each way of differentiation, on the same points.

    Args:
        compiled: whether to have those of torch.compile too.
    """
    example: dict[str, Any] = runpy.run_path(str(EXAMPLE))
    draw = torch.Generator().manual_seed(0)
    params, log_nu = example["network"](), torch.tensor(-3.0, requires_grad=True)
    where = example["points"](POINTS, draw)
    data = example["velocity"](where)

    def step(jets: Any, loss: Any = example["loss"]) -> Step:
        def advance() -> Tensor:
            value = loss(params, log_nu, where, data, jets)
            by_params, _ = torch.autograd.grad(value, (params, log_nu))
            return by_params

        return advance

    network = [example[name] for name in ("WIDTHS", "SHIFT", "SCALE")]
    ways = {name: example[name] for name in ("fused", "nested")}
    ways["by hand"] = lambda *at: example["Jet"](*by_hand(*at, *network))
    found = {name: step(jets) for name, jets in ways.items()}
    if compiled:
        loss: Any = torch.compile(example["loss"], dynamic=False)
        found |= {f"{name}, compiled": step(ways[name], loss) for name in ("fused", "by hand")}
    return found


def milliseconds(step: Step) -> float:
    """Median CPU time of a step, after two for warming up."""
    found = []
    for _ in range(ROUNDS + 2):
        begin = time.process_time()
        step()
        found.append(1e3 * (time.process_time() - begin))
    return round(statistics.median(found[2:]), 2)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path)
    out = parser.parse_args().out
    found = {name: milliseconds(step) for name, step in steps(compiled=True).items()}
    row = {"threads": torch.get_num_threads(), "points": POINTS, "cpu_ms": found}
    print(raw.write(out, row))


if __name__ == "__main__":
    main()
