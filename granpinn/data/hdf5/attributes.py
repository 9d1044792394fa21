"""Attributes: numbers and text, whose kind and size are checked before reading."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from h5py import h5a, h5s, h5t

from granpinn.data.hdf5.content import Content
from granpinn.data.hdf5.kinds import (
    damage,
    describe,
    is_boolean,
    is_fixed_string,
    is_number,
    stored_dtype,
)
from granpinn.data.hdf5.messages import raw_attribute
from granpinn.data.hdf5.variable import sequences
from granpinn.regular import UnsafeFileError

MAX_ATTRIBUTES = 256
MAX_BYTES = 65536
MAX_AXES = 32


class Attributes:
    """The attributes of one group or dataset."""

    def __init__(self, group: Any, file: Content) -> None:
        self._group, self._file = group, file

    def exists(self, name: str) -> bool:
        """Whether there is an attribute of this name, of any kind."""
        with damage(f"the attribute {name}"):
            return self._open(name) is not None

    def text(self, name: str) -> str | None:
        """A scalar fixed-length string, None if there is none."""
        content = self.content(name)
        try:
            return None if content is None else content.decode()
        except UnicodeDecodeError:
            raise UnsafeFileError(
                f"the attribute {name} must be text in UTF-8, got other bytes: write it again"
            ) from None

    def content(self, name: str) -> bytes | None:
        """The bytes of a scalar fixed-length string, None if there is none."""
        with damage(f"the attribute {name}"):
            attribute = self._open(name)
            if attribute is None:
                return None
            kind = attribute.get_type()
            if not is_fixed_string(kind):
                raise UnsafeFileError(
                    f"the attribute {name} must be a fixed-length string, got "
                    f"{describe(kind)}: write it as numpy.bytes_"
                )
            shape = _shape(name, attribute, kind)
            if shape != ():
                raise UnsafeFileError(
                    f"the attribute {name} must be one string, got an array {list(shape)}: "
                    "write it as numpy.bytes_"
                )
            value = np.empty((), dtype=f"S{kind.get_size()}")
            attribute.read(value, mtype=kind)
            return bytes(value[()]).rstrip(b"\0")

    def numbers(self, name: str) -> tuple[float, ...] | None:
        """A numeric attribute as a flat tuple (of int for an integer type), None if none."""
        with damage(f"the attribute {name}"):
            attribute = self._open(name)
            if attribute is None:
                return None
            kind = attribute.get_type()
            if is_boolean(kind):
                truth = np.empty(_shape(name, attribute, kind), np.int8)
                attribute.read(truth, mtype=kind)
                return tuple(truth.ravel().tolist())
            if not is_number(kind):
                raise UnsafeFileError(
                    f"the attribute {name} must be a number, got {describe(kind)}: write it as "
                    "float64"
                )
            whole = kind.get_class() == h5t.INTEGER
            shape = _shape(name, attribute, kind)
            value = np.empty(shape, dtype=np.int64 if whole else np.float64)
            if value.size:
                attribute.read(value)
            return tuple(value.ravel().tolist())

    def any_text(self, name: str) -> str | None:
        """One string of fixed or of variable length; None if there is none."""
        with damage(f"the attribute {name}"):
            attribute = self._open(name)
            if attribute is None:
                return None
            kind, space = attribute.get_type(), attribute.get_space()
            if kind.get_class() != h5t.STRING or space.get_simple_extent_type() == h5s.NULL:
                return None
            if math.prod(space.shape) != 1:
                return None
            if is_fixed_string(kind):
                _shape(name, attribute, kind)
                value = np.empty(space.shape, dtype=f"S{kind.get_size()}")
                attribute.read(value, mtype=kind)
                content = bytes(value.item())
            else:
                (content,) = sequences(self._file, self._raw(name), 1)
            return content.rstrip(b"\0").decode("utf-8", "replace")

    def array(self, name: str) -> npt.NDArray[Any] | None:
        """Numbers in their own type, None if there are none."""
        with damage(f"the attribute {name}"):
            attribute = self._open(name)
            dtype = None if attribute is None else stored_dtype(attribute.get_type())
            if attribute is None or dtype is None:
                return None
            value = np.zeros(_shape(name, attribute, attribute.get_type()), dtype)
            if value.size:
                attribute.read(value)
            return value

    def references(self, name: str) -> list[int]:
        """The first object that each variable-length list names, as its address.

        This is how DIMENSION_LIST names the scale of every axis. The list is empty if there is no
        such attribute.
        """
        with damage(f"the attribute {name}"):
            attribute = self._open(name)
            if attribute is None or attribute.get_type().get_class() != h5t.VLEN:
                return []
            (count,) = attribute.get_space().shape
            if count > MAX_AXES:
                raise UnsafeFileError(f"{name} must have at most {MAX_AXES} axes, got {count}")
            lists = sequences(self._file, self._raw(name), count)
            return [int.from_bytes(part[:8], "little") for part in lists]

    def _raw(self, name: str) -> bytes:
        return raw_attribute(self._file, self._file.address(self._group), name)

    def check_all(self) -> None:
        """Raises an error unless all attributes are numbers or fixed-length strings."""
        for name in self._names():
            with damage(f"the attribute {name}"):
                attribute = self._open(name)
                kind = None if attribute is None else attribute.get_type()
                if kind is not None and not (is_number(kind) or is_fixed_string(kind)):
                    raise UnsafeFileError(
                        f"the attribute {name} must be a number or a fixed-length string, got "
                        f"{describe(kind)}: write it again"
                    )

    def _names(self) -> list[str]:
        names: list[str] = []
        with damage("the list of attributes"):
            count = h5a.get_num_attrs(self._group)
            if count > MAX_ATTRIBUTES:
                raise UnsafeFileError(
                    f"the file must have at most {MAX_ATTRIBUTES} attributes, got {count}: "
                    "remove those that are not needed"
                )
            h5a.iterate(self._group, lambda name: names.append(name.decode("ascii", "replace")))
        return names

    def scalars(self, known: frozenset[str]) -> dict[str, str | float]:
        """All scalar numbers and fixed-length strings except the known ones."""
        found: dict[str, str | float] = {}
        for name in sorted(set(self._names()) - known):
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
        numbers = self.numbers(name) if is_number(kind) or is_boolean(kind) else None
        return numbers[0] if numbers else None

    def _open(self, name: str) -> Any:
        encoded = name.encode()
        return h5a.open(self._group, encoded) if h5a.exists(self._group, encoded) else None


def _shape(name: str, attribute: Any, kind: Any) -> tuple[int, ...]:
    """The shape of an attribute; an error if it is large."""
    space = attribute.get_space()
    if space.get_simple_extent_type() == h5s.NULL:
        raise UnsafeFileError(f"the attribute {name} must have a value, got none: add it")
    shape = tuple(space.shape)
    n_bytes = kind.get_size() * math.prod(shape)
    if n_bytes > MAX_BYTES:
        raise UnsafeFileError(
            f"the attribute {name} must be at most {MAX_BYTES} bytes long, got {n_bytes}: "
            "shorten it"
        )
    return shape
