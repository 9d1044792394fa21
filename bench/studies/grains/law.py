"""mu(I) = mu_s + (mu_2 - mu_s) I/(I + I0): fits with I0 = 0.3, and errors of one law by another."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from bench.studies.grains.materials import I0
from granpinn.arrays import Float64
from granpinn.physics.laws import LAWS

# Inertial numbers at which laws are compared.
SCORED = (0.01, 0.03, 0.055, 0.10, 0.185)
SLOWEST = 3e-3  # least inertial number of a cell that counts as flowing
BINS = 12
LEAST_CELLS = 20  # of a bin

Friction = Callable[[Float64 | float], Float64]  # mu of I
NARROW = 2.0  # a range of I over less than this factor holds a mu and no law


def fit(inertial_number: Float64, mu: Float64, se: Float64 | None = None) -> dict[str, float]:
    """mu_s and mu_2 at I0 = 0.3 with standard deviations, by weighted least squares.

    mu is linear in (mu_s, mu_2), so this is a linear problem. Standard deviations are widened by
    the scatter where that is larger than `se` states; without `se` they come from the scatter.

    Args:
        inertial_number, mu, se: points of the law and the standard error of mu, [n].
    """
    x = inertial_number / (inertial_number + I0)
    weights = np.ones_like(mu) if se is None else 1 / se
    matrix = np.stack([1 - x, x], axis=1) * weights[:, None]
    values, *_ = np.linalg.lstsq(matrix, mu * weights, rcond=None)
    residual = matrix @ values - mu * weights
    chi2 = float(residual @ residual) / max(1, len(mu) - 2)
    covariance = np.linalg.inv(matrix.T @ matrix) * (chi2 if se is None else max(1.0, chi2))
    mu_s_sd, mu_2_sd = np.sqrt(np.diag(covariance))
    return {
        "mu_s": float(values[0]),
        "mu_2": float(values[1]),
        "I0": I0,
        "mu_s_sd": float(mu_s_sd),
        "mu_2_sd": float(mu_2_sd),
        "chi2": chi2,
    }


def mu_of_i(law: Mapping[str, float], inertial_number: Float64 | float) -> Float64:
    """The law at inertial numbers."""
    i = np.asarray(inertial_number, dtype=np.float64)
    return np.asarray(law["mu_s"] + (law["mu_2"] - law["mu_s"]) * i / (i + law["I0"]))


def friction(name: str, values: Mapping[str, float]) -> Friction:
    """mu of I by a law with the values of its parameters."""

    def mu(inertial_number: Float64 | float) -> Float64:
        return np.asarray(LAWS[name].friction(np.asarray(inertial_number), *values.values()))

    return mu


def errors_percent(
    mu: Friction, truth: Mapping[str, float], low: float, high: float
) -> dict[str, float]:
    """100 (mu/mu_true - 1) at the inertial numbers of SCORED within low..high."""
    return {
        f"{i:g}": float(100 * (mu(i) / mu_of_i(truth, i) - 1)) for i in SCORED if low <= i <= high
    }


def number_range(inertial_number: Float64) -> tuple[float, float]:
    """5th and 95th percentile of I over the flowing cells."""
    flowing = inertial_number[inertial_number > SLOWEST]
    if len(flowing) == 0:
        return SLOWEST, SLOWEST
    low, high = np.percentile(flowing, (5, 95))
    return float(low), float(high)


def binned_law(inertial_number: Float64, tau: Float64, p: Float64) -> dict[str, Any]:
    """mu = <tau>/<p> in bins of log I between the 5th and 95th percentile, and the fitted law.

    Args:
        inertial_number, tau, p: of the cells, [n]; cells that do not flow are left out.

    Returns:
        I_range, mean (I and mu of all, weighted with p), points (I, mu, se, cells) and law; law is
        None where the range is narrow or fewer than three bins are filled.
    """
    low, high = number_range(inertial_number)
    edges = np.geomspace(low, high, BINS + 1)
    points = []
    for a, b in pairwise(edges):
        k = (inertial_number >= a) & (inertial_number < b)
        if k.sum() >= LEAST_CELLS:
            pressure = p[k].mean()
            mu = tau[k].mean() / pressure
            se = (tau[k] - mu * p[k]).std() / pressure / np.sqrt(k.sum())
            row = {"I": inertial_number[k].mean(), "mu": mu, "se": se, "cells": int(k.sum())}
            points.append({name: float(value) for name, value in row.items()})
    law = None
    if len(points) > 2 and high > NARROW * low:
        law = fit(*(np.array([row[name] for row in points]) for name in ("I", "mu", "se")))
    k = (inertial_number >= low) & (inertial_number <= high)
    mean = None
    if k.any():
        i, mu = (float(a[k].sum() / p[k].sum()) for a in (inertial_number * p, tau))
        mean = {"I": i, "mu": mu}
    return {"I_range": [low, high], "mean": mean, "points": points, "law": law}
