"""The same collapse without units, in mm and ms, and through a tilted camera: one friction law.

python -m bench.studies.units_invariance.run --tilt 1.2 --seeds 0 1 2 --json units_invariance.json

The demonstration is measured by an imaginary laboratory and brought back by the importers, as the
files of any instrument are. Vectors on a grid: without units, and in mm and ms. Scattered vectors,
because a grid cannot be turned: without units, and in mm and ms in a camera that is not level. All
are trained with the same seeds in one batch. Settings that are not its own go to the
identification (`--steps 40000`).

Defends: units change mu_s and mu_2 by less than 0.1 %, and so does the tilt.
"""

from __future__ import annotations

import argparse
import math
import statistics
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies import raw
from granpinn import identify_many
from granpinn.config import Config
from granpinn.data import Flow, Particles, Surface, particle_flow, read_flow
from granpinn.importers import Settings, convert
from granpinn.simulation import demo_path

MILLIMETERS = 8.0  # of one unit of length
G = 9.81
MILLISECONDS = 1e3 * math.sqrt(MILLIMETERS * 1e-3 / G)  # of one unit of time
SPEED = MILLIMETERS / MILLISECONDS
FRACTION = 0.6
GRAIN_DENSITY = 2500.0
PAIRS = (("grid", "grid_mm"), ("particles", "particles_mm_tilted"))  # without units, with


def demonstration(every: int) -> Flow:
    """Every so-many-th frame, without what only a simulation knows.

    The grains are smaller and denser than the bulk, as those of a laboratory are:
    d sqrt(rho_g / rho), all that the equations know of them, stays the same.
    """
    flow = read_flow(demo_path())
    kept = slice(None, None, every)
    u, v, c = flow.u[kept], flow.v[kept], flow.c[kept]
    line = flow.surface
    assert line is not None
    seen = (line.t >= flow.t[0] - 1e-9) & (line.t <= flow.t[kept][-1] + 1e-9)
    return replace(
        flow,
        t=flow.t[kept],
        u=np.where(c == 1, u, np.nan),
        v=np.where(c == 1, v, np.nan),
        c=c,
        p=None,
        eta_max=None,
        eta_min=None,
        surface=Surface(line.t[seen], line.x[seen], line.y[seen]),
        grain_diameter=flow.grain_diameter * math.sqrt(FRACTION),
        grain_density=flow.density / FRACTION,
        truth=None,
    )


def particles_of(flow: Flow) -> Particles:
    """The valid vectors of a flow, one by one."""
    frame, row, column = np.nonzero(flow.valid)
    at = (frame, row, column)
    return Particles(flow.t[frame], flow.x[column], flow.y[row], flow.u[at], flow.v[at])


def scattered(flow: Flow) -> Flow:
    """The same flow as scattered vectors, without units."""
    names = ("gravity", "density", "grain_diameter", "grain_density", "surface")
    return particle_flow(particles_of(flow), **{name: getattr(flow, name) for name in names})


def in_millimeters(flow: Flow, folder: Path) -> Flow:
    """The flow on its grid from measurements in mm and ms."""
    arrays = {
        "t": flow.t * MILLISECONDS,
        "y": flow.y * MILLIMETERS,
        "x": flow.x * MILLIMETERS,
        "u": flow.u.astype(np.float64) * SPEED,
        "v": flow.v.astype(np.float64) * SPEED,
        "c": flow.c.astype(np.float64),
    }
    return _converted(arrays, flow, 0.0, folder / "surface.csv")


def tilted(flow: Flow, degrees: float, folder: Path) -> Flow:
    """Scattered vectors in mm and ms, seen by a camera in which a plumb line leans to the right."""
    p, angle = particles_of(flow), math.radians(degrees)
    x, y = _turned(p.x, p.y, angle)
    u, v = _turned(p.u.astype(np.float64), p.v.astype(np.float64), angle)
    arrays = {"t": p.t * MILLISECONDS, "x": x * MILLIMETERS, "y": y * MILLIMETERS}
    arrays |= {"u": u * SPEED, "v": v * SPEED}
    return _converted(arrays, flow, degrees, folder / "surface_tilted.csv")


