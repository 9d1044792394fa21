"""The commands of the experiment: those of granpinn, as a laboratory would give them."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench.studies.experiment.film import FRACTION, GRAIN_DENSITY, TRUTH, Film
from granpinn.data import Flow, read_flow


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


def inspect(flow: Path, out: Path) -> dict[str, Any]:
    """granpinn.inspect on a flow file: its numbers and its facts."""
    command = [sys.executable, "-m", "granpinn.inspect", str(flow), "--out", str(out), "--json"]
    found: dict[str, Any] = json.loads(run(command))
    return found


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
        "steps": result["timing"]["steps"],
        "assessment": result["assessment"],
        "command_s": round(time.monotonic() - begin, 1),
    }
