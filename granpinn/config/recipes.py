"""Recipes: named sets of settings that a Config starts from."""

from __future__ import annotations

from typing import Any

from granpinn.physics import terms

# The paper to the letter: section Training; where it is silent, what its library does by default
# (Glorot uniform weights, epsilon 1e-7) and the plain reading (learning rate linear in the step,
# unit weights in the units of the data, no scaling of inputs and outputs).
PAPER: dict[str, Any] = {
    "level": "V2",
    "form": "strong",
    "units": "file",
    "steps": None,
    "epochs": 20000,
    "network.widths": (250, 250, 250),
    "network.initialization": "glorot_uniform",
    "rheology.variables": "sigmoid",
    "rheology.random_start": True,
    "side_walls.friction": 0.0,
    "weights.law_error": 0.0,
    "weights.follow_noise": False,
    **{f"weights.sigma_{name}": 1.0 for name in terms.NAMES},
    "batch.interior": 512,
    "batch.surface": 512,
    "batch.collocation": 0.0,
    "optimizer.method": "adam",
    "optimizer.learning_rate": 5e-4,
    "optimizer.scalars_learning_rate": 5e-4,
    "optimizer.final_fraction": 0.02,
    "optimizer.warm_up": 0.0,
    "optimizer.prefit": 0.0,
    "optimizer.beta_2": 0.999,
    "optimizer.epsilon": 1e-7,
    "optimizer.last_layer": False,
}
RECIPES: dict[str, dict[str, Any]] = {"default": {}, "paper": PAPER}
