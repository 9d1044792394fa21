"""Every setting of an identification: `Config`.

The same fields are the command line (`--network.widths 128,128`), the TOML file of `--config`, and
the `config.toml` that a run leaves.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import InitVar, dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, get_args

from granpinn.config.fields import (
    LARGEST,
    TINY,
    ConfigError,
    flag_of,
    flatten,
    sections_of,
    setting,
    settings_of,
    unknown,
)
from granpinn.config.sections import (
    Batch,
    Network,
    Optimizer,
    Rheology,
    SideWalls,
    Weights,
)
from granpinn.declared import shown
from granpinn.physics.laws import DEFAULT, LAWS
from granpinn.physics.terms import NAMES, Form

Level = Literal["V0", "V1", "V2"]
LEVELS: tuple[Level, ...] = get_args(Level)
MOST_STEPS, MOST_SECONDS = 10**12, 1e9  # more than any machine lasts
MOST_LAYERS = 64

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
    **{f"weights.sigma_{name}": 1.0 for name in NAMES},
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
"""Named sets of settings that a Config starts from."""


@dataclass(frozen=True, kw_only=True)
class Config:
    """The settings of a run: those of a recipe, changed by what is given.

        Config(recipe="paper")
        Config(recipe="paper", level="V1", batch=Batch(interior=256, surface=64))
        Config(recipe="paper", **{"batch.interior": 256})

    A section that is given replaces that of the recipe as a whole; a dict changes only the settings
    that it names: `batch={"interior": 256}`. So `Config(**settings)` takes nested dicts, such as
    `Result.settings`. One setting of a section is also given by its dotted name, as in TOML, or as
    a keyword with two underscores: `batch__interior`.
    `dataclasses.replace(config, seed=3)` changes one setting and takes the same names; it cannot
    change the recipe.

    Raises:
        ConfigError: a name is unknown, or a value has the wrong type or is impossible.
    """

    flow: str | None = setting(None, "the flow file (HDF5)", free=True)
    further_flows: tuple[str, ...] = setting(
        (), "further flow files, which have one friction law with the first", free=True
    )
    out: str | None = setting(
        None, "folder of the run: results, fields, figures, checkpoints", free=True, metavar="DIR"
    )
    level: Level = setting(
        "V1",
        "what is measured: V0 velocity, with p = 0 on the upper edge of its vectors; V1 and the "
        "line of the free surface, where p = 0; V2 and the pressure at surface points",
    )
    form: Form = setting(
        "mixed", "residual: stress as an unknown (mixed), or the paper's equation (strong)"
    )
    law: str = setting(
        DEFAULT.name,
        f"friction law: {', '.join(f'{law.name} ({law.title})' for law in LAWS.values())}",
        choices=LAWS,  # with those that are registered later
    )
    recipe: str = setting(
        "default",
        "set of settings to start from: the best for most data, or the paper to the letter",
        choices=tuple(RECIPES),
    )
    units: Literal["flow", "file"] = setting(
        "flow",
        "units of the network and of the sigmas of the loss: those of the flow (inputs in [-1, 1], "
        "outputs of order 1; its rms speed and rms shear rate), or those of the flow file",
    )
    noise: float = setting(
        0.0,
        "white noise added to the velocity, sd relative to the maximum speed (0.2 = 20 %)",
        low=0,
        high=100,
    )
    I0: float = setting(0.3, "I0 of the friction law, held fixed", low=TINY)
    seed: int = setting(
        0, "seed of the network, of the batches and of the noise", low=0, high=2**63 - 1
    )
    members: int = setting(
        1,
        "networks with different seeds, trained side by side: the result is their center, and "
        "their scatter enters the error bars; 4 to 16 cost little on a GPU",
        low=1,
        high=1024,
    )
    device: Literal["auto", "cpu", "cuda"] = setting("auto", "where to compute")
    dtype: Literal["float32", "float64"] = setting("float32", "type of every number")
    precision: Literal["fp32", "fast"] = setting(
        "fast", "products on a GPU: plain float32 (fp32), or on tensor cores (fast)"
    )
    max_time: float | None = setting(
        None,
        "seconds that the command may take; the run is planned to end within them",
        low=1,
        high=MOST_SECONDS,
        free=True,
    )
    steps: int | None = setting(
        15000, "optimisation steps; none: --epochs or --max-time decide", low=1, high=MOST_STEPS
    )
    epochs: int | None = setting(
        None, "passes over the points, where --steps is none", low=1, high=10**7
    )
    log_every: int = setting(100, "steps between the rows of history.csv", low=1, high=MOST_STEPS)
    checkpoint_every: float = setting(
        30.0, "seconds between checkpoints", low=0, high=MOST_SECONDS, free=True
    )
    checks: str = setting(
        "quick",
        "what else to compute, to trust the numbers: none, quick (what takes seconds), all, or "
        "names of checks, with commas between them",
        free=True,
        metavar="NAME,...",
    )
    compare_laws: bool = setting(
        False,
        "train a free curve and a law with cohesion beside the law, and say which laws explain "
        "the data",
    )
    free_I0: bool = setting(
        False,
        "after the training, give mu_s and the slope (mu_2 - mu_s)/I0 for an I0 that is not known",
        free=True,
    )
    resume: bool = setting(False, "continue the run in --out from its newest checkpoint", free=True)
    network: Network = field(default_factory=Network)
    rheology: Rheology = field(default_factory=Rheology)
    side_walls: SideWalls = field(default_factory=SideWalls)
    weights: Weights = field(default_factory=Weights)
    batch: Batch = field(default_factory=Batch)
    optimizer: Optimizer = field(default_factory=Optimizer)
    # The recipe of the Config that `dataclasses.replace` copies; replace passes it on.
    _copied: InitVar[str] = ""

    if not TYPE_CHECKING:  # type checkers see the signature of the fields

        def __init__(self, *values: Any, _copied: str = "", **given: Any) -> None:
            if values:
                raise ConfigError(
                    "Config takes settings by their names, such as Config(steps=4000), or a dict "
                    f"as Config(**settings), got {shown(values[0])}"
                )
            flat = _resolve(given)
            for name in self.__dataclass_fields__:
                if name in flat:
                    object.__setattr__(self, name, flat[name])
            for name, kind in sections_of(Config).items():
                start = len(name) + 1
                inner = {k[start:]: v for k, v in flat.items() if k.startswith(f"{name}.")}
                object.__setattr__(self, name, kind(**inner))
            if _copied not in ("", self.recipe):
                raise ConfigError(
                    f"--recipe {self.recipe} would only rename settings that started from the "
                    f"recipe {_copied}: make a new Config(recipe={self.recipe!r})"
                )
            object.__setattr__(self, "_copied", self.recipe)
            _check_together(self)


def _resolve(given: Mapping[str, Any]) -> dict[str, Any]:
    """Every setting by its dotted name: those of the recipe, changed by `given`."""
    known, sections = settings_of(Config), sections_of(Config)
    flat = {key: stated.default for key, stated in known.items()}
    recipe = given.get("recipe", flat["recipe"])
    known["recipe"].check(recipe, flag_of("recipe"))
    flat |= RECIPES[recipe]
    single = {k.replace("__", "."): v for k, v in given.items() if k not in sections}
    for name, value in given.items():
        if name not in sections:
            continue
        if isinstance(value, sections[name]):
            flat |= flatten(value, f"{name}.")
        elif isinstance(value, Mapping):
            single = {f"{name}.{inner}": item for inner, item in value.items()} | single
        else:
            kind = sections[name].__name__
            raise ConfigError(
                f"{name} must be a granpinn.config.{kind} or a dict, got {shown(value)}"
            )
    for key in single:
        if key not in known:
            raise ConfigError(unknown(key, [*known, *sections]))
    flat |= single
    for key, stated in known.items():
        flat[key] = stated.check(flat[key], flag_of(key))
    return flat


def _check_together(config: Config) -> None:
    """Refuses settings that are impossible together."""
    widths = config.network.widths
    if not 1 <= len(widths) <= MOST_LAYERS:
        raise ConfigError(
            "--network.widths must be one width per hidden layer, such as 128,128, for 1 to "
            f"{MOST_LAYERS} layers, got {len(widths)}"
        )
    _check_fixed(config.law, config.rheology.fixed)
    if config.free_I0 and LAWS[config.law] is not DEFAULT:
        raise ConfigError(
            f"--free-I0 is for {DEFAULT.title} alone, got --law {config.law}: leave out one of the "
            "two"
        )
    if config.steps is None and config.epochs is None and config.max_time is None:
        raise ConfigError("one of --steps, --epochs and --max-time must be given, got none")


def _check_fixed(name: str, values: Mapping[str, float]) -> None:
    """Refuses values of parameters that the law of that name does not have fixed."""
    law = LAWS[name]
    settable = [p.name for p in law.parameters if p.fixed and p.name != "I0"]
    for parameter, value in values.items():
        if parameter == "I0":
            raise ConfigError(f"--rheology.fix: give I0 by the flag --I0 {value:g}")
        if parameter not in settable:
            known = ", ".join(settable) or "no other parameter"
            raise ConfigError(
                f"--rheology.fix: the law {name} holds {known} fixed, got {parameter}: leave it out"
            )
        least = 0.0 if law.parameter(parameter).may_vanish else TINY
        if not least <= value <= LARGEST:
            raise ConfigError(
                f"--rheology.fix: {parameter} must be in [{least:g}, {LARGEST:g}], got {value:g}"
            )


def config_of(config: Config | Mapping[str, Any] | None, changes: Mapping[str, Any]) -> Config:
    """The settings of a call in Python: a Config, or a dict of settings, with changes.

    Raises:
        ConfigError: a name is unknown, or a value is impossible.
    """
    given = [*(config if isinstance(config, Mapping) else ()), *changes]
    if wrong := {"flow", "out"}.intersection(map(str, given)):
        raise ConfigError(
            f"{wrong.pop()} is no setting in Python: give the flow as the first argument, and the "
            "folder of the run as run_dir"
        )
    if isinstance(config, Config):
        return replace(config, **changes) if changes else config
    return Config(**{**(config or {}), **changes})


def identity(config: Config) -> dict[str, Any]:
    """The settings that decide the numbers of a run, by their names."""
    known = settings_of(Config)
    return {key: value for key, value in flatten(config).items() if not known[key].free}