def _turned(x: Any, y: Any, angle: float) -> tuple[Any, Any]:
    cos, sin = math.cos(angle), math.sin(angle)
    return cos * x - sin * y, sin * x + cos * y


def _converted(arrays: dict[str, Any], flow: Flow, degrees: float, table: Path) -> Flow:
    """What the importers make of arrays in mm and ms and of the line of the surface."""
    line = flow.surface
    assert line is not None
    x, y = _turned(line.x, line.y, math.radians(degrees))
    rows = np.stack([line.t * MILLISECONDS, x * MILLIMETERS, y * MILLIMETERS], axis=1)
    lines = [",".join(map(repr, row)) for row in rows.tolist()]
    table.write_text("\n".join(["t [ms],x [mm],y [mm]", *lines]) + "\n")
    units = {"length_unit": "mm", "time_unit": "ms", "velocity_unit": "mm/ms"}
    settings = Settings(
        grain_diameter=f"{flow.grain_diameter * MILLIMETERS!r} mm",
        grain_density=f"{GRAIN_DENSITY} kg/m^3",
        solid_fraction=FRACTION,
        tilt=f"{degrees!r} deg",
        surface=str(table),
    )
    return convert(arrays | units, settings)


def cases(every: int, degrees: float) -> dict[str, Flow]:
    """The four flows."""
    flow = demonstration(every)
    with tempfile.TemporaryDirectory() as folder:
        return {
            "grid": flow,
            "grid_mm": in_millimeters(flow, Path(folder)),
            "particles": scattered(flow),
            "particles_mm_tilted": tilted(flow, degrees, Path(folder)),
        }


def study(flows: dict[str, Flow], config: Config, seeds: Sequence[int]) -> dict[str, Any]:
    """Identified values of every flow and seed, and the differences of the pairs in %."""
    members = [(name, seed) for name in flows for seed in seeds]
    results = identify_many([flows[n] for n, _ in members], config, [s for _, s in members])
    values: dict[str, dict[str, list[float]]] = {name: {"mu_s": [], "mu_2": []} for name in flows}
    for (name, _), result in zip(members, results, strict=True):
        for key, row in values[name].items():
            row.append(getattr(result.parameters, key).value)
    differences = {
        f"{theirs} against {ours}": {
            key: [100 * (b / a - 1) for a, b in zip(row, values[theirs][key], strict=True)]
            for key, row in values[ours].items()
        }
        for ours, theirs in PAIRS
    }
    return {"values": values, "difference_percent": differences}


def table(found: dict[str, Any]) -> str:
    """Largest and mean difference, beside the spread over the seeds."""
    lines = [f"{'':<42}{'mu_s: mean, worst':>22}{'mu_2: mean, worst':>22}  (%)"]
    for name, row in found["difference_percent"].items():
        cells = "".join(
            f"{statistics.mean(row[key]):+13.4f} {max(map(abs, row[key])):8.4f}"
            for key in ("mu_s", "mu_2")
        )
        lines.append(f"{name:<42}{cells}")
    for name, row in found["values"].items():
        spread = "".join(
            f"{100 * statistics.pstdev(row[key]) / statistics.mean(row[key]):22.4f}"
            for key in ("mu_s", "mu_2")
        )
        lines.append(f"{'spread over the seeds, ' + name:<42}{spread}")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--tilt", type=float, default=1.2, help="of the camera, degrees")
    parser.add_argument("--every", type=int, default=1, help="use every so-many-th frame")
    parser.add_argument("--json", type=Path, help="file for the results")
    arguments, settings, config = raw.parse(parser)
    begin = time.monotonic()
    found = study(cases(arguments.every, arguments.tilt), config, arguments.seeds)
    found |= {
        "seeds": arguments.seeds,
        "tilt_degrees": arguments.tilt,
        "every": arguments.every,
        "settings": settings,
        "seconds": round(time.monotonic() - begin, 1),
    }
    raw.write(arguments.json, found)
    print(table(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
