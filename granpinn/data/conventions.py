"""CF attributes of the datasets of a flow file: the units, and what changes the stored numbers.

Programs that open the file as netCDF, such as xarray, apply these attributes. granpinn takes the
numbers as they are stored. So it refuses an attribute that gives them another value or unit.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from granpinn.data.flow import FlowFileError
from granpinn.data.format import PARTICLES

if TYPE_CHECKING:
    from granpinn.data.hdf5 import Attributes

# Each makes other numbers of the stored ones: the first two even if they only round, the third
# (of xarray) truth values or durations.
CHANGING = ("scale_factor", "add_offset", "dtype")
FILL = ("_FillValue", "missing_value")
SI = ("m", "s", "kg/m^3")


def units_of(length: str, time: str, density: str | None) -> dict[str, str]:
    """The unit of each dataset by its name without `particles/`.

    A pressure has one only in a dimensionless flow and in SI units.
    """
    velocity = "1" if length == time == "1" else f"{length}/{time}"
    pressure = "1" if length == time == "1" else "Pa" if (length, time, density) == SI else None
    units = {
        **dict.fromkeys(("t", "surface_t", "wall_t"), time),
        **dict.fromkeys(("x", "y", "surface_x", "surface_y", "wall_x", "wall_y"), length),
        **dict.fromkeys(("u", "v", "sigma_u", "sigma_v", "wall_u", "wall_v"), velocity),
        **dict.fromkeys(("c", "wall_slip"), "1"),
    }
    if pressure is not None:
        units |= dict.fromkeys(("p", "surface_p", "wall_p", "wall_tau"), pressure)
    return units


def check_conventions(name: str, attributes: Attributes, units: dict[str, str]) -> None:
    """Raises FlowFileError if an attribute of a dataset changes its numbers or their unit."""
    fills = {attribute: attributes.numbers(attribute) for attribute in FILL}
    other = [a for a, values in fills.items() if values and not np.isnan(values).all()]
    if wrong := [a for a in CHANGING if a in attributes] + other:
        raise FlowFileError(
            f"{name} must be stored as it is, NaN where there is no value, got the attribute "
            f"{wrong[0]}, by which other programs change its numbers: write the final numbers "
            "without it"
        )
    if "units" not in attributes:
        return
    found = attributes.text("units")
    wanted = units.get(name.removeprefix(f"{PARTICLES}/"))
    if wanted is None:
        raise FlowFileError(
            f"{name} must have no attribute units unless the file is dimensionless or in m, s and "
            f"kg/m^3 (density_unit), got {found!r}: remove it, or state density_unit"
        )
    if found is None or _plain(found) not in (
        _plain(wanted),
        _plain(wanted.replace("/", " ") + "-1"),
    ):
        raise FlowFileError(
            f"{name} must be in {wanted!r} by length_unit and time_unit of the file, got the "
            f"attribute units = {found!r}: convert {name}, or correct the attribute"
        )


def _plain(unit: str) -> str:
    """A unit without the signs of a product or a power: "m s^-1" becomes "ms-1"."""
    return re.sub(r"[ .*^]", "", unit) or "1"
