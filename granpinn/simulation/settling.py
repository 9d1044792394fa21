"""The pressure that belongs to a velocity: the solver is started there, for next to no time.

Momentum balance, the law (clamped at eta_max), the floor and the plane of symmetry decide the
pressure of a velocity, but only together with the velocity that follows from it. So the solver
takes a few steps, so short that the grains stay where they are. First the velocity is made free of
divergence on the grid, whatever impulse that takes: three steps of almost no length, each from the
velocity of the one before and none from its pressure. Then the rotational form of the pressure
update (csrc/collapse/time_step.h) contracts the error inside plugs by up to three per step.

The pressure changes by up to 1 % in that time, so the start has to be as much earlier.  STEPS and
STEP were measured on six collapses (bench/studies/simulated_pressure).
"""

from __future__ import annotations

import math

import numpy as np

from granpinn.simulation.engine import Array, Engine, Start, State
from granpinn.simulation.parameters import Collapse

STEPS = 40
STEP = 6e-5  # of sqrt(height / |g|)
PROJECTIONS = 3
PROJECTION_STEP = 3e-7  # of sqrt(height / |g|)


def settled_after(collapse: Collapse, steps: int = STEPS, step: float = STEP) -> float:
    """How much later than `start` the state of `settle` is."""
    return steps * step * math.sqrt(collapse.height / math.hypot(*collapse.gravity))


def settle(collapse: Collapse, start: Start, steps: int = STEPS, step: float = STEP) -> State:
    """The state whose pressure belongs to the velocity of `start`.

    Args:
        collapse: the box and the material; its height is the unit of time, sqrt(height / |g|).
        steps, step: how many, and how long in that unit.

    Raises:
        SimulationError: a solve did not converge.
    """
    unit = math.sqrt(collapse.height / math.hypot(*collapse.gravity))
    for _ in range(PROJECTIONS):
        engine = Engine(collapse, start)
        engine.step(PROJECTION_STEP * unit)
        state = engine.state()
        start = Start(start.c, _widened(state.u, start.u), _widened(state.v, start.v))
    for _ in range(steps):
        engine.step(step * unit)
    return engine.state()


def _widened(values: Array, like: Array) -> Array:
    """Values on the window as values on the whole box, 0 beyond the window."""
    out = np.zeros_like(like)
    out[: values.shape[0], : values.shape[1]] = values
    return out
