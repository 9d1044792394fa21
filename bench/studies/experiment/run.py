"""An experiment without a laboratory: what is lost between the grains and their friction law?

    python -m bench.studies.experiment.run --out DIR --openpiv-python ~/openpiv/bin/python

A simulated collapse of known mu_s and mu_2 is filmed by an imaginary camera; OpenPIV, an outside
program, measures the pairs of pictures; granpinn.convert and granpinn.train do what they do with
any experiment. DIR/experiment.json holds the recovered parameters and the loss at every link.
note.md has what was measured. `--flow DIR/measured.h5` identifies the flow of an earlier run.

Defends: from pictures of the collapse (0.4, 0.64), mu_s to 3 % and mu_2 to 8 % in ten minutes on a
CPU after the PIV.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies import raw
from bench.studies.experiment import losses
from bench.studies.experiment.commands import ExperimentError, convert, identify, inspect, run
from bench.studies.experiment.film import HEIGHT, Film, column, shoot
from bench.studies.experiment.links import links
from granpinn.data import write_flow
from granpinn.importers import read_vectors

Piv = Callable[[Film, Path], None]


def openpiv(python: str, window: int) -> Piv:
    """The PIV of OpenPIV, in a process of its own with its own interpreter."""
    try:
        found = subprocess.run([python, "-c", "import openpiv"], capture_output=True, check=False)
    except OSError:
        found = None
    if found is None or found.returncode:
        raise ExperimentError(
            f"{python} must have OpenPIV, got none: install the package openpiv in an environment "
            "of its own and name that with --openpiv-python"
        )

    def measure(film: Film, out: Path) -> None:
        script = Path(__file__).with_name("openpiv_program.py")
        out.mkdir(parents=True, exist_ok=True)
        run([python, str(script), str(film.folder), str(out), str(window)])

    return measure


def experiment(
    arguments: argparse.Namespace, settings: Sequence[str], piv: Piv | None = None
) -> dict[str, Any]:
    """The whole chain, or the identification alone; `piv` measures a film, by default OpenPIV."""
    out: Path = arguments.out
    out.mkdir(parents=True, exist_ok=True)
    found: dict[str, Any] = {
        "arguments": {name: str(value) for name, value in vars(arguments).items()},
        "settings": list(settings),
    }
    flows = {"measured": arguments.flow}
    if arguments.flow is None:
        found |= film_and_measure(
            arguments, piv or openpiv(arguments.openpiv_python, arguments.window)
        )
        flows = {name: out / "links" / f"{name}.h5" for name in ("points", "measured")}
        raw.write(out / "experiment.json", found)
    if not arguments.measure_only:
        options = ["--seed", str(arguments.seed), "--max-time", str(arguments.max_time)]
        options += [] if arguments.steps is None else ["--steps", str(arguments.steps)]
        found["identification"] = {}
        for name, flow in flows.items():
            row = identify(flow, out / f"run_{name}", [*options, *settings])
            found["identification"][name] = row
            print(f"{name}: {row['command_s']} s", flush=True)
    return raw.write(out / "experiment.json", found)


def film_and_measure(arguments: argparse.Namespace, measure: Piv) -> dict[str, Any]:
    """From the simulation to the flow file, and the flows between the links in DIR/links."""
    out: Path = arguments.out
    seconds: dict[str, float] = {}
    clock = time.monotonic()

    def lap(name: str) -> None:
        nonlocal clock
        seconds[name] = round(time.monotonic() - clock, 1)
        clock = time.monotonic()
        print(f"{name}: {seconds[name]} s", flush=True)

    flow = column(arguments.cells, 4 * arguments.pairs)
    lap("simulation")
    film = shoot(
        flow,
        arguments.pairs,
        1e-3 * arguments.pixel,
        arguments.displacement,
        out,
        arguments.seed,
    )
    lap("pictures")
    measure(film, out / "vectors")
    lap("piv")
    measured = convert(film, out / "vectors", out)
    lap("conversion")
    inspection = inspect(out / "measured.h5", out / "inspection")
    lap("inspection")
    between = links(flow, measured, film, arguments.window)
    (out / "links").mkdir(exist_ok=True)
    for name, link in between.items():
        write_flow(link, out / "links" / f"{name}.h5")
    lap("links")
    px = film.camera.pixel / film.delay
    return {
        "film": {
            "pairs": len(film.times),
            "rows": film.camera.rows,
            "columns": film.camera.columns,
            "delay_ms": 1e3 * film.delay,
            "frame_rate_hz": 1 / (film.times[1] - film.times[0]),
            "median_displacement_px": float(np.nanmedian(np.hypot(flow.u, flow.v)) / px),
        },
        "piv": losses.of_piv(read_vectors(out / "vectors"), film, arguments.window),
        "conversion": losses.of_conversion(measured, between["points"], film, HEIGHT),
        "inspection": losses.of_inspection(inspection, measured, between["points"]),
        "seconds": seconds,
    }


def parser() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    made.add_argument("--out", type=Path, required=True, help="folder for all files")
    made.add_argument("--cells", type=int, default=256, help="cells of the simulation")
    made.add_argument("--pairs", type=int, default=50, help="pairs of pictures")
    made.add_argument("--pixel", type=float, default=0.1, help="size of a pixel, mm")
    made.add_argument("--displacement", type=float, default=8.0, help="of the fastest grains, px")
    made.add_argument("--window", type=int, default=16, help="interrogation window, px")
    made.add_argument("--steps", type=int, help="of each identification")
    made.add_argument("--max-time", type=float, default=600.0, help="seconds of each")
    made.add_argument("--flow", type=Path, help="identify this flow of an earlier run, no more")
    made.add_argument("--measure-only", action="store_true", help="leave the identification out")
    made.add_argument("--seed", type=int, default=0)
    made.add_argument("--openpiv-python", default=sys.executable, help="interpreter with OpenPIV")
    return made


def main() -> int:
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    arguments, settings = parser().parse_known_args()
    try:
        found = experiment(arguments, settings)
    except ExperimentError as error:
        print(f"bench.studies.experiment.run: {error}", file=sys.stderr)
        return 1
    print(losses.table(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
