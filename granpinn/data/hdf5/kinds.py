"""Descriptions of HDF5 types, and errors of HDF5 as one sentence."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from h5py import h5t

from granpinn.data.flow import FlowFileError

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
    zlib.error,
)
_IEEE = {
    "float32": (h5t.IEEE_F32LE, h5t.IEEE_F32BE),
    "float64": (h5t.IEEE_F64LE, h5t.IEEE_F64BE),
}


def describe(kind: Any) -> str:
    """The name of a type: NumPy's name for standard floats, a description for others."""
    for name, types in _IEEE.items():
        if any(kind.equal(other) for other in types):
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


@contextmanager
def damage(what: str) -> Iterator[None]:
    """Turns an error of HDF5 about a damaged part of the file into one sentence."""
    try:
        yield
    except FlowFileError:
        raise
    except HDF5_ERRORS as error:
        reason = " ".join(str(error).split())[:200]
        raise FlowFileError(
            f"{what} cannot be read, the file is damaged ({reason}): copy or make it again"
        ) from None
