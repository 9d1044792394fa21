"""Constants of the material and of its walls, in SI or, for data without units, plain numbers."""

from __future__ import annotations

import math
from typing import Any

from granpinn.importers.settings import LENGTHS, Settings
from granpinn.importers.vectors import DataFileError


def missing_constants(settings: Settings) -> list[str]:
    """The settings that are missing for the constants, one sentence part each."""
    missing = []
    if settings.grain_diameter is None:
        missing.append("--grain-diameter, such as '0.8 mm'")
    known = settings.grain_density, settings.solid_fraction, settings.density
    if not settings.dimensionless and sum(value is not None for value in known) < 2:
        if settings.grain_density is None:
            missing.append("--grain-density, such as '2500 kg/m^3'")
        if settings.solid_fraction is None and settings.density is None:
            missing.append("--solid-fraction, such as 0.6")
    return missing


def material_of(settings: Settings) -> tuple[dict[str, Any], dict[str, float]]:
    """The constants of the grains as fields of a flow, and lengths as attributes of its file.

    The bulk density is that of a grain times the solid fraction. `missing_constants` must be empty.
    """
    grain, bulk = settings.number("grain_density"), settings.number("density")
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
    constants = {
        "grain_diameter": settings.number("grain_diameter"),
        "grain_density": grain,
        "density": 1.0 if bulk is None else bulk,  # without units the bulk density is the unit
        "density_unit": None if settings.dimensionless else "kg/m^3",
        "length_unit": "1" if settings.dimensionless else "m",
        "time_unit": "1" if settings.dimensionless else "s",
    }
    lengths = {name: settings.number(name) for name in LENGTHS}
    return constants, {name: value for name, value in lengths.items() if value is not None}
