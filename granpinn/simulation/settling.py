"""The pressure of a given velocity field, from a very short simulation that starts with it.

The solver takes steps so short that the grains stay in place. First three steps of almost no length
make the velocity free of divergence on the grid: each starts with the velocity of the step before
and without its pressure. Then the rotational form of the pressure update
(csrc/collapse/time_step.h) contracts the error inside plugs by up to three per step.

The pressure changes by up to 1 % in that time, so a caller starts earlier by `settled_after`.
STEPS and STEP were measured on six collapses (bench/studies/simulated_pressure).
"""

from __future__ import annotations

import math

import numpy as np

from granpinn.arrays import Float64
from granpinn.simulation.engine import Engine, Start, State
from granpinn.simulation.scene import Scene

STEPS = 40
STEP = 6e-5  # of sqrt(height / |g|)
PROJECTIONS = 3
PROJECTION_STEP = 3e-7  # of sqrt(height / |g|)


def settled_after(scene: Scene, steps: int = STEPS, step: float = STEP) -> float:
    """Time from the `start` of `settle` to the state that it returns."""
    return steps * step * math.sqrt(scene.height / math.hypot(*scene.gravity))


def settle(scene: Scene, start: Start, steps: int = STEPS, step: float = STEP) -> State:
    """The state a moment after `start`, with the pressure of its velocity.

    Args:
        scene: the box and the material; sqrt(height / |g|) is the unit of time.
        steps, step: number of steps, and length of one in that unit.

    Raises:
        SimulationError: a solve did not converge.
    """
    unit = math.sqrt(scene.height / math.hypot(*scene.gravity))
    for _ in range(PROJECTIONS):
        engine = Engine(scene, start)
        engine.step(PROJECTION_STEP * unit)
        state = engine.state()
        start = Start(start.c, _widened(state.u, start.u), _widened(state.v, start.v))
    engine.step(step * unit, steps)
    return engine.state()


def _widened(values: Float64, like: Float64) -> Float64:
    """Values on the window as values on the whole box, 0 beyond the window."""
    out = np.zeros_like(like)
    out[: values.shape[0], : values.shape[1]] = values
    return out
