"""The grains study: laws, the momentum balance on an exact flow, scores."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.studies.grains.coarse import Fields
from bench.studies.grains.materials import (
    BULK_DENSITY,
    BULK_FRACTION,
)
from bench.studies.grains.own_law import own_law, reference
from bench.studies.grains.surface import fraction, surface_height

LAW = {"mu_s": 0.26, "mu_2": 0.74, "I0": 0.3}
TANGENT = 0.40
HEIGHT = 40.0
CELL = 2.0


def bagnold() -> Fields:
    """Steady flow down a slope: I is the same everywhere, p = rho g cos (h - y), tau = p tan."""
    cos = 1 / math.hypot(1, TANGENT)
    number = law_inverse(TANGENT)
    y = CELL * (np.arange(24) + 0.5)
    x = CELL * (np.arange(12) + 0.5)
    depth = np.maximum(HEIGHT - y, 0)
    u = 2 / 3 * number * math.sqrt(cos) * (HEIGHT**1.5 - depth**1.5)
    p = BULK_DENSITY * cos * depth
    stress = np.stack([p, p, -TANGENT * p], axis=-1)
    phi = np.where(y < HEIGHT, BULK_FRACTION, 0.0)
    frames = np.ones((2, 1, len(x)))
    there = (y < HEIGHT)[:, None] * frames > 0
    return Fields(
        t=np.array([0.0, 1.0]),
        y=y,
        x=x,
        phi=phi[:, None] * frames,
        rho=4 / np.pi * phi[:, None] * frames,
        u=np.where(there, u[:, None] * frames, np.nan),
        v=np.where(there, 0.0, np.nan),
        stress=stress[:, None] * frames[..., None],
        coverage=np.ones((len(y), len(x))),
    )


def law_inverse(mu: float) -> float:
    return LAW["I0"] * (mu - LAW["mu_s"]) / (LAW["mu_2"] - mu)


def test_the_own_law_of_bagnolds_flow() -> None:
    fields = bagnold()
    height = surface_height(fields)
    np.testing.assert_allclose(height, HEIGHT, atol=CELL / 2)
    c = fraction(fields, height)
    found = reference(fields, c, steady=True, periodic=True)
    k = found.used
    np.testing.assert_allclose(found.tau_n[k] / found.p[k], TANGENT, rtol=1e-6)
    own = own_law(found, LAW)
    assert own["dissipation_ratio"] == pytest.approx(1, abs=0.01)
    assert own["norm"]["mean"]["mu"] == pytest.approx(TANGENT, rel=1e-6)
    assert own["norm"]["law"] is None  # one I
    assert found.noise["velocity_percent"] < 0.1
