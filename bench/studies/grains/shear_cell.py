"""The truth: mu(I) of a material in homogeneous Lees-Edwards shear at a constant pressure.

    python -m bench.studies.grains.shear_cell --material 0.4 --pressure 20 --lmp lammps/bin/lmp

900 disks in a periodic box, 30 d wide, or 1,728 spheres in one of 12 d. The box is sheared at a
rate gdot and its height follows the pressure sigma_yy. mu = |sigma_xy|/p and
I = gdot d sqrt(rho_bulk/p) with p = (sigma_xx + sigma_yy)/2, contact and kinetic stress together,
without gravity. Standard errors come from the scatter of long blocks: blocks are joined until the
error grows no more.

Defends: mu(I) of the shear cell to 1 % from I = 0.01 to 0.3.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies import raw
from bench.studies.experiment.commands import ExperimentError
from bench.studies.grains import truths
from bench.studies.grains.lammps import Lammps
from bench.studies.grains.law import fit
from bench.studies.grains.materials import (
    DISKS,
    SPHERES,
    TIME_STEP,
    Material,
    Shape,
    diameters,
    head,
    motion,
)
from granpinn.arrays import Float64

WIDTH = {2: 30, 3: 12}  # of the box, d, by the dimension
# Strain for every inertial number, from fast to slow: the state of one starts the next.
STRAINS = {0.3: 40.0, 0.185: 40.0, 0.1: 30.0, 0.055: 20.0, 0.03: 15.0, 0.01: 6.0, 0.003: 3.0}
# Share of these strains, by the dimension: more grains have a better mean.
SHARE = {2: 1.0, 3: 0.5}
BLOCKS = 64  # means of each rate in the file
TRANSIENT = 0.25  # of the strain of a rate in the table: left out before it
# Relative growth of the height in a unit of time for a pressure that is 1 too large.
GAIN = {2: 2e-4, 3: 5e-4}
START_GAIN, START_TIME = 3e-4, 10.0


def rate(shape: Shape, inertial_number: float, pressure: float) -> float:
    """gdot of an inertial number at a pressure."""
    return inertial_number * float(np.sqrt(pressure / shape.bulk_density))


def script(
    shape: Shape, material: Material, pressure: float, numbers: Sequence[float], seed: int
) -> str:
    """The input: compress, then shear at one rate after the other; blocks_I.txt for each."""
    first = rate(shape, numbers[0], pressure)
    gain = GAIN[shape.dimension]
    width = WIDTH[shape.dimension]
    flat = shape.dimension == 2
    lines = [
        head(shape, "p p p"),
        f"region cell prism 0 {width} 0 {width} {'-0.5 0.5' if flat else f'0 {width}'} 0 0 0",
        "create_box 1 cell",
        f"lattice {'sq' if flat else 'sc'} 1.0",
        "create_atoms 1 region cell",
        diameters(shape, seed),
        motion(shape, material),
        f"velocity all ramp vx 0 {first * width:g} y 0 {width}",
        f"variable fraction equal {shape.mean_solid:.10f}*atoms/vol",
        "compute streaming all temp/deform",
        "compute stress all pressure streaming",
        *_sheared(pressure, START_GAIN, first),
        f"run {round(START_TIME / TIME_STEP)}",
    ]
    before = first
    for number in numbers:
        gdot = rate(shape, number, pressure)
        strain = SHARE[shape.dimension] * STRAINS[number]
        every = max(10, round(strain / gdot / TIME_STEP / BLOCKS) // 10 * 10)
        lines += [
            "unfix box",
            f"variable change equal {gdot - before:.10g}*ly",
            "variable low equal ylo",
            "variable high equal yhi",
            "velocity all ramp vx 0 ${change} y ${low} ${high} sum yes",
            *_sheared(pressure, gain, gdot),
            f"run {round(TRANSIENT * every * BLOCKS / SHARE[shape.dimension])}",
            "unfix box",
            *_sheared(pressure, gain, gdot),
            f"fix mean all ave/time 10 {every // 10} {every} c_stress[1] c_stress[2] c_stress[4] "
            f"v_fraction v_gdot{'' if flat else ' c_stress[3]'} file blocks_{number:g}.txt",
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


def point(shape: Shape, blocks: Float64) -> dict[str, float]:
    """One rate: I, mu with its standard error, p and the solid fraction, from block means.

    Args:
        blocks: step, sigma_xx, sigma_yy, sigma_xy, solid fraction, gdot of each block, [B, 6]; of
            spheres sigma_zz too, which comes out as its ratio to p.
    """
    p, tau = (blocks[:, 1] + blocks[:, 2]) / 2, -blocks[:, 3]
    mu = float(tau.mean() / p.mean())
    pressure = float(p.mean())
    across = {} if shape.dimension == 2 else {"szz_by_p": float(blocks[:, 6].mean()) / pressure}
    return across | {
        "I": float(blocks[:, 5].mean()) / float(np.sqrt(pressure / shape.bulk_density)),
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
    lammps: Lammps,
    shape: Shape,
    material: Material,
    pressure: float,
    numbers: Sequence[float],
    folder: Path,
) -> dict[str, Any]:
    """Measured points and the fitted law of one material at one pressure."""
    begin = time.monotonic()
    lammps.run(script(shape, material, pressure, numbers, seed=4711), folder)
    points = []
    for number in numbers:
        blocks = np.loadtxt(folder / f"blocks_{number:g}.txt")
        points.append(point(shape, blocks))
    law = fit(*(np.array([p[name] for p in points]) for name in ("I", "mu", "se")))
    return {
        "dimension": shape.dimension,
        "friction": material.friction,
        "pressure": pressure,
        "points": points,
        "law": law,
        "seconds": round(time.monotonic() - begin, 1),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--material", type=float, default=0.4, help="friction between the grains")
    parser.add_argument("--spheres", action="store_true", help="in place of disks")
    parser.add_argument("--pressure", type=float, default=20.0, help="sigma_yy, m g/d")
    parser.add_argument("--rates", type=float, nargs="+", default=list(STRAINS), help="I")
    parser.add_argument("--folder", type=Path, default=Path("shear_cell"), help="LAMMPS's files")
    parser.add_argument("--lmp", help="the program LAMMPS")
    parser.add_argument("--json", type=Path, default=truths.PATH, help="file of all shear cells")
    chosen = parser.parse_args()
    shape = SPHERES if chosen.spheres else DISKS
    try:
        material = Material(chosen.material)
        found = truth(
            Lammps(chosen.lmp),
            shape,
            material,
            chosen.pressure,
            chosen.rates,
            chosen.folder,
        )
    except ExperimentError as error:
        print(f"bench.studies.grains.shear_cell: {error}", file=sys.stderr)
        return 1
    name = truths.name_of(material, chosen.pressure, shape)
    cells = truths.read(chosen.json) | {name: raw.write(None, found)}
    chosen.json.write_text(json.dumps(cells, indent=1) + "\n", encoding="utf-8")
    for p in found["points"]:
        print(" ".join(f"{name} {value:.4g}" for name, value in p.items()))
    print(found["law"])
    return 0


if __name__ == "__main__":
    sys.exit(main())
