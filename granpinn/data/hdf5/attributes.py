"""Root attributes: numbers and fixed-length strings, whose size is checked before reading."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from h5py import h5a, h5s, h5t

from granpinn.data.flow import FlowFileError
from granpinn.data.hdf5.kinds import damage, describe, is_fixed_string, is_number

MAX_ATTRIBUTES = 256
MAX_BYTES = 65536


class Attributes:
    """The attributes of one group."""

    def __init__(self, group: Any) -> None:
        self._group = group

    def text(self, name: str) -> str | None:
        """A scalar fixed-length string, None if there is none."""
        with damage(f"the attribute {name}"):
            attribute = self._open(name)
            if attribute is None:
                return None
            kind = attribute.get_type()
            if not is_fixed_string(kind):
                raise FlowFileError(
                    f"the attribute {name} must be a fixed-length string, got "
                    f"{describe(kind)}: write it as numpy.bytes_"
                )
            shape = _shape(name, attribute, kind)
            if shape != ():
                raise FlowFileError(
                    f"the attribute {name} must be one string, got an array {list(shape)}: "
                    "write it as numpy.bytes_"
                )
            value = np.empty((), dtype=f"S{kind.get_size()}")
            attribute.read(value, mtype=kind)
            try:
                return bytes(value[()]).rstrip(b"\0").decode()
            except UnicodeDecodeError:
                raise FlowFileError(
                    f"the attribute {name} must be text in UTF-8, got other bytes: write it again"
                ) from None

    def numbers(self, name: str) -> tuple[float, ...] | None:
        """A numeric attribute as a flat tuple (of int for an integer type), None if none."""
        with damage(f"the attribute {name}"):
            attribute = self._open(name)
            if attribute is None:
                return None
            kind = attribute.get_type()
            if not is_number(kind):
                raise FlowFileError(
                    f"the attribute {name} must be a number, got {describe(kind)}: write it as "
                    "float64"
                )
            whole = kind.get_class() == h5t.INTEGER
            shape = _shape(name, attribute, kind)
            value = np.empty(shape, dtype=np.int64 if whole else np.float64)
            if value.size:
                attribute.read(value)
            return tuple(value.ravel().tolist())

    def scalars(self, known: frozenset[str]) -> dict[str, str | float]:
        """All scalar numbers and fixed-length strings except the known ones."""
        names: list[str] = []
        with damage("the list of attributes"):
            count = h5a.get_num_attrs(self._group)
            if count > MAX_ATTRIBUTES:
                raise FlowFileError(
                    f"the file must have at most {MAX_ATTRIBUTES} attributes, got {count}: "
                    "remove those that are not needed"
                )
            h5a.iterate(self._group, lambda name: names.append(name.decode("ascii", "replace")))
        found: dict[str, str | float] = {}
        for name in sorted(set(names) - known):
            # Attributes with odd names are left out, as they would only clutter reports and tables.
            value = self._scalar(name) if name.isidentifier() else None
            if value is not None:
                found[name] = value
        return found

    def _scalar(self, name: str) -> str | float | None:
        with damage(f"the attribute {name}"):
            attribute = self._open(name)
            if attribute is None:
                return None
            kind = attribute.get_type()
            scalar = attribute.get_space().get_simple_extent_type() == h5s.SCALAR
        if not scalar or kind.get_size() > MAX_BYTES:
            return None
        if is_fixed_string(kind):
            return self.text(name)
        numbers = self.numbers(name) if is_number(kind) else None
        return numbers[0] if numbers else None

    def _open(self, name: str) -> Any:
        encoded = name.encode()
        return h5a.open(self._group, encoded) if h5a.exists(self._group, encoded) else None


def _shape(name: str, attribute: Any, kind: Any) -> tuple[int, ...]:
    """The shape of an attribute; an error if it is large."""
    space = attribute.get_space()
    if space.get_simple_extent_type() == h5s.NULL:
        raise FlowFileError(f"the attribute {name} must have a value, got none: add it")
    shape = tuple(space.shape)
    n_bytes = kind.get_size() * math.prod(shape)
    if n_bytes > MAX_BYTES:
        raise FlowFileError(
            f"the attribute {name} must be at most {MAX_BYTES} bytes long, got {n_bytes}: "
            "shorten it"
        )
    return shape
