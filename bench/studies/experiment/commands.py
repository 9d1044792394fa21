"""The outside programs of the experiment: a PIV program, and granpinn.convert as a lab calls it."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from bench.studies.experiment.film import FRACTION, GRAIN_DENSITY, Film
from granpinn.data import Flow, read_flow

Piv = Callable[[Film, Path], None]  # measures a film into a folder


class ExperimentError(RuntimeError):
    """A link of the chain failed; the message is one sentence."""


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
        "grain-diameter": f"{film.grain * 1e3!r} mm",
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


def openpiv(python: str, window: int) -> Piv:
    """The PIV of OpenPIV, in a process of its own with its own interpreter.

    Raises:
        ExperimentError: the interpreter has no OpenPIV.
    """
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
