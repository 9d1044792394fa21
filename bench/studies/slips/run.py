"""Are slips of calibration caught before a training?

python -m bench.studies.slips.run --reference FLOW.h5 --scenes SCENES --columns 96 --json OUT.json

Plants every slip of plants.py in the data of the tutorial, in reference collapses and in flows of
simulated grains (bench/studies/grains), and says what the checks of inspect, convert and train give
for each. Sound flows, also with noise and with masks in place of fractions, give the false alarms.

Defends: in a tall collapse every slip is named; sound data are silent.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies import raw
from bench.studies.slips.plants import HIDDEN, PLANTS, Plant
from granpinn.data import Flow, FlowFileError, add_noise, check_flow, read_flow
from granpinn.importers import Settings, convert
from granpinn.inspection.body import body_of
from granpinn.inspection.fall import energy_of, fall_of, slender
from granpinn.inspection.slips import slips
from granpinn.inspection.surface_slips import line_of
from granpinn.simulation import demo_path, simulate

NOISES = (0.0, 0.02, 0.2)  # standard deviation over the largest speed
LENGTH, SCALE, PIXELS = 12.8e-3, 0.15e-3, 0.05  # of the tutorial: m, m/px, error in px


def tutorial() -> Flow:
    """The flow file of docs/start/five-minutes.md: noisy vectors in pixels, converted."""
    flow = read_flow(demo_path())
    speed = math.sqrt(9.81 * LENGTH)
    delay = 0.05 * LENGTH / speed
    noise, grains = np.random.default_rng(0), flow.c > 0.5
    u, v = (
        np.where(grains, a * speed * delay / SCALE + noise.normal(0, PIXELS, a.shape), np.nan)
        for a in (flow.u, flow.v)
    )
    arrays: dict[str, Any] = {
        "t": np.arange(len(flow.t)),
        "x": flow.x * LENGTH / SCALE,
        "u": u,
        "v": v,
    }
    arrays |= {"y": flow.y * LENGTH / SCALE, "mask": ~grains, "y_down": False}
    arrays |= {"length_unit": "px", "velocity_unit": "px/frame", "time_unit": "frame"}
    settings = Settings(
        scale=f"{SCALE} m/px",
        frame_rate=f"{1 / delay} Hz",
        start=f"{delay} s",
        grain_diameter="0.32 mm",
        grain_density="1500 kg/m^3",
        solid_fraction=1.0,
    )
    return convert(arrays, settings)


def answer(flow: Flow, plant: Plant) -> dict[str, str] | None:
    """What a planted slip gives: severity and sentence, "silent", or None where it has no sense."""
    try:
        changed = plant.change(flow)
        check_flow(changed)
        found = slips(changed)
    except FlowFileError as error:
        return {"severity": "refused", "text": str(error)}
    except LookupError:
        return None
    if not found:
        return {"severity": "silent", "text": ""}
    return {"severity": found[0].severity, "text": found[0].text}


def sound(flow: Flow) -> list[str]:
    """The slips that sound data are accused of: as they are, with noise, with a mask for c."""
    steady = flow.steady
    variants = [flow] if steady else [add_noise(flow, noise, 1) for noise in NOISES]
    variants.append(replace(flow, c=(flow.c > 0.5).astype(np.float32)))
    variants.append(replace(flow, surface=None))
    return [str(slip) for each in variants for slip in slips(each)]


def measures(flow: Flow) -> dict[str, float | str | None]:
    """What the checks measure in a sound flow, beside their bounds."""
    body, line = body_of(flow), line_of(flow)
    fall = None if flow.steady else fall_of(flow, body)
    lag = None if line is None else line.lag
    energy = None if flow.steady else energy_of(flow, body, 1.0)
    return {
        "side": None if fall is None else fall.side,
        "acceleration": None if fall is None else fall.inward,
        "tilt_degrees": None if fall is None else fall.tilt(flow.gravity),
        "energy_share": None if energy is None else energy.share,
        "height_over_width": slender(body, flow.gravity)[0],
        "line_gap_cells": None if line is None else line.gap,
        "line_late_frames": None if line is None or lag is None else lag.time / line.interval,
        "line_late_cells": None if lag is None else lag.cells,
        "downhill": None if line is None else line.down,
    }


def columns(cells: int) -> dict[str, Flow]:
    """Simulated collapses of columns of 0.5 to 4 times their width, of low and high friction."""
    flows = {}
    for aspect, width in ((0.5, 4.0), (1.0, 4.0), (2.0, 3.0), (3.0, 2.5), (4.0, 2.0)):
        for mu_s, mu_2 in ((0.2, 0.44), (0.6, 0.84)):
            settings: dict[str, Any] = {"box_width": width, "box_height": 1.5, "height": 1.0}
            settings |= {"aspect": aspect, "mu_s": mu_s, "mu_2": mu_2, "d": 0.0125}
            settings |= {"cells": cells, "t_end": 2.0, "frames": 80, "stride": 2}
            flows[f"column {aspect:g}, mu_s {mu_s:g}"] = simulate(**settings)
    return flows


def study(flows: Mapping[str, Flow]) -> dict[str, Any]:
    """Answers of all slips and the false alarms, by flow."""
    return {
        "measured": {name: measures(flow) for name, flow in flows.items()},
        "named": {p.name: {n: answer(f, p) for n, f in flows.items()} for p in PLANTS},
        "hidden": {p.name: {n: answer(f, p) for n, f in flows.items()} for p in HIDDEN},
        "false_alarms": {name: sound(flow) for name, flow in flows.items()},
    }


def table(found: dict[str, Any]) -> str:
    """One line for each slip: i(mpossible), p (improbable), u(nusual), r(efused), . (silent) or -
    (no sense)."""
    signs = {"impossible": "i", "improbable": "p", "unusual": "u", "refused": "r", "silent": "."}
    names = list(next(iter(found["named"].values())))
    lines = [f"{k:>3} {name}" for k, name in enumerate(names)]
    lines.append(f"{'':<46}" + "".join(f"{k:>3}" for k in range(len(names))))
    for group in ("named", "hidden"):
        for plant, row in found[group].items():
            cells = [signs[a["severity"]] if (a := row[n]) else "-" for n in names]
            lines.append(f"{plant:<46}" + "".join(f"{cell:>3}" for cell in cells))
    for name, alarms in found["false_alarms"].items():
        lines += [f"false alarm, {name}: {alarm}" for alarm in alarms]
    return "\n".join(lines)


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--reference", nargs="*", type=Path, default=[], help="flow files")
    parser.add_argument("--scenes", type=Path, help="folder of grain scenes, each with flow.h5")
    parser.add_argument("--columns", type=int, help="cells of simulated columns; none without")
    parser.add_argument("--json", type=Path, help="file for the results")
    arguments = parser.parse_args(argv)
    warnings.simplefilter("ignore")
    begin = time.monotonic()
    flows = {"tutorial": tutorial()}
    flows |= {path.stem: read_flow(path) for path in arguments.reference}
    if arguments.scenes is not None:
        paths = sorted(arguments.scenes.glob("*/flow.h5"))
        flows |= {path.parent.name: read_flow(path) for path in paths}
    if arguments.columns is not None:
        flows |= columns(arguments.columns)
    # The checks see neither the pressure nor the law of a simulation.
    flows = {name: replace(flow, p=None, truth=None) for name, flow in flows.items()}
    found = study(flows) | {"seconds": round(time.monotonic() - begin, 1)}
    raw.write(arguments.json, found)
    print(table(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
