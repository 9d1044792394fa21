"""Measurement files as a flow, in one call."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Collection, Mapping, Sequence
from typing import Any, TypeVar

import numpy.typing as npt

from granpinn.data.flow import Flow
from granpinn.declared import checked
from granpinn.importers.arrays import ARRAYS, from_dataset
from granpinn.importers.conversion import convert
from granpinn.importers.series import Source
from granpinn.importers.settings import SURFACES, Settings
from granpinn.importers.vectors import DataFileError

S = TypeVar("S", bound=Settings)
SETTINGS = tuple(field.name for field in dataclasses.fields(Settings))


@checked
def read(source: Source, **settings: Any) -> Flow:
    """A flow from files of a PIV, PTV or simulation program, or from arrays.

        flow = granpinn.read(
            "run/PIVlab_*.txt",
            scale="0.12 mm/px",
            frame_rate="500 Hz",
            grain_diameter="0.8 mm",
            grain_density="2500 kg/m^3",
            solid_fraction=0.6,
        )

    Args:
        source: files, folders or patterns; or a mapping of arrays t, y, x, u, v (see
            granpinn.importers.arrays).
        settings: as of `python -m granpinn.convert`, with _ for - (see
            granpinn.importers.settings).

    Raises:
        granpinn.importers.DataFileError: files or settings cannot be used; one sentence.
    """
    return convert(source, settings_from(settings, Settings))


def flow(
    data: Any = None, /, *, surface: Sequence[npt.ArrayLike] | str | None = None, **given: Any
) -> Flow:
    """A flow from arrays in memory, or from xarray.

        flow = granpinn.flow(
            t=t, y=y, x=x, u=u, v=v,
            length_unit="mm", time_unit="s", velocity_unit="m/s",
            grain_diameter="0.8 mm",
            grain_density="2500 kg/m^3",
            solid_fraction=0.6,
        )
        flow = granpinn.flow(dataset, grain_diameter="0.8 mm", ...)

    The result is in SI. `dimensionless=True` takes arrays without units.

    Args:
        data: an xarray.Dataset with u and v over (t, y, x), whose `units` are read.
        surface: t, x and y [n] of points of the free surface, in the units and axes of the arrays;
            or the setting, such as "none".
        given: arrays t [T], y [Y], x [X], u and v [T, Y, X], or all [n] for scattered vectors, NaN
            where there is no vector; optional ones as in granpinn.importers.arrays (c, mask,
            sigma_u, ...); and settings, as of `granpinn convert` with _ for -, numbers with units
            as text.

    Raises:
        DataFileError: arrays or settings cannot be used; the message is one sentence.
    """
    source: Source
    if isinstance(surface, str) and surface in SURFACES:
        given["surface"], surface = surface, None
    parts = {name: given.pop(name) for name in [*given] if _is_array(name, given[name])}
    if data is None:
        source = parts
    elif parts or not hasattr(data, "data_vars"):
        found = ", ".join(parts) or type(data).__name__
        raise DataFileError(
            "flow takes one xarray.Dataset with u and v, or arrays by their names as "
            f"flow(t=t, y=y, x=x, u=u, v=v, ...), got {found}"
        )
    else:
        source = from_dataset(data)
    return convert(source, settings_from(given, Settings), line=surface)


def _is_array(name: str, value: Any) -> bool:
    """Whether an argument belongs to the arrays; the setting `mask` is the name of a file."""
    return name in ARRAYS and not (name == "mask" and isinstance(value, str))


def settings_from(given: Mapping[str, Any], kind: type[S], names: Collection[str] = SETTINGS) -> S:
    """The settings of a conversion.

    Args:
        kind: the record.
        names: of its settings that may be given.

    Raises:
        DataFileError: a name is unknown.
    """
    for name in given:
        if name not in names:
            near = difflib.get_close_matches(name, [*names, *ARRAYS], n=1)
            hint = f"did you mean {near[0]}?" if near else "granpinn.importers.Settings has them"
            raise DataFileError(f"unknown setting {name}: {hint}")
    return kind(**given)
