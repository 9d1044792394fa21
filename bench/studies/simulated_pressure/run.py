r"""The simulated pressure against the reference, for networks that are trained already.

Claim: where nothing flows, the simulated pressure is nearer to that of a material which creeps at
eta_max than the network's own. More or longer steps than STEPS of STEP (simulation/settling.py)
change it little.

    python -m bench.studies.simulated_pressure.run runs/checkpoint/step-000040000.safetensors \
        FLOW.h5 ... --seeds 3 --json pressure.json

The checkpoint is that of a batch with the default network, a member for every seed of every flow,
as granpinn.tables leaves it. `--settling 20:6e-5 40:6e-5` measures other steps too, with the first
seed. Errors are in %, over the grains of the frames that were simulated.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import statistics
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from safetensors.torch import load_file
from torch import Tensor

from bench.studies import raw
from granpinn.checks.simulated_pressure import velocity_of, with_simulated_pressure
from granpinn.config import Config, ConfigError
from granpinn.data import Flow
from granpinn.data.norms import relative_l2
from granpinn.fit import scoring
from granpinn.fit.case import Model, pose
from granpinn.fit.prediction import predict
from granpinn.physics.laws import DEFAULT
from granpinn.results import Fields, number
from granpinn.second_opinion import simulated_pressure
from granpinn.simulation import settling

Array = npt.NDArray[np.float64]
Settling = tuple[int, float]
USUAL: Settling = (settling.STEPS, settling.STEP)


def frames_of(
    flow: Flow,
    usable: list[int],
    chosen: Sequence[int],
    model: Model,
    cells: int | None,
    how: Settling,
) -> tuple[list[Array], int, float]:
    """Simulated pressures of some frames, cells across the box, CPU seconds of a frame."""
    law, theta = model.law, model.theta.tolist()
    collapse = simulated_pressure.collapse_over(flow, usable, law, theta, cells)
    velocity = velocity_of(flow, model)
    before = settling.settled_after(collapse, *how)

    def one(k: int) -> tuple[Array, float]:
        begin = time.thread_time()
        start = simulated_pressure.start_of(flow, k, collapse, velocity, before)
        state = settling.settle(collapse, start, *how)
        p = simulated_pressure.pressure_at(flow, state, collapse.spacing)
        return p, time.thread_time() - begin

    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        found = list(pool.map(one, chosen))
    return [p for p, _ in found], collapse.cells, statistics.median(s for _, s in found)


def errors(flow: Flow, fields: Fields) -> dict[str, Any]:
    """Of the predicted and the simulated pressure over the same points: all, flowing, stagnant."""
    p, simulated, known = (fields.values[n] for n in ("p", "p_simulated", "p_reference"))
    ok = np.isfinite(simulated) & np.isfinite(known)
    split = scoring.zones_of(flow, fields, lambda: scoring.strain_rate_of(flow))
    zones = {"all": ok, "flowing": ok & split.flowing, "stagnant": ok & split.stagnant}

    def of(a: Any, b: Any) -> dict[str, float | None]:
        return {name: relative_l2(a[zone], b[zone]) for name, zone in zones.items()}

    return {
        "network": of(p, known),
        "simulated": of(simulated, known),
        "difference": of(p, simulated),
    }


def study(
    flows: Sequence[Path],
    tensors: dict[str, Tensor],
    seeds: int,
    frames: int,
    cells: int | None,
    others: Sequence[Settling],
) -> dict[str, Any]:
    """The rows of all members, and those of the first seeds with other steps."""
    rows: list[dict[str, Any]] = []
    variants: list[dict[str, Any]] = []
    for i, path in enumerate(flows):
        case = pose(path, Config())
        flow, usable = case.flow, simulated_pressure.usable_frames(case.flow)
        if isinstance(usable, str):
            raise ConfigError(f"{path}: {usable}")
        chosen = simulated_pressure.evenly(usable, frames)
        parts = {name: getattr(flow, name)[chosen] for name in ("t", "u", "v", "c", "p")}
        scored = dataclasses.replace(flow, **parts)
        for seed in range(seeds):
            params, theta = (tensors[name][i * seeds + seed] for name in ("params", "theta"))
            problem = case.member.problem
            model = Model(problem.spec, problem.physics, params, theta, case.scales, DEFAULT)
            maps = predict(scored, model)
            for how in [USUAL, *(others if seed == 0 else ())]:
                found, used, seconds = frames_of(flow, usable, chosen, model, cells, how)
                row = {"flow": path.stem, "source": flow.attributes.get("source")}
                row |= {"seed": seed, "cells": used, "steps": how[0], "step": how[1]}
                row |= {"frames": len(found), "seconds_of_frame": seconds}
                row |= errors(scored, with_simulated_pressure(maps, dict(enumerate(found))))
                (rows if how == USUAL else variants).append(row)
                print(line(row), flush=True)
    return {"rows": rows, "variants": variants}


def line(row: dict[str, Any]) -> str:
    """The errors of a row: all, flowing, stagnant of each kind."""

    def of(name: str) -> str:
        return name + "".join(f"{number(value, '.2f'):>7}" for value in row[name].values())

    parts = [of(name) for name in ("network", "simulated", "difference")]
    how = f"{row['cells']} cells, {row['steps']} x {row['step']:g}"
    return f"{row['flow']:22s} seed {row['seed']} {how:24s} {'  '.join(parts)}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("flows", type=Path, nargs="+")
    parser.add_argument("--seeds", type=int, default=1, help="members of every flow")
    parser.add_argument("--frames", type=int, default=10)
    parser.add_argument("--cells", type=int, help="across the box; none: as in the flow file")
    parser.add_argument("--settling", nargs="*", default=[], metavar="STEPS:STEP")
    parser.add_argument("--json", type=Path, required=True, help="file for the results")
    given = parser.parse_args()
    torch.set_num_threads(1)
    others = [(int(n), float(step)) for n, step in (text.split(":") for text in given.settling)]
    tensors = load_file(given.checkpoint)
    found = study(given.flows, tensors, given.seeds, given.frames, given.cells, others)
    words = " ".join(Path(a).name for a in sys.argv[1:])
    command = f"python -m bench.studies.simulated_pressure.run {words}"
    raw.write(given.json, {"command": command} | found)
    return 0


if __name__ == "__main__":
    sys.exit(main())
