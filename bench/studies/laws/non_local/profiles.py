"""Friction and shear rate by the distance from where grains flow.

A local law has no shear rate where |tau|/p is below its mu_s. Measured is how the shear rate
falls there: gamma_dot ~ exp(-depth / L). In the non-local granular fluidity (Kamrin & Koval, Phys.
Rev. Lett. 108, 178301, 2012) far below yield,

    L = xi = A d / sqrt(mu_s - mu)

for straight layers; A is a constant of the material.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from bench.studies.laws.non_local.zones import FEWEST_TILES, Zones, cross, jackknife
from granpinn.arrays import Bool, Float64

STEP = 2.0  # d, the cells
FEWEST = 5  # cells in a layer
CLEAR = 0.7  # least part of the shear rate that both means share
REACH = 10.0  # d below the yield depth, over which the fall is fitted


def profile(zones: Zones) -> list[dict[str, float]]:
    """Layer by layer: depth, shear rate, the part of it that both means share, I, pressure,
    friction |<tau>|/<p> with its error, its part along the strain rate, and cells."""
    rows = []
    depth = zones.depth
    for k in range(int(np.nanmax(depth[zones.layers]) / STEP) + 1):
        here = zones.layers & (depth >= k * STEP) & (depth < (k + 1) * STEP)
        if here.sum() < FEWEST:
            continue
        if len(np.unique(zones.tile[here])) < FEWEST_TILES:
            continue
        mu, se = jackknife(lambda cells: _friction(zones, cells), zones.tile, here)
        square = cross(zones.D)[here].mean()
        own = (zones.D[:, here] ** 2).sum(axis=-1).mean()
        rate, p = 2 * np.sqrt(max(square, 0.0)), zones.p[:, here].mean()
        row = {
            "depth": depth[here].mean(),
            "rate": rate,
            "shared": np.sqrt(max(square, 0.0) / own),
            "I": rate * np.sqrt(zones.density / p),
            "p": p,
            "mu": mu,
            "mu_se": se,
            "along": _along(zones, here),
            "cells": here.sum(),
        }
        rows.append({name: float(value) for name, value in row.items()})
    return rows


def _friction(zones: Zones, here: Bool) -> Float64:
    """|<tau>|/<p> of the cells of a layer, whose strain rate has one direction."""
    mean = zones.tau[:, here].mean(axis=(0, 1))
    return np.asarray(np.hypot(*mean) / zones.p[:, here].mean())


def _along(zones: Zones, here: Bool) -> float:
    """The part of the deviator of a layer along its strain rate, over the pressure."""
    tau, D = (a[:, here].mean(axis=(0, 1)) for a in (zones.tau, zones.D))
    return float(tau @ D / np.hypot(*D) / zones.p[:, here].mean())


def creep(rows: list[dict[str, float]], mu_s: float) -> dict[str, Any] | None:
    """How the shear rate falls in the layers below yield: friction below mu_s, and a shear rate
    clear of noise, over a depth of REACH.

    Returns:
        depth, I, mu, mu_se: of the first and the last layer; length and length_se: L; decades that
        the shear rate falls; A from L.
        None with fewer than four such layers.
    """
    below = [k for k, row in enumerate(rows) if row["mu"] < mu_s]
    first = next((k for k in below if all(row["mu"] < mu_s for row in rows[k:])), None)
    if first is None:
        return None
    found = []
    for row in rows[first:]:
        if row["shared"] < CLEAR or row["depth"] > rows[first]["depth"] + REACH:
            break
        found.append(row)
    if len(found) < 4:
        return None
    z, rate, mu = (np.array([row[k] for row in found]) for k in ("depth", "rate", "mu"))
    (slope, _), covariance = np.polyfit(z, np.log(rate), 1, cov=True)
    length = -1 / slope
    return {
        "depth": [z[0], z[-1]],
        "I": [found[0]["I"], found[-1]["I"]],
        "mu": [mu[0], mu[-1]],
        "mu_se": [found[0]["mu_se"], found[-1]["mu_se"]],
        "length": length,
        "length_se": np.sqrt(covariance[0, 0]) * length**2,
        "decades": np.log10(rate[0] / rate[-1]),
        "A": length * np.sqrt((mu_s - mu).mean()),
    }
