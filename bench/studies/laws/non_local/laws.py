"""What local laws make of a scene: friction at one I in several places, and fits of the laws.

The laws are fitted to |tau|/p along the strain rate, cell by cell, with the weights that the loss
of a training gives the law: gamma_dot^2 / (1 + (gamma_dot/c)^2), where c is the shear rate above
which the law counts by its relative error (granpinn/training/tolerances.py). `alike` gives all
cells the same weight.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from bench.studies.grains.law import mu_of_i
from bench.studies.grains.make import FLOW
from bench.studies.laws.non_local.zones import FEWEST_TILES, Zones, cross, jackknife
from granpinn.arrays import Bool, Float64
from granpinn.config import Config
from granpinn.fit.case import pose
from granpinn.physics.laws import LAWS
from granpinn.results.zones import D2_STAGNANT

EDGES = 10 ** np.arange(-4, -0.4, 0.25)  # of the bins of I
AT = (3e-4, 1e-3, 3e-3, 1e-2, 3e-2)  # inertial numbers at which scenes are compared
FEWEST = 8  # cells in a bin
# Law, and the parameters that are fitted; the others have their usual values.
FITTED = {
    "coulomb": ("coulomb", ("mu_s",)),
    "mu_of_i": ("mu_of_i", ("mu_s", "mu_2")),
    "regularised": ("regularised", ("mu_s", "mu_2")),
    "regularised, alpha and I1 free": ("regularised", ("mu_s", "mu_2", "alpha", "I1")),
}


@dataclass(frozen=True)
class Cells:
    """Cells of a scene, n of them: I, tau along D, |tau|^2 without bias by noise, p, weights of a
    training, depth, tile, and whether a training counts them as flowing."""

    number: Float64
    tau: Float64
    square: Float64
    p: Float64
    weight: Float64
    depth: Float64
    tile: Float64
    flows: Bool


def cells_of(zones: Zones, folder: Path) -> Cells:
    """The used cells with a positive pressure, and their weights in a training of this file."""
    case = pose(folder / FLOW, Config(level="V1" if zones.free_surface else "V0"))
    kept = zones.used & (zones.p.mean(axis=0) > 0)
    p, number = zones.p.mean(axis=0)[kept], zones.number[kept]
    rate = number * np.sqrt(p / zones.density)
    limit = case.member.problem.physics.law_rate / case.scales.time
    weight = rate**2 / (1 + (rate / limit) ** 2)
    flows = rate / 2 * case.scales.time >= D2_STAGNANT
    return Cells(
        number,
        zones.along[kept],
        cross(zones.tau)[kept],
        p,
        weight / weight.mean(),
        zones.depth[kept],
        zones.tile[kept],
        flows,
    )


def curve(cells: Cells) -> list[dict[str, float]]:
    """In bins of log I: mu = <tau>/<p> along D, and by the norm, sqrt(<|tau|^2>)/<p>, with the
    errors of a jackknife."""
    rows = []
    for low, high in pairwise(EDGES):
        here = (cells.number >= low) & (cells.number < high)
        if here.sum() < FEWEST or len(np.unique(cells.tile[here])) < FEWEST_TILES:
            continue
        (mu, norm), (se, norm_se) = jackknife(lambda k: _frictions(cells, k), cells.tile, here)
        row = {
            "I": np.exp(np.log(cells.number[here]).mean()),
            "mu": mu,
            "se": se,
            "norm": norm,
            "norm_se": norm_se,
            "cells": here.sum(),
        }
        rows.append({name: float(value) for name, value in row.items()})
    return rows


def _frictions(cells: Cells, k: Bool) -> Float64:
    norm = np.sqrt(max(cells.square[k].mean(), 0.0))
    return np.asarray([cells.tau[k].mean() / cells.p[k].mean(), norm / cells.p[k].mean()])


def at_one_number(
    curves: dict[str, list[dict[str, float]]], names: tuple[str, str], truth: dict[str, float]
) -> list[dict[str, Any]]:
    """The friction of several scenes at the same I: their range and chi^2 about the mean.

    The curve of each scene is interpolated in log I, and never beyond its bins.

    Args:
        curves: of the scenes, by name.
        names: of the friction and of its error in the curves.
        truth: the law of the shear cell, for comparison.
    """
    rows = []
    for number in AT:
        found = {}
        for name, points in curves.items():
            if not points or not points[0]["I"] <= number <= points[-1]["I"]:
                continue
            x = np.log([p["I"] for p in points])
            found[name] = [
                float(np.interp(np.log(number), x, [p[key] for p in points])) for key in names
            ]
        if len(found) < 2:
            continue
        mu, se = np.array(list(found.values())).T
        mean = (mu / se**2).sum() / (1 / se**2).sum()
        rows.append(
            {
                "I": number,
                "scenes": found,
                "shear_cell": float(mu_of_i(truth, number)),
                "mean": mean,
                "range_percent": 100 * (mu.max() - mu.min()) / mean,
                "chi2_per_degree": (((mu - mean) / se) ** 2).sum() / (len(mu) - 1),
            }
        )
    return rows


def fitted(cells: Cells, weight: Float64, name: str) -> tuple[dict[str, float], Float64]:
    """The parameters of a law of FITTED, by weighted least squares, and its friction at the cells.

    Residuals are relative, tau/(mu p) - 1 in the limit of small ones: (tau/p - mu)/mean(tau/p).
    """
    law, free = FITTED[name]
    usual = {p.name: p.start for p in LAWS[law].parameters}
    names = list(usual)

    def friction(logs: Float64) -> Float64:
        values = usual | dict(zip(free, np.exp(logs), strict=True))
        return np.asarray(LAWS[law].friction(cells.number, *(values[k] for k in names)))

    ratio = cells.tau / cells.p
    found = least_squares(
        lambda logs: np.sqrt(weight) * (friction(logs) - ratio),
        np.log([usual[k] for k in free]),
    )
    return dict(zip(free, np.exp(found.x).tolist(), strict=True)), friction(found.x)


def judged(cells: Cells, weight: Float64) -> dict[str, Any]:
    """Every law of FITTED with its parameters, its error in bins of I, and its halves."""
    made: dict[str, Any] = {}
    for name in FITTED:
        theta, mu = fitted(cells, weight, name)
        made[name] = {
            "parameters": theta,
            "too_high_percent": _too_high(cells, mu),
            "halves": {
                "rate": _halves(cells, weight, mu, cells.number > _median(cells.number, weight)),
                "depth": _halves(cells, weight, mu, cells.depth > _median(cells.depth, weight)),
            },
        }
    return made


def _too_high(cells: Cells, mu: Float64) -> list[dict[str, float]]:
    """100 (law / measured - 1) in bins of I."""
    rows = []
    for low, high in pairwise(10.0 ** np.arange(-4, 0, 1)):
        here = (cells.number >= low) & (cells.number < high)
        if here.sum() < FEWEST or len(np.unique(cells.tile[here])) < FEWEST_TILES:
            continue
        value, se = jackknife(
            lambda k: 100 * ((mu * cells.p)[k].sum() / cells.tau[k].sum() - 1), cells.tile, here
        )
        rows.append({"I_from": low, "I_to": high, "percent": float(value), "se": float(se)})
    return rows


def _halves(cells: Cells, weight: Float64, mu: Float64, second: Bool) -> dict[str, float]:
    """By how much more friction, in % of the law, the second half needs than the first."""

    def more(k: Bool) -> float:
        first, last = (
            (weight * cells.tau)[h].sum() / (weight * mu * cells.p)[h].sum()
            for h in (k & ~second, k & second)
        )
        return float(100 * (last / first - 1))

    value, se = jackknife(more, cells.tile, np.ones_like(second))
    return {"percent": float(value), "se": float(se)}


def _median(values: Float64, weight: Float64) -> float:
    return quantiles(values, weight, (0.5,))[0]


def quantiles(values: Float64, weight: Float64, levels: Sequence[float]) -> list[float]:
    """Weighted quantiles."""
    order = np.argsort(values)
    share = np.cumsum(weight[order])
    places = np.searchsorted(share, np.asarray(levels) * share[-1])
    return [float(v) for v in values[order][places]]


def reached(cells: Cells, truth: dict[str, float]) -> dict[str, Any]:
    """Which I the data hold (5 to 95 %), and the part of slow cells and of their weight."""
    slow = cells.number < 1e-3
    below = cells.tau < truth["mu_s"] * cells.p
    alike = np.ones_like(cells.weight)
    return {
        "I_all": quantiles(cells.number, alike, (0.05, 0.95)),
        "I_flowing": quantiles(cells.number[cells.flows], alike[cells.flows], (0.05, 0.95)),
        "I_weighted": quantiles(cells.number, cells.weight, (0.05, 0.95)),
        "cells": len(slow),
        "slow_percent": float(100 * slow.mean()),
        "slow_weight_percent": float(100 * cells.weight[slow].sum() / cells.weight.sum()),
        "slow_below_mu_s_percent": float(100 * below[slow].mean()) if slow.any() else None,
        "flowing_below_mu_s_percent": float(100 * below[cells.flows].mean()),
    }
