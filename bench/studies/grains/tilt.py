"""How far the stress of grains is turned from their strain rate.

    python -m bench.studies.grains.tilt SCENES --json tilt.json

mu(I) has the deviator along the strain rate D. In the grains it has a part across D as well:

    tilt = <tau : m> / <p>,   m = D / |D| turned by 45 degrees in the sense of the rotation

positive where the deviator is turned with the rotation of the flow. A momentum balance, with a
network or without, sees the friction on the plane along the flow: where the flow shears along the
surface this is (1 - tilt) tau/p. So a tilt of -0.04 makes every law with the deviator along D come
out 4 % high. Stress and pressure are averaged in bins of I before they are divided.
"""

from __future__ import annotations

import argparse
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies import raw
from bench.studies.grains.make import FLOW, REFERENCE
from bench.studies.grains.run import scenes_in
from granpinn.arrays import Float64
from granpinn.data import Flow, read_flow
from granpinn.estimates.quadratic_fits import smooth

EDGES = (0.005, 0.01, 0.02, 0.04, 0.08, 0.2)  # of the bins of I
HALF = (0, 2, 2)  # cells on each side in the local fits
FEWEST = 15  # cells in a bin


def tilt(flow: Flow, stress: dict[str, Float64]) -> dict[str, Any]:
    """Tilt in every bin of I, and the rotation over the shear rate (1 in simple shear).

    Args:
        stress: sigma_xx, sigma_yy, sigma_xy, p, I and used of a scene [T, Y, X].
    """
    weight = ((flow.c > 0.5) & np.isfinite(flow.u)).astype(float)
    cell = float(flow.x[1] - flow.x[0])
    fields = [np.asarray(a, np.float64) for a in (flow.u, flow.v)]
    u, v = smooth(fields, weight, (1.0, cell, cell), HALF, flow.periodic)
    d_xx, d_xy, rotation = (u.x - v.y) / 2, (u.y + v.x) / 2, v.x - u.y
    rate = 2 * np.hypot(d_xx, d_xy)
    tau_xx, tau_xy = -(stress["sigma_xx"] - stress["sigma_yy"]) / 2, -stress["sigma_xy"]
    with np.errstate(divide="ignore", invalid="ignore"):
        across = np.sign(rotation) * 2 * (tau_xy * d_xx - tau_xx * d_xy) / rate
    used = stress["used"] & np.isfinite(across)
    found = {}
    for low, high in pairwise(EDGES):
        here = used & (stress["I"] >= low) & (stress["I"] < high)
        if here.sum() >= FEWEST:
            found[f"{low:g}..{high:g}"] = float(across[here].sum() / stress["p"][here].sum())
    flowing = used & (stress["I"] >= EDGES[0])
    turning = float(np.median(np.abs(rotation[flowing]) / rate[flowing]))
    return {"tilt": found, "rotation_over_rate": turning}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("scenes", type=Path)
    parser.add_argument("--json", type=Path, required=True)
    chosen = parser.parse_args()
    rows = {}
    for folder in scenes_in(chosen.scenes):
        with np.load(folder / REFERENCE) as stored:
            stress = {name: stored[name] for name in stored.files}
        rows[folder.name] = tilt(read_flow(folder / FLOW), stress)
        print(folder.name, rows[folder.name], flush=True)
    raw.write(chosen.json, {"command": " ".join(["python", *sys.argv]), "scenes": rows})
    return 0


if __name__ == "__main__":
    sys.exit(main())
