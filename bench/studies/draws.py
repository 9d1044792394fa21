"""Many draws of the noise: fewer vectors of a flow, statistics, the bound beside them."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.config import ConfigError
from granpinn.data import Flow

LAW = ("mu_s", "mu_2")  # what tells the bound of one law from that of another


def thinned(flow: Flow, points: int, seed: int = 0) -> Flow:
    """The flow with so many of its velocity vectors after the start, drawn at random; 0: all.

    ConfigError: it has fewer.
    """
    if points == 0:
        return flow
    there = np.flatnonzero(flow.valid & (flow.t > 0)[:, None, None])
    if points > len(there):
        raise ConfigError(f"--points must be at most {len(there)}, the vectors of a flow: {points}")
    kept = np.random.default_rng(seed).choice(there, points, replace=False)
    u, v = np.full_like(flow.u, np.nan), np.full_like(flow.v, np.nan)
    u.flat[kept], v.flat[kept] = flow.u.flat[kept], flow.v.flat[kept]
    return dataclasses.replace(flow, u=u, v=v)


def statistics(errors: Sequence[float]) -> dict[str, float]:
    """RMSE, bias and standard deviation in %, and the standard error of the first two."""
    n = len(errors)
    if n < 2:
        return dict.fromkeys(("rmse", "bias", "sd", "rmse_error", "bias_error"), math.nan)
    e = np.asarray(errors)
    rmse, sd = float(np.sqrt(np.mean(e**2))), float(e.std(ddof=1))
    return {
        "rmse": rmse,
        "bias": float(e.mean()),
        "sd": sd,
        "rmse_error": float(np.std(e**2, ddof=1)) / (2 * rmse * math.sqrt(n)) if rmse else 0.0,
        "bias_error": sd / math.sqrt(n),
    }


def known_bound(
    row: dict[str, Any], bounds: Sequence[dict[str, Any]]
) -> tuple[dict[str, Any], float] | None:
    """The bound of the law of a row, and its factor at the noise and the points of the row."""
    for known in bounds:
        if all(math.isclose(known[name], row[name], abs_tol=1e-9) for name in LAW):
            noise = row["noise"] / known["noise"]
            return known, noise * math.sqrt(known["points"] / row["points"])
    return None


def read_bounds(files: Sequence[Path]) -> list[dict[str, Any]]:
    """The rows of bench.studies.simulator_fit.bound."""
    rows = [known for path in files for known in json.loads(path.read_text())["rows"]]
    return [_with_nan(known) for known in rows]


def read_study(path: Path) -> dict[str, Any]:
    """An earlier study from its file."""
    found: dict[str, Any] = json.loads(path.read_text())
    for row in found["rows"]:
        row["errors_percent"] = _with_nan(row["errors_percent"])
    return found


def _with_nan(value: Any) -> Any:
    """NaN again where the file has null, as JSON has no NaN."""
    if isinstance(value, dict):
        return {name: _with_nan(part) for name, part in value.items()}
    return math.nan if value is None else value


def where_bounded(
    rows: Sequence[dict[str, Any]],
    bounds: Sequence[dict[str, Any]],
    compared: Callable[[dict[str, Any], float, dict[str, float]], dict[str, Any]],
) -> list[dict[str, Any]]:
    """Rows, where their law is known with what `compared` makes of its bound, the factor for noise
    and vectors, and the RMSE of each name in %."""
    made = []
    for row in rows:
        found = known_bound(row, bounds)
        rmse = {name: errors["rmse"] for name, errors in row["errors_percent"].items()}
        made.append(row if found is None else row | compared(*found, rmse))
    return made


def with_bounds(
    rows: Sequence[dict[str, Any]], bounds: Sequence[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Rows with the bound in % and the ratio of the RMSE to it, where their law is known.

    The bound is the joint one where I0 is among the unknowns.
    """

    def compared(known: dict[str, Any], factor: float, rmse: dict[str, float]) -> dict[str, Any]:
        grid = known["one_grid"]
        joint = grid["joint_percent"] if "I0" in rmse else {n: grid[f"{n}_percent"] for n in rmse}
        least = {n: joint[n] * factor for n in rmse}
        ratios = {n: rmse[n] / least[n] if least[n] else None for n in rmse}
        return {"bound_percent": least, "rmse_over_bound": ratios}

    return where_bounded(rows, bounds, compared)
