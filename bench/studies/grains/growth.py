"""Errors of mu(I) against steps, noise and number of vectors: does more ever make it worse?

    python -m bench.studies.grains.growth SCENES --reference FILE... --json OUT --png FIGURE

SCENES holds the folders of bench.studies.grains.make. Every scene with a surface line and every
reference collapse is identified as it is, with additional white noise, and with a part of its
vectors, drawn at random. All of these with the same number of steps are one batch. `--steps` and
`--scenes` choose fewer. The truth of a scene is its own law; that of a collapse is in its file.

Defends: more steps, fewer vectors and more noise follow one recipe; more steps never make it worse.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from bench.studies import raw
from bench.studies.draws import thinned
from bench.studies.grains.run import scenes_in
from bench.studies.grains.tolerances import Case, case_of_scene, cases_of_reference
from granpinn import identify_many
from granpinn.config import Config

STEPS = (5000, 10_000, 20_000, 40_000, 80_000)
NOISE = (0.05, 0.2)  # of the largest speed
PARTS = (0.25, 0.06)  # of the vectors


def variants(case: Case) -> dict[str, Case]:
    """The case as it is, with noise, and with fewer vectors; by names that are columns."""
    flow = case.flow
    vectors = int((flow.valid & (flow.t > 0)[:, None, None]).sum())
    made = {"as it is": case}
    for noise in NOISE:
        made[f"noise {100 * noise:g} %"] = dataclasses.replace(case, noise=noise)
    for part in PARTS:
        fewer = thinned(flow, max(1, round(part * vectors)))
        made[f"{100 * part:g} % of the vectors"] = dataclasses.replace(case, flow=fewer)
    return made


def rms(errors: Mapping[str, float]) -> float:
    """Root mean square of the errors at the inertial numbers of a case, in %."""
    return math.sqrt(float(np.mean(np.square([*errors.values()])))) if errors else math.nan


def batch(cases: Sequence[tuple[str, Case]], steps: int, device: str) -> list[dict[str, Any]]:
    """One row for every case: its name, the variant, the steps and the errors."""
    settings: dict[str, Any] = {"simulated_pressure.frames": 0, "steps": steps, "device": device}
    config = Config(**settings)
    flows, noise = [case.flow for _, case in cases], [case.noise for _, case in cases]
    rows = []
    for (variant, case), result in zip(
        cases, identify_many(flows, config, noise=noise), strict=True
    ):
        errors = {} if result.failure else case.errors(result)
        rows.append(
            {"case": case.name, "variant": variant, "steps": steps, "error_percent": errors}
        )
    return rows


def draw(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Rms error over I against steps: a panel for every variant, a line for every case."""
    names = list(dict.fromkeys(row["variant"] for row in rows))
    figure = Figure(figsize=(3.2 * len(names), 3.2), layout="constrained")
    axes = figure.subplots(1, len(names), squeeze=False, sharey=True)[0]
    for axis, name in zip(axes, names, strict=True):
        own = [row for row in rows if row["variant"] == name]
        for case in dict.fromkeys(row["case"] for row in own):
            line = [(r["steps"], rms(r["error_percent"])) for r in own if r["case"] == case]
            axis.plot(*zip(*line, strict=True), marker=".", lw=1, label=case)
        axis.set(title=name, xlabel="steps", xscale="log", yscale="log")
    axes[0].set_ylabel("rms error of mu(I) in %")
    axes[-1].legend(fontsize=4)
    figure.savefig(path, dpi=150)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("scenes", type=Path)
    parser.add_argument("--reference", nargs="*", type=Path, default=[])
    parser.add_argument("--scenes", nargs="*", dest="names", help="names of scenes; none: all")
    parser.add_argument("--steps", nargs="+", type=int, default=list(STEPS))
    parser.add_argument("--device", default="auto")
    parser.add_argument("--json", type=Path, required=True)
    parser.add_argument("--png", type=Path)
    own = parser.parse_args()
    folders = [f for f in scenes_in(own.scenes) if not own.names or f.name in own.names]
    chosen = [case for case in map(case_of_scene, folders) if case.flow.surface is not None]
    chosen += [cases_of_reference(path)[0] for path in own.reference]
    cases = [pair for case in chosen for pair in variants(case).items()]
    found: dict[str, Any] = {"seconds": {}, "rows": []}
    for steps in own.steps:
        begin = time.monotonic()
        found["rows"] += batch(cases, steps, own.device)
        found["seconds"][str(steps)] = round(time.monotonic() - begin, 1)
        raw.write(own.json, found)
        print(f"{steps} steps: {found['seconds'][str(steps)]} s", flush=True)
    if own.png is not None:
        draw(found["rows"], own.png)
    return 0


if __name__ == "__main__":
    sys.exit(main())
