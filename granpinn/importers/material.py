"""Constants of the material and of its walls, in SI or, for data without units, plain numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass

from granpinn.config.fields import flag_of
from granpinn.data.flow import PERIOD_X, SOLVER_CELL, SOLVER_MEAN, SURFACE_SD, WALL_GAP
from granpinn.importers import units
from granpinn.importers.settings import Settings
from granpinn.importers.vectors import DataFileError

# Lengths that a flow file may state, by the names of its attributes.
_LENGTHS = {
    WALL_GAP: "'20 mm'",
    PERIOD_X: "'0.5 m'",
    SURFACE_SD: "'0.4 mm'",
    SOLVER_CELL: "'0.1 mm'",
    SOLVER_MEAN: "'0.1 mm'",
}
_EXAMPLES = {
    "grain_diameter": ("length", "'0.8 mm'"),
    "grain_density": ("density", "'2500 kg/m^3'"),
    "density": ("density", "'1500 kg/m^3'"),
    **{name: ("length", example) for name, example in _LENGTHS.items()},
}


@dataclass(frozen=True)
class Material:
    """Constants of the grains.

    Attributes:
        density: bulk density: the density of a grain times the solid fraction.
        grain_density: of a grain; None = as the bulk density (data without units).
        lengths: those that are given of the walls, the surface line and the solver, by the names
            of their attributes in a flow file.
    """

    grain_diameter: float
    density: float
    grain_density: float | None
    lengths: dict[str, float]


def missing_constants(settings: Settings) -> list[str]:
    """The settings that are missing for the constants, one sentence part each."""
    missing = []
    if settings.grain_diameter is None:
        missing.append("--grain-diameter, such as '0.8 mm'")
    if settings.dimensionless:
        return missing
    known = settings.grain_density, settings.solid_fraction, settings.density
    if sum(value is not None for value in known) < 2:
        if settings.grain_density is None:
            missing.append("--grain-density, such as '2500 kg/m^3'")
        if settings.solid_fraction is None and settings.density is None:
            missing.append("--solid-fraction, such as 0.6")
    return missing


def material_of(settings: Settings) -> Material:
    """The constants that the settings give; `missing_constants` must be empty."""
    d = _number(settings, "grain_diameter")
    assert d is not None
    grain, bulk = _number(settings, "grain_density"), _number(settings, "density")
    fraction = settings.solid_fraction
    if grain is not None and fraction is not None:
        if bulk is not None and not math.isclose(bulk, grain * fraction, rel_tol=1e-3):
            raise DataFileError(
                f"--density must be grain density times solid fraction, {grain * fraction:g}, got "
                f"{bulk:g}: leave one of the three out"
            )
        bulk = grain * fraction
    elif grain is None and bulk is not None and fraction is not None:
        grain = bulk / fraction
    if bulk is None:  # data without units: the bulk density is the unit
        bulk = 1.0
    lengths = {name: _number(settings, name) for name in _LENGTHS}
    return Material(d, bulk, grain, {k: v for k, v in lengths.items() if v is not None})


def _number(settings: Settings, name: str) -> float | None:
    """A positive constant, None if it is not given."""
    text = getattr(settings, name)
    if text is None:
        return None
    dimension, example = _EXAMPLES[name]
    if settings.dimensionless:
        value = units.plain(text, flag_of(name))
    else:
        value = units.si(text, dimension, flag_of(name), example)
    return units.in_range(value, flag_of(name), text)
