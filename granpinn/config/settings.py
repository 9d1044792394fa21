"""Every setting of an identification, as typed dataclasses.

The same fields are the command line (`--network.widths 128,128`), the TOML file of `--config`, and
the `config.toml` that a run leaves behind. A recipe is a named set of values for them; flags and
files win over it. Quantities are dimensionless (length H0, velocity sqrt(g H0), ...; see scales.py)
unless the text of a field says otherwise.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any, Literal, get_args, get_origin, get_type_hints

from granpinn.config.ranges import RANGES, range_text


class ConfigError(ValueError):
    """A setting is missing, unknown or impossible; the message is one sentence."""


def setting(default: Any, help: str) -> Any:
    """A dataclass field with its default and the sentence that explains it on the command line."""
    return field(default=default, metadata={"help": help})


@dataclass(frozen=True)
class Network:
    """The network (x, y, t) -> fields."""

    widths: tuple[int, ...] = setting((128, 128, 128, 128), "widths of the hidden layers")
    initialization: Literal["wide", "glorot_uniform"] = setting(
        "wide",
        "first parameters: wide (first layer of unit variance, hidden gain 1.4) or Glorot uniform",
    )
    units: Literal["scaled", "file"] = setting(
        "scaled",
        "what the network sees and gives: inputs mapped to [-1, 1] and outputs of order 1, or the "
        "plain numbers of the flow file",
    )
    pressure_scale: float = setting(0.2, "pressure of an output of 1, in scaled units")


@dataclass(frozen=True)
class Rheology:
    """The scalars of mu(I) as unknowns."""

    variables: Literal["log", "sigmoid"] = setting(
        "log",
        "what is optimized: log mu_s and log(mu_2 - mu_s), or mu_s and mu_2 each as a sigmoid, "
        "bounded by [0, 1]",
    )
    mu_s: float | None = setting(0.3, "mu_s at the start; none: drawn at random")
    mu_2: float | None = setting(0.6, "mu_2 at the start; none: drawn at random")
    p_floor: float = setting(1e-6, "smallest pressure in I = d gamma_dot / sqrt(p)")


@dataclass(frozen=True)
class Weights:
    """Standard deviation sigma of each residual: a term weighs 1/sigma^2, inf leaves it out."""

    units: Literal["dimensionless", "file"] = setting(
        "dimensionless", "units of the sigmas: those of scales.py, or those of the flow file"
    )
    sigma_velocity: float = setting(0.00316, "velocity that the network cannot resolve")
    noise_part: float = setting(
        0.045, "sigma_velocity rises to at least this part of the misfit left by the pre-fit"
    )
    noise_rise: float = setting(0.6, "part of the stage after the pre-fit in which it rises")
    sigma_surface: float = setting(0.002, "pressure on the free surface")
    sigma_momentum: float = setting(0.05, "momentum residual")
    sigma_continuity: float = setting(0.158, "divergence of the velocity")
    sigma_constitutive: float = setting(0.158, "strain rate error in the friction law (mixed form)")


@dataclass(frozen=True)
class Batch:
    """Points of one step, drawn with replacement as a function of (seed, step)."""

    interior: int = setting(2048, "points inside the grains")
    surface: int = setting(128, "points on the free surface")
    collocation: float = setting(
        1.0, "random points between the vectors of a grid, for the equations alone, per vector"
    )


@dataclass(frozen=True)
class Optimizer:
    """How the loss is minimized."""

    method: Literal["adam", "muon"] = setting(
        "muon", "adam everywhere, or Muon on the hidden matrices and adam elsewhere"
    )
    learning_rate: float = setting(2e-3, "learning rate of adam")
    muon_learning_rate: float = setting(2e-2, "learning rate of Muon")
    scalars_learning_rate: float = setting(5e-3, "learning rate of the rheology scalars")
    decay: Literal["linear", "cosine", "exponential"] = setting("linear", "shape of the decay")
    final_fraction: float = setting(0.0, "every learning rate at the end, relative to its peak")
    warm_up: float = setting(0.017, "part of each stage in which learning rates rise from 0")
    prefit: float = setting(0.25, "part of the run that fits the velocity alone, first")
    prefit_final_fraction: float = setting(0.1, "the same as final_fraction for the pre-fit")
    average: float = setting(0.0, "part of the run, at its end, whose parameters are averaged")
    beta_2: float = setting(0.99, "decay of the second moment of adam")
    epsilon: float = setting(1e-8, "epsilon of adam")
    momentum: float = setting(0.95, "momentum of Muon")
    last_layer: bool = setting(
        True, "end with a Gauss-Newton step in the last layer, mu_s and mu_2 (mixed form)"
    )


@dataclass(frozen=True)
class Profile:
    """What --free-I0 trains: one batch over a grid of I0, each value with several seeds."""

    values: int = setting(7, "values of I0, evenly spaced in log I0 around that of --I0")
    reach: float = setting(4.0, "largest value relative to --I0, which is as far from the least")
    seeds: int = setting(3, "trainings at each value, whose scatter says what a loss is worth")
    law_accuracy: float = setting(
        0.005, "laws that differ by less over the I of the data are not told apart"
    )


@dataclass(frozen=True)
class SimulatedPressure:
    """The pressure where nothing flows, as the simulator has it (identification/closure.py)."""

    frames: int = setting(
        25, "times at which the simulator closes the pressure where nothing flows; 0: none"
    )
    cells: int | None = setting(
        None, "cells across its box; none: those of the solver or of the data, at most 512"
    )


@dataclass(frozen=True)
class Resimulation:
    """The simulation that --resimulate compares with the data."""

    cells: int | None = setting(None, "cells across the box; none: the grid of the data, at most")


@dataclass(frozen=True)
class Config:
    """Everything that a run needs to know."""

    flow: str | None = setting(None, "the flow file (HDF5)")
    out: str | None = setting(None, "folder of the run: results, fields, figures, checkpoints")
    level: Literal["V0", "V1", "V2"] = setting(
        "V1",
        "what is measured: V0 velocity, with p = 0 where its vectors end upwards; V1 and the line "
        "of the free surface, where p = 0; "
        "V2 and pressure at surface points",
    )
    form: Literal["mixed", "strong"] = setting(
        "mixed", "residual: stress as an unknown (mixed), or the paper's equation (strong)"
    )
    law: Literal["mu_of_i", "coulomb"] = setting(
        "mu_of_i", "friction law: mu(I), or constant friction (coulomb)"
    )
    recipe: Literal["default", "noisy", "paper"] = setting(
        "default",
        "named set of settings: the best known, the same for noise above a tenth of the largest "
        "speed, or the paper to the letter",
    )
    noise: float = setting(
        0.0, "white noise added to the velocity, sd relative to the maximum speed (0.2 = 20 %)"
    )
    I0: float = setting(0.3, "I0 of the friction law, held fixed")
    seed: int = setting(0, "seed of the network, of the batches and of the noise")
    members: int = setting(
        1,
        "networks with different seeds, trained side by side: the result is their center, and "
        "their scatter enters the error bars; 4 to 16 cost little on a GPU",
    )
    device: Literal["auto", "cpu", "cuda"] = setting("auto", "where to compute")
    dtype: Literal["float32", "float64"] = setting("float32", "type of every number")
    precision: Literal["fp32", "fast"] = setting(
        "fast", "products on a GPU: plain float32 (fp32), or on tensor cores (fast)"
    )
    max_time: float | None = setting(
        None, "seconds that the command may take; the run is planned to end within them"
    )
    steps: int | None = setting(40000, "optimization steps; none: --epochs or --max-time decide")
    epochs: int | None = setting(None, "passes over the points, where --steps is none")
    log_every: int = setting(100, "steps between the rows of history.csv")
    checkpoint_every: float = setting(30.0, "seconds between checkpoints")
    free_I0: bool = setting(
        False, "then ask which I0 the data allow, outside of --max-time (group profile)"
    )
    resimulate: bool = setting(
        False, "then simulate with the identified law and compare, outside of --max-time"
    )
    resume: bool = setting(False, "continue the run in --out from its newest checkpoint")
    tensorboard: bool = setting(False, "also write TensorBoard events to --out")
    network: Network = field(default_factory=Network)
    rheology: Rheology = field(default_factory=Rheology)
    weights: Weights = field(default_factory=Weights)
    batch: Batch = field(default_factory=Batch)
    optimizer: Optimizer = field(default_factory=Optimizer)
    simulated_pressure: SimulatedPressure = field(default_factory=SimulatedPressure)
    profile: Profile = field(default_factory=Profile)
    resimulation: Resimulation = field(default_factory=Resimulation)

    def __post_init__(self) -> None:
        flat = flatten(self)
        for key, kind in kinds_of(type(self)).items():
            if get_origin(kind) is Literal and flat[key] not in get_args(kind):
                choices = ", ".join(get_args(kind))
                raise ConfigError(f"--{key} must be one of {choices}, got {flat[key]!r}")
        for key, low, high in RANGES:
            value = flat[key]
            if value is not None and not low <= value <= high:
                raise ConfigError(
                    f"--{key} must be {range_text(low, high)}, got {value}: "
                    f"python -m granpinn.train --help explains it"
                )
        if not self.network.widths or min(self.network.widths) < 1:
            raise ConfigError(
                "--network.widths must be one positive width per hidden layer, such as 128,128, "
                f"got {list(self.network.widths)}"
            )
        mu_s, mu_2 = self.rheology.mu_s, self.rheology.mu_2
        if (mu_s is None) != (mu_2 is None) or (mu_s and mu_2 and mu_2 <= mu_s):
            raise ConfigError(
                f"--rheology.mu_2 must be larger than --rheology.mu_s, or both none, got {mu_2} "
                f"and {mu_s}"
            )
        if self.rheology.variables == "sigmoid" and mu_2 and mu_2 >= 1:
            raise ConfigError(f"--rheology.mu_2 must be below 1 for a sigmoid, got {mu_2}")
        if self.optimizer.decay == "exponential" and self.optimizer.final_fraction == 0:
            raise ConfigError("--optimizer.final_fraction must be positive for exponential decay")
        if self.steps is None and self.epochs is None and self.max_time is None:
            raise ConfigError("one of --steps, --epochs and --max-time must be given, got none")


# Settings that change no number of the result: a resumed run may differ in them.
FREE = ("flow", "out", "resume", "tensorboard", "checkpoint_every", "max_time")
# What follows the training.
FREE_SECTIONS = ("free_I0", "resimulate", "simulated_pressure", "profile", "resimulation")


def flatten(config: Any, prefix: str = "") -> dict[str, Any]:
    """{"network.widths": (128, 128, 128), ...}: every setting under its dotted name."""
    flat: dict[str, Any] = {}
    for f in dataclasses.fields(config):
        value = getattr(config, f.name)
        nested = dataclasses.is_dataclass(value)
        flat |= flatten(value, f"{prefix}{f.name}.") if nested else {prefix + f.name: value}
    return flat


def kinds_of(cls: type, prefix: str = "") -> dict[str, Any]:
    """{"network.widths": tuple[int, ...], ...}: the type of every setting."""
    kinds: dict[str, Any] = {}
    for name, kind in get_type_hints(cls).items():
        nested = dataclasses.is_dataclass(kind)
        kinds |= kinds_of(kind, f"{name}.") if nested else {prefix + name: kind}
    return kinds


def identity(config: Config) -> dict[str, Any]:
    """The settings that decide the numbers of a run, as JSON values."""
    flat = {
        key: value
        for key, value in flatten(config).items()
        if key not in FREE and key.split(".")[0] not in FREE_SECTIONS
    }
    return {key: list(v) if isinstance(v, tuple) else v for key, v in flat.items()}
