"""Settings: their types, defaults, ranges and help, the named recipes, and settings as TOML."""

from granpinn.config.settings import (
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
    identity,
    kinds_of,
    setting,
)

__all__ = [
    "Batch",
    "Config",
    "ConfigError",
    "Network",
    "Optimizer",
    "Profile",
    "Resimulation",
    "Rheology",
    "SimulatedPressure",
    "Weights",
    "flatten",
    "identity",
    "kinds_of",
    "setting",
]
