"""Types of NumPy arrays, by their numbers, and the way in for arrays of a user."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from granpinn.errors import BadInput

Float64 = npt.NDArray[np.float64]
Float32 = npt.NDArray[np.float32]
Floats = npt.NDArray[np.floating[Any]]  # float32 or float64
Bool = npt.NDArray[np.bool_]
Int8 = npt.NDArray[np.int8]
Int64 = npt.NDArray[np.int64]
Index = npt.NDArray[np.intp]
Bytes = npt.NDArray[np.uint8]

_NO_NUMBER = ("NoneType", "NAType", "MaskedConstant")


def plain_array(
    values: Any, name: str, error: type[BadInput] = BadInput, *, kinds: str = "fiu"
) -> npt.NDArray[Any]:
    """An array of any library as a plain NumPy array: every array of a user passes here.

    A number under a mask becomes NaN, and so do None and the NA of pandas. A mask of integers makes
    them float64; other types stay.

    Args:
        values: numbers, lists, or an array of NumPy, pandas, torch, xarray and others.
        name: of the array, for messages.
        error: class of the error.
        kinds: of NumPy types that are allowed.

    Raises:
        error: the array does not hold real numbers, or brings a unit, which would be lost.
    """
    unit = _unit(values)
    if unit:
        raise error(
            f"{name} must be plain numbers, got an array with the unit {unit[:60]}, which would be "
            "lost: give its numbers, and the unit as text"
        )
    try:
        array = np.asarray(_without_mask(values))
        if array.dtype.kind == "O":
            array = np.array([_number(item) for item in array.flat]).reshape(array.shape)
    except (TypeError, ValueError, OverflowError, RuntimeError):
        array = np.empty(0, object)
    if array.dtype.kind not in kinds:
        found = type(values).__name__ if array.dtype.kind == "O" else f"the type {array.dtype}"
        raise error(
            f"{name} must hold numbers, got {found}: numpy.asarray must make numbers of it, of a "
            "torch tensor after .detach().cpu()"
        )
    return array


def _unit(values: Any) -> str:
    """The unit of an array of pint, astropy, unyt, xarray or a file; "" if it has none."""
    attributes = getattr(values, "attrs", None)
    found = attributes.get("units") if isinstance(attributes, Mapping) else None
    for name in ("units", "unit"):
        found = found or getattr(values, name, None)
    return "" if found is None or str(found) in ("1", "-") else str(found)


def _number(item: Any) -> float:
    if isinstance(item, str | bytes):
        raise TypeError
    return np.nan if type(item).__name__ in _NO_NUMBER else float(item)


def _without_mask(values: Any) -> Any:
    if isinstance(values, list | tuple):
        return [v if isinstance(v, int | float) else _without_mask(v) for v in values]
    if np.ma.isMaskedArray(values):
        data, mask = np.ma.getdata(values), np.ma.getmaskarray(values)
        if not mask.any():
            return data
        data = data.astype(np.float64 if data.dtype.kind in "iub" else data.dtype)
        data[mask] = np.nan
        return data
    # Masked tensors of torch; others with gradients or on a GPU are for the user to detach.
    return values.to_tensor(np.nan) if hasattr(values, "get_mask") else values


def nearest(places: Floats, values: Floats) -> Index:
    """The number of the place, among increasing ones [k], that is nearest to each value [n]."""
    return np.searchsorted((places[1:] + places[:-1]) / 2, values)
