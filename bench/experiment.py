"""An experiment without a laboratory: what is lost between the grains and their friction law?

    python -m bench.experiment --out DIR --openpiv-python ~/openpiv/bin/python

A simulated collapse of known mu_s and mu_2 is filmed by an imaginary camera; OpenPIV, an outside
program, measures the pairs of pictures; granpinn.convert and granpinn.train do what they do with
any experiment. DIR/experiment.json holds the recovered parameters and the loss at every link.
docs/experiment.md explains it.

Defends: from pictures of the collapse (0.4, 0.64), mu_s to 3 % and mu_2 to 8 % in ten minutes on a
CPU after the PIV.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from bench import experiment_losses as losses
from bench.machine import describe
from bench.particle_images import Camera, grain_level, smoothed, surface_points, take_pair
from bench.velocity_field import VelocityField
from granpinn.data import Flow, read_flow, write_flow
from granpinn.importers import read_vectors
from granpinn.simulation import Collapse, simulate

TRUTH = {"mu_s": 0.4, "mu_2": 0.64}
HEIGHT = 0.1  # m, of the column; its shape is that of the paper
GRAVITY = 9.81
FRACTION = 0.6  # of the volume: grains
GRAIN_DENSITY = 2500.0
# I has the density of a grain and the simulation the bulk density: d sqrt(rho_g / rho) agree.
GRAIN = 0.0025 * HEIGHT * math.sqrt(FRACTION)
FASTEST = 99.5  # percentile of the speed that makes the largest displacement
MARGIN = 16  # px of dark above and beside the grains


class ExperimentError(RuntimeError):
    """A link of the chain failed; the message is one sentence."""


@dataclass(frozen=True, eq=False)
class Film:
    """Pairs of pictures: at times[k], `delay` apart, in `folder`."""

    field: VelocityField
    camera: Camera
    times: Sequence[float]
    delay: float
    folder: Path


Piv = Callable[[Film, Path], None]


def column(cells: int, frames: int) -> Flow:
    """The paper's collapse (0.4, 0.64) in SI units, with every cell of the grid."""
    return simulate(
        Collapse(
            mu_s=TRUTH["mu_s"],
            mu_2=TRUTH["mu_2"],
            d=0.0025 * HEIGHT,
            height=HEIGHT,
            density=FRACTION * GRAIN_DENSITY,
            gravity=(0.0, -GRAVITY),
            cells=cells,
            frames=frames,
            stride=1,
            length_unit="m",
            time_unit="s",
        )
    )


def shoot(flow: Flow, pairs: int, pixel: float, displacement: float, out: Path, seed: int) -> Film:
    """Films `pairs` pairs, evenly spaced in time, at frames of the simulation.

    Args:
        pixel: m.
        displacement: of the fastest grains in a pair, px; it sets the delay.
    """
    field = VelocityField(flow)
    speed = np.hypot(flow.u, flow.v)
    delay = displacement * pixel / float(np.nanpercentile(speed, FASTEST))
    every = flow.t.size // pairs
    times = flow.t[every - 1 :: every][:pairs].tolist()
    width, height = (float(a[-1]) / pixel + MARGIN for a in (flow.x, flow.y))
    camera = Camera(pixel, rows=8 * math.ceil(height / 8), columns=8 * math.ceil(width / 8))
    folder = out / "pictures"
    folder.mkdir(parents=True, exist_ok=True)
    lines = ["frame,x,y"]
    for k, t in enumerate(times):
        pair = take_pair(field, t, delay, camera, np.random.default_rng([seed, k]))
        level = grain_level(pair)
        # The PIV measures half a window beyond the grains, or its predictor would be 0 there.
        masks = {"grains": level > 0.5, "mask": smoothed(level, 8.0) > 0.16}
        for name, picture in zip("ab", pair, strict=True):
            Image.fromarray(picture).save(folder / f"pair_{k:04d}_{name}.png")
        for name, mask in masks.items():
            Image.fromarray(np.where(mask, 255, 0).astype(np.uint8)).save(
                folder / f"pair_{k:04d}_{name}.png"
            )
        lines += [f"{k},{x:.3f},{y:.3f}" for x, y in surface_points(level).T]
    (out / "surface.csv").write_text("\n".join(lines) + "\n")
    return Film(field, camera, times, delay, folder)


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


