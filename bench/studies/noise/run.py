"""Noise, many draws at once: RMSE of mu_s and mu_2, as bias and scatter, beside the bound.

python -m bench.studies.simulator_fit.bound --mu-s 0.6 --mu-2 0.84 --cells 512 --json bound.json
python -m bench.studies.noise.run FLOW.h5 ... --noise 0.2 0.8 --draws 20 --points 66000 0 \
    --bound bound.json --json noise.json
python -m bench.studies.noise.run --read noise.json --bound bound.json other_bound.json

Every draw has its own noise and its own network; all flows, levels, numbers of points and draws are
one batch. --points thins a flow to so many vectors at random, the same ones for every draw, and 0
keeps all. Noise is white, its standard deviation relative to the largest speed, as in the bound.
Settings that are not its own go to the identification (`--steps 20000 --level V2`).

rmse^2 = bias^2 + sd^2 (n - 1)/n. The bound is for unbiased estimates from the velocity vectors: of
one who knows the initial state, the walls and the equations of the whole box, but not the line of
the free surface, which level V1 knows without noise. The ratio is to the product of sensitivities
on one grid, the smaller of the two bounds, so that it is never too good.
Defends: RMSE of at most 1.45 times the bound; it says what is bias and what is scatter.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies import raw
from bench.studies.draws import read_bounds, read_study, statistics, thinned, where_bounded
from granpinn import identify_many
from granpinn.config import Config, ConfigError, flatten
from granpinn.data import Flow, FlowFileError, read_flow
from granpinn.results import Result
from granpinn.training.progress import Lines

NAMES = ("mu_s", "mu_2")
FIELDS = ("velocity", "pressure", "pressure_flowing", "pressure_stagnant")


@dataclasses.dataclass(frozen=True)
class Task:
    """A flow with a level of noise and so many vectors; all draws of it make a row."""

    name: str
    flow: Flow
    noise: float


def tasks_of(
    flows: Sequence[Flow], noise: Sequence[float], points: Sequence[int]
) -> Iterator[Task]:
    for flow, count in itertools.product(flows, points):
        some = thinned(flow, count)
        if some.truth is None or not all(getattr(some.truth, name) for name in (*NAMES, "I0")):
            raise ConfigError(f"{some.path} must have true_mu_s, true_mu_2 and true_I0, got none")
        for sd in noise:
            yield Task(flow.path.stem if flow.path else "in memory", some, sd)


def study(tasks: Sequence[Task], config: Config, draws: int) -> dict[str, Any]:
    """Train all draws of all tasks as one batch; one row for each task."""
    begin = time.monotonic()
    many = [task for task in tasks for _ in range(draws)]
    found = identify_many(
        [task.flow for task in many],
        config,
        [config.seed + k for _ in tasks for k in range(draws)],
        I0=[task.flow.truth.I0 for task in many],  # type: ignore[union-attr]
        noise=[task.noise for task in many],
        progress=Lines(),
    )
    rows = [row(task, found[k * draws : (k + 1) * draws]) for k, task in enumerate(tasks)]
    return {
        "steps": found[0].timing.steps,
        "device": found[0].device,
        "training_s": max(result.timing.wall_s for result in found),
        "total_s": time.monotonic() - begin,
        "rows": rows,
    }


def row(task: Task, results: Sequence[Result]) -> dict[str, Any]:
    """The draws of a task: signed errors in % one by one, and their statistics."""
    truth, ended = task.flow.truth, [r for r in results if r.failure is None]
    errors = {
        name: [100 * (getattr(r.parameters, name).value / getattr(truth, name) - 1) for r in ended]
        for name in NAMES
    }
    fields = {
        name: [value for r in ended if (value := r.error_percent[name]) is not None]
        for name in FIELDS
    }
    return {
        "flow": task.name,
        "mu_s": getattr(truth, "mu_s", None),
        "mu_2": getattr(truth, "mu_2", None),
        "noise": task.noise,
        "points": results[0].data.n_points,
        "draws": len(ended),
        "failed": len(results) - len(ended),
        "draws_percent": errors,
        "errors_percent": {name: statistics(values) for name, values in errors.items()},
        "median_percent": {name: float(np.median(v)) if v else None for name, v in fields.items()},
    }


def with_bounds(
    rows: Sequence[dict[str, Any]], bounds: Sequence[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Rows with the bounds in % and the ratio of the RMSE to them, where their law is known."""

    def compared(known: dict[str, Any], factor: float, rmse: dict[str, float]) -> dict[str, Any]:
        grids = ("one_grid", "two_grids")
        least = {n: {g: known[g][f"{n}_percent"] * factor for g in grids} for n in NAMES}
        ratios = {n: rmse[n] / least[n]["one_grid"] for n in NAMES}
        return {"bound_percent": least, "rmse_over_bound": ratios}

    return where_bounded(rows, bounds, compared)


def text(rows: Sequence[dict[str, Any]]) -> str:
    """mu_s | mu_2: RMSE = bias and sd, the bound and the ratio."""
    head = f"{'case':<14}{'noise':>6}{'N':>9}{'draws':>6}"
    lines = [head + "".join(f"   {n} rmse  bias    sd bound ratio" for n in NAMES) + "  eps_p"]
    for row in rows:
        line = f"({row['mu_s']:.2f}, {row['mu_2']:.2f})  {row['noise']:6.2f}{row['points']:9d}"
        line += f"{row['draws']:6d}"
        for name in NAMES:
            s = row["errors_percent"][name]
            line += f"   {s['rmse']:9.2f}{s['bias']:+6.1f}{s['sd']:6.2f}"
            if "bound_percent" in row:
                line += f"{row['bound_percent'][name]['one_grid']:6.2f}"
                line += f"{row['rmse_over_bound'][name]:6.1f}"
            else:
                line += f"{'-':>6}{'-':>6}"
        pressure = row["median_percent"]["pressure"]
        line += f"{'-':>7}" if pressure is None else f"{pressure:7.1f}"
        lines.append(line + (f"  {row['failed']} diverged" if row["failed"] else ""))
    return "\n".join(lines)


def parser() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    made.add_argument("flows", type=Path, nargs="*", help="flow files with known parameters")
    made.add_argument("--noise", type=float, nargs="+", default=[0.2, 0.8], help="levels")
    made.add_argument("--draws", type=int, default=20, help="of the noise, at each level")
    made.add_argument("--points", type=int, nargs="+", default=[66000], help="vectors; 0: all")
    made.add_argument("--bound", type=Path, nargs="+", default=[], help="of simulator_fit.bound")
    made.add_argument("--read", type=Path, help="show an earlier study, with these bounds")
    made.add_argument("--json", type=Path, help="file for the results")
    return made


def main() -> int:
    options, words = parser().parse_known_args()
    if bool(options.flows) == bool(options.read):
        parser().error("give flow files, or --read an earlier study")
    try:
        if options.read:
            found = read_study(options.read)
        else:
            config = raw.config_of(words)
            flows = [read_flow(path) for path in options.flows]
            tasks = list(tasks_of(flows, options.noise, options.points))
            found = {"settings": flatten(config)} | study(tasks, config, options.draws)
    except (ConfigError, FlowFileError) as error:
        parser().error(str(error))
    found["rows"] = with_bounds(found["rows"], read_bounds(options.bound))
    raw.write(options.json, found)
    print(text(found["rows"]))
    members = sum(row["draws"] + row["failed"] for row in found["rows"])
    print(
        f"{members} trainings of {found['steps']} steps on {found['device']}: "
        f"{found['training_s']:.0f} s of training, {found['total_s']:.0f} s in all"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
