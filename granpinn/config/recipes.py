"""Recipes, the named sets of settings, and the making of a Config from dotted names."""

from __future__ import annotations

import dataclasses
from typing import Any

from granpinn.config import (
    Batch,
    Config,
    ConfigError,
    Network,
    Optimizer,
    Profile,
    Resimulation,
    Rheology,
    SimulatedPressure,
    Weights,
    flatten,
)

SECTIONS: dict[str, type] = {
    "network": Network,
    "rheology": Rheology,
    "weights": Weights,
    "batch": Batch,
    "optimizer": Optimizer,
    "simulated_pressure": SimulatedPressure,
    "profile": Profile,
    "resimulation": Resimulation,
}
# For much noise: fewer unknowns and larger batches, at half the cost (bench/studies/noise).
# The paper to the letter: section Training; where it is silent, what its library does by default
# (Glorot uniform weights, epsilon 1e-7) and the plain reading (learning rate linear in the step,
# unit weights in the units of the data, no scaling of inputs and outputs).
RECIPES: dict[str, dict[str, Any]] = {
    "default": {},
    "noisy": {
        "network.widths": (64, 64, 64, 64),
        "batch.interior": 4096,
        "batch.surface": 512,
        "batch.collocation": 0.0,
    },
    "paper": {
        "level": "V2",
        "form": "strong",
        "steps": None,
        "epochs": 20000,
        "network.widths": (250, 250, 250),
        "network.initialization": "glorot_uniform",
        "network.units": "file",
        "rheology.variables": "sigmoid",
        "rheology.mu_s": None,
        "rheology.mu_2": None,
        "weights.units": "file",
        "weights.sigma_velocity": 1.0,
        "weights.noise_part": 0.0,
        "weights.sigma_surface": 1.0,
        "weights.sigma_momentum": 1.0,
        "weights.sigma_continuity": 1.0,
        "weights.sigma_constitutive": 1.0,
        "batch.interior": 512,
        "batch.surface": 512,
        "batch.collocation": 0.0,
        "optimizer.method": "adam",
        "optimizer.learning_rate": 5e-4,
        "optimizer.scalars_learning_rate": 5e-4,
        "optimizer.final_fraction": 0.02,
        "optimizer.decay": "linear",
        "optimizer.warm_up": 0.0,
        "optimizer.prefit": 0.0,
        "optimizer.average": 0.0,
        "optimizer.beta_2": 0.999,
        "optimizer.epsilon": 1e-7,
        "optimizer.last_layer": False,
    },
}


def replace(config: Config, **changes: Any) -> Config:
    """`config` with changes; a dotted name is written with two underscores: `network__widths`."""
    return build({name.replace("__", "."): value for name, value in changes.items()}, config)


def make(recipe: str = "default", **changes: Any) -> Config:
    """The settings of a recipe, with changes: `make(steps=1000, network__widths=(64, 64))`."""
    return replace(build({"recipe": recipe}), **changes)


def build(values: dict[str, Any], base: Config | None = None) -> Config:
    """A Config from dotted values on top of `base`, or of the recipe that `values` name."""
    if base is None:
        flat = flatten(Config()) | RECIPES.get(values.get("recipe", "default"), {})
    else:
        flat = flatten(base)
    for key in values:
        if key not in flat:
            raise ConfigError(f"unknown setting {key}: python -m granpinn.train --help lists them")
    flat |= values
    sections: dict[str, Any] = {}
    for f in dataclasses.fields(Config):
        if f.name in flat:
            sections[f.name] = flat[f.name]
        else:
            inner = {k.split(".")[1]: v for k, v in flat.items() if k.startswith(f.name + ".")}
            sections[f.name] = SECTIONS[f.name](**inner)
    return Config(**sections)
