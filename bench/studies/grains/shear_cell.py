"""The truth: mu(I) of a material in homogeneous Lees-Edwards shear at a constant pressure.

    python -m bench.studies.grains.shear_cell --material 0.4 --pressure 20 --json truth.json

900 disks in a periodic box, 30 d wide. The box is sheared at a rate gdot and its height follows the
pressure sigma_yy. mu = |sigma_xy|/p and I = gdot d sqrt(rho_bulk/p) with p = (sigma_xx +
sigma_yy)/2, contact and kinetic stress together, without gravity. Standard errors come from the
scatter of long blocks: blocks are joined until the error grows no more.

Defends: mu(I) of the shear cell to 1 % from I = 0.01 to 0.3.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies import raw
from bench.studies.experiment.commands import ExperimentError
from bench.studies.grains.lammps import Lammps
from bench.studies.grains.law import fit
from bench.studies.grains.materials import (
    BULK_DENSITY,
    MEAN_AREA,
    TIME_STEP,
    Material,
    diameters,
    head,
    motion,
)
from granpinn.arrays import Float64

WIDTH = 30  # of the box, d
# Strain for every inertial number, from fast to slow: the state of one starts the next.
STRAINS = {0.3: 40.0, 0.185: 40.0, 0.1: 30.0, 0.055: 20.0, 0.03: 15.0, 0.01: 6.0, 0.003: 3.0}
BLOCKS = 64  # means of each rate in the file
TRANSIENT = 0.25  # of the strain of a rate: left out before it
# Relative growth of the height in a unit of time for a pressure that is 1 too large.
GAIN = 2e-4
START_GAIN, START_TIME = 3e-4, 10.0


def rate(inertial_number: float, pressure: float) -> float:
    """gdot of an inertial number at a pressure."""
    return inertial_number * float(np.sqrt(pressure / BULK_DENSITY))


def script(material: Material, pressure: float, numbers: Sequence[float], seed: int) -> str:
    """The input: compress, then shear at one rate after the other; blocks_I.txt for each."""
    first = rate(numbers[0], pressure)
    lines = [
        head("p p p"),
        f"region cell prism 0 {WIDTH} 0 {WIDTH} -0.5 0.5 0 0 0",
        "create_box 1 cell",
        "lattice sq 1.0",
        "create_atoms 1 region cell",
        diameters("all", seed),
        motion(material),
        f"velocity all ramp vx 0 {first * WIDTH:g} y 0 {WIDTH}",
        f"variable fraction equal {MEAN_AREA:.10f}*atoms/(lx*ly)",
        "compute streaming all temp/deform",
        "compute stress all pressure streaming",
        *_sheared(pressure, START_GAIN, first),
        f"run {round(START_TIME / TIME_STEP)}",
    ]
    before = first
    for number in numbers:
        gdot = rate(number, pressure)
        every = max(10, round(STRAINS[number] / gdot / TIME_STEP / BLOCKS) // 10 * 10)
        lines += [
            "unfix box",
            f"variable change equal {gdot - before:.10g}*ly",
            "variable low equal ylo",
            "variable high equal yhi",
            "velocity all ramp vx 0 ${change} y ${low} ${high} sum yes",
            *_sheared(pressure, GAIN, gdot),
            f"run {round(TRANSIENT * every * BLOCKS)}",
            "unfix box",
            *_sheared(pressure, GAIN, gdot),
            f"fix mean all ave/time 10 {every // 10} {every} c_stress[1] c_stress[2] c_stress[4] "
            f"v_fraction v_gdot file blocks_{number:g}.txt",
            f"run {every * BLOCKS}",
            "unfix mean",
        ]
        before = gdot
    return "\n".join(lines) + "\n"


def _sheared(pressure: float, gain: float, gdot: float) -> list[str]:
    """Shear at a rate and a pressure; the variable gdot is the true rate.

    LAMMPS takes the rate over the height at the start of the fix. So the true rate changes with the
    height, and the fix is made anew once the height has settled. The frame of reference is that of
    `temp/deform`, in which the bottom of the box is at rest: the mean velocity must be half that of
    the top, or the kinetic stress contains the mean motion.
    """
    return [
        f"fix box all deform/pressure 1 y pressure {pressure:g} {gain:g} "
        f"xy erate {gdot:.10g} remap v",
        "fix_modify box press stress",
        "variable height equal ly",
        f"variable gdot equal {gdot:.10g}*${{height}}/ly",
        f"variable shift equal {gdot:.10g}*ly/2-vcm(all,x)",
        "velocity all set ${shift} 0 0 sum yes",
    ]


def point(blocks: Float64) -> dict[str, float]:
    """One rate: I, mu with its standard error, p and the solid fraction, from block means.

    Args:
        blocks: step, sigma_xx, sigma_yy, sigma_xy, solid fraction, gdot of each block, [B, 6].
    """
    p, tau = (blocks[:, 1] + blocks[:, 2]) / 2, -blocks[:, 3]
    mu = float(tau.mean() / p.mean())
    pressure = float(p.mean())
    return {
        "I": float(blocks[:, 5].mean()) / float(np.sqrt(pressure / BULK_DENSITY)),
        "mu": mu,
        "se": standard_error((tau - mu * p) / pressure),
        "p": pressure,
        "phi": float(blocks[:, 4].mean()),
    }


def standard_error(values: Float64) -> float:
    """Of the mean of a correlated series: neighbours are joined until the error grows no more."""
    errors = []
    while len(values) >= 6:
        errors.append(float(values.std(ddof=1) / np.sqrt(len(values))))
        values = values[: len(values) // 2 * 2].reshape(-1, 2).mean(axis=1)
    return max(errors)


def truth(
    lammps: Lammps, material: Material, pressure: float, numbers: Sequence[float], folder: Path
) -> dict[str, Any]:
    """Measured points and the fitted law of one material at one pressure."""
    begin = time.monotonic()
    lammps.run(script(material, pressure, numbers, seed=4711), folder)
    points = []
    for number in numbers:
        blocks = np.loadtxt(folder / f"blocks_{number:g}.txt")
        points.append(point(blocks))
    law = fit(*(np.array([p[name] for p in points]) for name in ("I", "mu", "se")))
    return {
        "friction": material.friction,
        "pressure": pressure,
        "points": points,
        "law": law,
        "seconds": round(time.monotonic() - begin, 1),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--material", type=float, default=0.4, help="friction between the grains")
    parser.add_argument("--pressure", type=float, default=20.0, help="sigma_yy, m g/d")
    parser.add_argument("--rates", type=float, nargs="+", default=list(STRAINS), help="I")
    parser.add_argument("--folder", type=Path, default=Path("shear_cell"), help="LAMMPS's files")
    parser.add_argument("--lmp", help="the program LAMMPS")
    parser.add_argument("--json", type=Path, required=True, help="file for the results")
    chosen = parser.parse_args()
    try:
        material = Material(chosen.material)
        found = truth(Lammps(chosen.lmp), material, chosen.pressure, chosen.rates, chosen.folder)
    except ExperimentError as error:
        print(f"bench.studies.grains.shear_cell: {error}", file=sys.stderr)
        return 1
    raw.write(chosen.json, found)
    for p in found["points"]:
        print(" ".join(f"{name} {value:.4g}" for name, value in p.items()))
    print(found["law"])
    return 0


if __name__ == "__main__":
    sys.exit(main())