def run(command: Sequence[str]) -> str:
    """What a command prints; ExperimentError with its last line if it fails."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise ExperimentError(f"{' '.join(command[:3])} ended with {done.returncode}: {last}")
    return done.stdout


def convert(film: Film, vectors: Path, out: Path) -> Flow:
    """granpinn.convert with the calibration of the camera, the masks and the surface line."""
    period = film.times[1] - film.times[0]
    settings = {
        "length-unit": "px",
        "velocity-unit": "px/frame",
        "scale": f"{film.camera.pixel * 1e3!r} mm/px",
        "frame-rate": f"{1 / period!r} Hz",
        "pulse-delay": f"{film.delay * 1e3!r} ms",
        "start": f"{film.times[0] * 1e3!r} ms",
        "grain-diameter": f"{GRAIN * 1e3!r} mm",
        "grain-density": f"{GRAIN_DENSITY} kg/m^3",
        "solid-fraction": f"{FRACTION}",
        "mask": str(film.folder / "pair_*_grains.png"),
        "surface": str(out / "surface.csv"),
    }
    flags = [text for name, value in settings.items() for text in (f"--{name}", value)]
    flow = out / "measured.h5"
    files = [str(path) for path in sorted(vectors.glob("*.txt"))]
    command = [sys.executable, "-m", "granpinn.convert", *files, "--out", str(flow), *flags]
    (out / "convert.log").write_text(run(command))
    return read_flow(flow)


def identify(flow: Path, out: Path, settings: Sequence[str]) -> dict[str, Any]:
    """granpinn.train on a flow file: parameters with their intervals, errors in % and seconds."""
    begin = time.monotonic()
    run([sys.executable, "-m", "granpinn.train", str(flow), "--out", str(out), *settings])
    result = json.loads((out / "results.json").read_text())
    parameters = {name: result["parameters"][name] for name in ("mu_s", "mu_2")}
    intervals = {name: parameters[name]["interval_90"] for name in TRUTH}
    return {
        "parameters": parameters,
        "error_percent": {n: 100 * (parameters[n]["value"] / TRUTH[n] - 1) for n in TRUTH},
        "truth_in_interval_90": {
            name: None if interval is None else interval[0] <= TRUTH[name] <= interval[1]
            for name, interval in intervals.items()
        },
        "misfit_percent": result["error_percent"]["velocity"],
        "command_s": round(time.monotonic() - begin, 1),
    }


def experiment(
    arguments: argparse.Namespace, settings: Sequence[str], piv: Piv | None = None
) -> dict[str, Any]:
    """The whole chain; `piv` measures a film, by default OpenPIV."""
    out: Path = arguments.out
    measure = piv or openpiv(arguments.openpiv_python, arguments.window)
    out.mkdir(parents=True, exist_ok=True)
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
    truth = losses.true_flow(measured, film.field)
    write_flow(truth, out / "true_velocity.h5")
    px = film.camera.pixel / film.delay
    found: dict[str, Any] = {
        "machine": describe(),
        "arguments": {name: str(value) for name, value in vars(arguments).items()},
        "settings": list(settings),
        "film": {
            "pairs": len(film.times),
            "rows": film.camera.rows,
            "columns": film.camera.columns,
            "delay_ms": 1e3 * film.delay,
            "frame_rate_hz": 1 / (film.times[1] - film.times[0]),
            "median_displacement_px": float(np.nanmedian(np.hypot(flow.u, flow.v)) / px),
        },
        "piv": losses.of_piv(read_vectors(out / "vectors"), film, arguments.window),
        "conversion": losses.of_conversion(measured, truth, film, HEIGHT),
        "seconds": seconds,
    }
    write(found, out)
    if not arguments.measure_only:
        options = ["--seed", str(arguments.seed), "--max-time", str(arguments.max_time)]
        options += [] if arguments.steps is None else ["--steps", str(arguments.steps)]
        found["identification"] = {}
        for name in ("true_velocity", "measured"):
            folder = out / f"run_{name}"
            found["identification"][name] = identify(
                out / f"{name}.h5", folder, [*options, *settings]
            )
            lap(name)
    write(found, out)
    return found


def write(found: dict[str, Any], out: Path) -> None:
    (out / "experiment.json").write_text(json.dumps(found, indent=1) + "\n")


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
        print(f"bench.experiment: {error}", file=sys.stderr)
        return 1
    print(losses.table(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
