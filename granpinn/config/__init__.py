"""Settings: their types, defaults, ranges and help, the named recipes, and settings as TOML."""

from granpinn.config.fields import ConfigError, flatten, setting, settings_of
from granpinn.config.sections import (
    Batch,
    Network,
    Optimizer,
    Rheology,
    SideWalls,
    Weights,
)
from granpinn.config.settings import LEVELS, RECIPES, Config, Level, identity

__all__ = [
    "LEVELS",
    "RECIPES",
    "Batch",
    "Config",
    "ConfigError",
    "Level",
    "Network",
    "Optimizer",
    "Rheology",
    "SideWalls",
    "Weights",
    "flatten",
    "identity",
    "setting",
    "settings_of",
]
