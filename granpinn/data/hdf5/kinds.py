"""Types of HDF5: their description, their NumPy type; and errors of HDF5 as one sentence."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from h5py import h5t

from granpinn.regular import UnsafeFileError

_KINDS = {
    h5t.INTEGER: "integer",
    h5t.FLOAT: "float",
    h5t.STRING: "fixed-length string",
    h5t.TIME: "time",
    h5t.BITFIELD: "bit field",
    h5t.OPAQUE: "opaque",
    h5t.COMPOUND: "compound",
    h5t.REFERENCE: "object reference",
    h5t.ENUM: "enumeration",
    h5t.VLEN: "variable-length",
    h5t.ARRAY: "array",
}
# Errors that h5py and zlib raise on damaged files, as seen with mutants of a valid one.
HDF5_ERRORS = (
    OSError,
    RuntimeError,
    ValueError,
    TypeError,
    LookupError,
    ArithmeticError,
    struct.error,
    zlib.error,
)
_IEEE = {
    "float16": (h5t.IEEE_F16LE, h5t.IEEE_F16BE),
    "float32": (h5t.IEEE_F32LE, h5t.IEEE_F32BE),
    "float64": (h5t.IEEE_F64LE, h5t.IEEE_F64BE),
}
_MAX_MEMBERS = 1000


def describe(kind: Any) -> str:
    """The name of a type: NumPy's name for standard floats, a description for others."""
    for name in ("float32", "float64"):
        if any(kind.equal(other) for other in _IEEE[name]):
            return name
    if is_fixed_string(kind) or kind.get_class() != h5t.STRING:
        name = _KINDS.get(kind.get_class(), "unknown type")
        return f"{name} of {kind.get_size()} bytes" if name in ("integer", "float") else name
    return "variable-length string"


def is_fixed_string(kind: Any) -> bool:
    """Whether values of this type are strings of fixed length."""
    return kind.get_class() == h5t.STRING and not kind.is_variable_str()


def is_number(kind: Any) -> bool:
    """Whether values of this type are integers or floating-point numbers."""
    return kind.get_class() in (h5t.INTEGER, h5t.FLOAT)


def is_boolean(kind: Any) -> bool:
    """Whether values of this type are truth values as h5py writes them: an enumeration."""
    if kind.get_class() != h5t.ENUM or kind.get_size() != 1 or kind.get_nmembers() != 2:
        return False
    members = {kind.get_member_name(k): kind.get_member_value(k) for k in range(2)}
    return members == {b"FALSE": 0, b"TRUE": 1}


def stored_dtype(kind: Any) -> np.dtype[Any] | None:
    """The NumPy type of stored numbers, None if they have an unusual layout or are no numbers."""
    size = kind.get_size()
    if kind.get_class() == h5t.FLOAT:
        for name, (little, big) in _IEEE.items():
            if kind.equal(little):
                return np.dtype(name).newbyteorder("<")
            if kind.equal(big):
                return np.dtype(name).newbyteorder(">")
    if (
        kind.get_class() == h5t.INTEGER
        and size in (1, 2, 4, 8)
        and (kind.get_precision(), kind.get_offset()) == (8 * size, 0)
    ):
        order = ">" if kind.get_order() == h5t.ORDER_BE else "<"
        return np.dtype(f"{order}{'i' if kind.get_sign() == h5t.SGN_2 else 'u'}{size}")
    return None


def row_dtype(kind: Any) -> np.dtype[Any]:
    """The NumPy type of the rows of a table (a compound type) as they are stored.

    A member that is no number and no array of numbers becomes plain bytes, which nobody follows.
    """
    count = kind.get_nmembers()
    if count > _MAX_MEMBERS:
        raise UnsafeFileError(f"a table must have at most {_MAX_MEMBERS} columns, got {count}")
    members = [kind.get_member_type(i) for i in range(count)]
    return np.dtype(
        {
            "names": [kind.get_member_name(i).decode() for i in range(count)],
            "formats": [_member_dtype(member) for member in members],
            "offsets": [kind.get_member_offset(i) for i in range(count)],
            "itemsize": kind.get_size(),
        }
    )


def _member_dtype(kind: Any) -> Any:
    base, shape = kind, ()
    if kind.get_class() == h5t.ARRAY:
        base, shape = kind.get_super(), kind.get_array_dims()
    dtype = stored_dtype(base)
    if dtype is None or dtype.itemsize * math.prod(shape) != kind.get_size():
        return f"V{kind.get_size()}"
    return (dtype, shape)


@contextmanager
def damage(what: str) -> Iterator[None]:
    """Turns an error of HDF5 about a damaged part of the file into one sentence."""
    try:
        yield
    except UnsafeFileError:
        raise
    except HDF5_ERRORS as error:
        reason = " ".join(str(error).split())[:200]
        raise UnsafeFileError(
            f"{what} cannot be read, the file is damaged ({reason}): copy or make it again"
        ) from None
