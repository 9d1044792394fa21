"""Constants of the material and of its walls, in SI or, for data without units, plain numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass

from granpinn.config.fields import flag_of
from granpinn.importers import units
from granpinn.importers.settings import Settings
from granpinn.importers.vectors import DataFileError

_EXAMPLES = {
    "grain_diameter": ("length", "'0.8 mm'"),
    "grain_density": ("density", "'2500 kg/m^3'"),
    "density": ("density", "'1500 kg/m^3'"),
    "wall_gap": ("length", "'20 mm'"),
    "period_x": ("length", "'0.5 m'"),
    "surface_sd": ("length", "'0.4 mm'"),
}


@dataclass(frozen=True)
class Material:
    """Constants of the grains.

    Attributes:
        density: bulk density: the density of a grain times the solid fraction.
        grain_density: of a grain; None = as the bulk density (data without units).
        wall_gap: distance between the side walls, or None.
        period_x: length of the period along x, or None.
        surface_sd: standard deviation of an offset of the surface line, or None.
    """

    grain_diameter: float
    density: float
    grain_density: float | None
    wall_gap: float | None
    period_x: float | None
    surface_sd: float | None


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
    lengths = (_number(settings, name) for name in ("wall_gap", "period_x", "surface_sd"))
    return Material(d, bulk, grain, *lengths)


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
