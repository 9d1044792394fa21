"""Least and largest values of the settings that are numbers (config.py)."""

from __future__ import annotations

import math

TINY = 1e-30
RANGES: tuple[tuple[str, float, float], ...] = (
    ("noise", 0, 100),
    ("I0", TINY, 1e6),
    ("seed", 0, 2**63 - 1),
    ("members", 1, 1024),
    ("max_time", 1, math.inf),
    ("steps", 1, 2**53),
    ("epochs", 1, 2**53),
    ("log_every", 1, 2**53),
    ("checkpoint_every", 0, math.inf),
    ("rheology.mu_s", 1e-6, 1 - 1e-6),
    ("rheology.mu_2", 1e-6, 1e3),
    ("rheology.p_floor", TINY, 1e3),
    ("network.pressure_scale", TINY, 1e6),
    ("weights.sigma_velocity", 1e-9, math.inf),
    ("weights.noise_part", 0, 1),
    ("weights.noise_rise", 1e-6, 1),
    ("weights.sigma_surface", 1e-9, math.inf),
    ("weights.sigma_momentum", 1e-9, math.inf),
    ("weights.sigma_continuity", 1e-9, math.inf),
    ("weights.sigma_constitutive", 1e-9, math.inf),
    ("batch.interior", 1, 2**31),
    ("batch.surface", 0, 2**31),
    ("batch.collocation", 0, 100),
    ("optimizer.learning_rate", 0, 1e3),
    ("optimizer.muon_learning_rate", 0, 1e3),
    ("optimizer.scalars_learning_rate", 0, 1e3),
    ("optimizer.final_fraction", 0, 1),
    ("optimizer.prefit_final_fraction", 0, 1),
    ("optimizer.warm_up", 0, 0.5),
    ("optimizer.beta_2", 0, 1),
    ("optimizer.prefit", 0, 1),
    ("optimizer.average", 0, 1),
    ("optimizer.epsilon", TINY, 1),
    ("optimizer.momentum", 0, 1),
    ("profile.values", 3, 99),
    ("profile.reach", 1.01, 1e3),
    ("profile.seeds", 2, 999),
    ("profile.law_accuracy", 0, 1),
    ("resimulation.cells", 32, 8192),
    ("simulated_pressure.frames", 0, 10000),
    ("simulated_pressure.cells", 32, 8192),
)


def range_text(low: float, high: float) -> str:
    """A range in words."""
    if low == TINY:
        return "positive"
    return f"at least {low:g}" if math.isinf(high) or high >= 2**31 else f"in [{low:g}, {high:g}]"
