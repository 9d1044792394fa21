"""I0 as a third unknown, many draws of the noise at once: its errors beside the bound, the answer.

python -m bench.studies.simulator_fit.bound --mu-s 0.4 --mu-2 0.64 --cells 512 --json bound.json
python -m bench.studies.inertial_number.run FLOW.h5 ... --noise 0.02 --draws 6 --bound bound.json \
    --json I0.json

Every draw is trained at every I0 of a grid around the true one, as --free-I0 does, and all are one
batch. The estimate of a draw is the vertex of the parabola through the least losses in log I0, with
mu_s and mu_2 between the two neighbors there; a draw whose least loss is at an end of the grid has
none. The answer is that of --free-I0 with the draws as its seeds. The bound is the joint one, for
three unknowns. Settings that are not its own go to the identification (`--steps 20000`).
Defends: errors of at most 1.5 times the joint bound, or an answer that says what cannot be told.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies import raw
from bench.studies.draws import read_bounds, read_study, statistics, thinned, with_bounds
from granpinn import identify_many
from granpinn.checks.profile_of_I0 import (
    fair_losses,
    grid_of,
    profile_from,
    settings_of,
    vertex,
)
from granpinn.config import Config, ConfigError, flatten
from granpinn.data import Flow, FlowFileError, Truth, read_flow
from granpinn.results import Result
from granpinn.training.guard import NonFiniteError
from granpinn.training.progress import Lines

NAMES = ("mu_s", "mu_2", "I0")


def settings(words: Sequence[str], values: int, reach: float) -> Config:
    """Those of the trainings of a profile."""
    config = raw.config_of(words, {"profile.values": values, "profile.reach": reach})
    return settings_of(config)


def study(flows: Sequence[Flow], config: Config, noise: float, draws: int) -> dict[str, Any]:
    """Train every draw of every flow at every I0 as one batch; a row for each flow."""
    begin = time.monotonic()
    many = [
        (flow, I0, config.seed + k)
        for flow in flows
        for I0 in grid_of(dataclasses.replace(config, I0=_truth(flow)[2]))
        for k in range(draws)
    ]
    found = identify_many(
        [flow for flow, _, _ in many],
        config,
        [seed for _, _, seed in many],
        I0=[I0 for _, I0, _ in many],
        noise=[noise] * len(many),
        progress=Lines(),
    )
    each = config.profile.values * draws
    rows = [
        row(flow, found[k * each : (k + 1) * each], config, noise) for k, flow in enumerate(flows)
    ]
    return {
        "steps": found[0].timing.steps,
        "device": found[0].device,
        "trainings": len(found),
        "training_s": max(result.timing.wall_s for result in found),
        "total_s": time.monotonic() - begin,
        "rows": rows,
    }


def row(flow: Flow, results: Sequence[Result], config: Config, noise: float) -> dict[str, Any]:
    """Estimates of the draws, their errors in %, and the answer over all."""
    truth = _truth(flow)
    estimates = estimates_of(results)
    known = [draw for draw in estimates if draw is not None]
    errors = {
        name: [100 * (draw[k] / truth[k] - 1) for draw in known] for k, name in enumerate(NAMES)
    }
    try:
        profile = dataclasses.asdict(profile_from(results, config.profile.law_accuracy, truth[2]))
    except NonFiniteError as error:
        profile = {"answer": str(error), "points": []}
    return {
        "flow": flow.path.stem if flow.path else "in memory",
        **dict(zip(NAMES, truth, strict=True)),
        "noise": noise,
        "points": results[0].data.n_points,
        "draws": len(estimates),
        "at_an_end": len(estimates) - len(known),
        "estimates": estimates,
        "errors_percent": {name: statistics(values) for name, values in errors.items()},
        "profile": profile,
    }


def estimates_of(results: Sequence[Result]) -> list[tuple[float, float, float] | None]:
    """(mu_s, mu_2, I0) of every draw whose trainings ended; None where no I0 is the best inside."""
    grid = np.array(sorted({r.parameters.I0.value for r in results}))
    ended = {(r.parameters.I0.value, r.seed): r for r in results if r.failure is None and r.loss}
    seeds = sorted({r.seed for r in results})
    found: list[tuple[float, float, float] | None] = []
    for seed in seeds:
        if not all((I0, seed) in ended for I0 in grid.tolist()):
            continue
        column = [ended[I0, seed] for I0 in grid.tolist()]
        laws = [r.parameters for r in column]
        loss = fair_losses([[r] for r in column])[:, 0]
        best = int(np.argmin(loss))
        if best in (0, len(grid) - 1):
            found.append(None)
            continue
        I0 = vertex(np.log(grid), loss - loss[best], best)
        mu_s, mu_2 = (
            float(np.interp(math.log(I0), np.log(grid), values))
            for values in zip(*((p.mu_s.value, p.mu_2.value) for p in laws), strict=True)
        )
        found.append((mu_s, mu_2, I0))
    return found


def _truth(flow: Flow) -> tuple[float, float, float]:
    truth = flow.truth or Truth()
    values = (truth.mu_s, truth.mu_2, truth.I0)
    if not all(values):
        raise ConfigError(f"{flow.path} must have true_mu_s, true_mu_2 and true_I0, got none")
    return values


def text(rows: Sequence[dict[str, Any]]) -> str:
    """For each flow RMSE (bias) of the three beside the bound, and the answer."""
    lines = []
    for row in rows:
        lines.append(
            f"({row['mu_s']:.2f}, {row['mu_2']:.2f}), noise {row['noise']:.2f}, {row['points']} "
            f"vectors, {row['draws']} draws, {row['at_an_end']} without a best I0 inside"
        )
        for name in NAMES:
            s = row["errors_percent"][name]
            line = f"  {name:<5} rmse {s['rmse']:6.2f} %  bias {s['bias']:+6.2f}  sd {s['sd']:6.2f}"
            if "bound_percent" in row:
                line += f"  bound {row['bound_percent'][name]:6.2f}"
                line += f"  ratio {row['rmse_over_bound'][name]:5.1f}"
            lines.append(line)
        lines.append(f"  {row['profile']['answer']}")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("flows", type=Path, nargs="*", help="flow files with known parameters")
    parser.add_argument("--noise", type=float, default=0.02)
    parser.add_argument("--draws", type=int, default=6, help="of the noise")
    parser.add_argument("--values", type=int, default=5, help="values of I0")
    parser.add_argument("--reach", type=float, default=2.0, help="largest I0 over the true one")
    parser.add_argument("--points", type=int, default=0, help="vectors; 0: all")
    parser.add_argument("--bound", type=Path, nargs="+", default=[], help="of simulator_fit.bound")
    parser.add_argument("--read", type=Path, help="show an earlier study, with these bounds")
    parser.add_argument("--json", type=Path, help="file for the results")
    options, words = parser.parse_known_args()
    if bool(options.flows) == bool(options.read):
        parser.error("give flow files, or --read an earlier study")
    try:
        if options.read:
            found = read_study(options.read)
        else:
            config = settings(words, options.values, options.reach)
            flows = [thinned(read_flow(path), options.points) for path in options.flows]
            found = {"settings": flatten(config)}
            found |= study(flows, config, options.noise, options.draws)
    except (ConfigError, FlowFileError) as error:
        parser.error(str(error))
    found["rows"] = with_bounds(found["rows"], read_bounds(options.bound))
    raw.write(options.json, found)
    print(text(found["rows"]))
    print(
        f"{found['trainings']} trainings of {found['steps']} steps on {found['device']}: "
        f"{found['training_s']:.0f} s of training, {found['total_s']:.0f} s in all"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
