"""Careful access to a HDF5 file that somebody else made.

HDF5 files can point outside themselves (external links, external storage, virtual datasets),
can inflate to far more than they declare, and can hang the library in damaged variable-length
data. So the file is read into memory once and parsed there, and nothing in it is touched before
its kind, type and size are known.
"""

from __future__ import annotations

import math
import os
import stat
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import numpy.typing as npt
from h5py import h5a, h5d, h5f, h5g, h5l, h5o, h5s, h5t, h5z

from granpinn.data.flow import FlowFileError
from granpinn.data.format import Layout

MAX_ATTRIBUTE_BYTES = 65536
MAX_ATTRIBUTES = 256
MAX_CHUNKS = 1_000_000
# H5LT_FILE_IMAGE_DONT_COPY | H5LT_FILE_IMAGE_DONT_RELEASE: parse our bytes where they are.
_IN_PLACE = 0x2 | 0x4
_CHECKSUM_BYTES = 4

_KINDS = {
    h5t.INTEGER: "integer",
    h5t.FLOAT: "float",
    h5t.STRING: "fixed-length string",
    h5t.BITFIELD: "bit field",
    h5t.OPAQUE: "opaque",
    h5t.COMPOUND: "compound",
    h5t.REFERENCE: "object reference",
    h5t.ENUM: "enumeration",
    h5t.VLEN: "variable-length",
    h5t.ARRAY: "array",
}
_LINKS = {h5l.TYPE_SOFT: "a soft link", h5l.TYPE_EXTERNAL: "a link to another file"}


def read_regular_file(path: Path, max_bytes: int) -> bytes:
    """The content of a regular file; a directory, FIFO, device or larger file is refused."""
    try:
        kind = path.stat().st_mode  # before opening: opening a device can have effects
        if stat.S_ISDIR(kind):
            raise FlowFileError("this is a directory, expected a flow file: name the file in it")
        if not stat.S_ISREG(kind):
            raise FlowFileError("this is not a regular file: copy the flow to one and name that")
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(handle, "rb") as file:
            status = os.fstat(handle)
            if not stat.S_ISREG(status.st_mode):
                raise FlowFileError("this file was replaced while it was opened: try again")
            if status.st_size > max_bytes:
                raise too_large(status.st_size, max_bytes)
            content = file.read(status.st_size)
    except FileNotFoundError:
        raise FlowFileError("there is no such file: check the path") from None
    except OSError as error:
        raise FlowFileError(f"the file cannot be opened ({error.strerror}): check it") from None
    if not content:
        raise FlowFileError("the file is empty, expected a flow file: copy or make it again")
    return content


def too_large(n_bytes: int, max_bytes: int) -> FlowFileError:
    """The error for a file that holds or declares more than we are willing to read."""
    return FlowFileError(
        f"the file holds {n_bytes / 2**30:.3g} GiB of data, more than the limit of "
        f"{max_bytes / 2**30:.3g} GiB: if it can be trusted, raise max_bytes of read_flow"
    )


@contextmanager
def _damage(what: str) -> Iterator[None]:
    """Turns whatever HDF5 says about a damaged part of the file into one sentence."""
    try:
        yield
    except FlowFileError:
        raise
    except (OSError, RuntimeError, ValueError, TypeError, KeyError, ArithmeticError) as error:
        reason = " ".join(str(error).split())[:200]
        raise FlowFileError(
            f"{what} cannot be read, the file is damaged ({reason}): copy or make it again"
        ) from None


class SafeFile:
    """A HDF5 file in memory, of which only plain numbers and fixed-length strings are read."""

    def __init__(self, image: bytes) -> None:
        self._image = image  # HDF5 works on these bytes: they must outlive the file
        if not _looks_like_hdf5(image):
            raise FlowFileError(
                "this is not an HDF5 file, expected a flow file: convert it with "
                "granpinn.data.write_flow"
            )
        with _damage("the file"):
            self._file = h5f.open_file_image(image, flags=_IN_PLACE)
        self._root: Any = None

    def __enter__(self) -> SafeFile:
        with _damage("the file"):
            self._root = h5g.open(self._file, b"/")
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._root = None
        self._file.close()

    def text(self, name: str) -> str | None:
        """A scalar fixed-length string attribute of the root, None if there is none."""
        with _damage(f"the attribute {name}"):
            if not h5a.exists(self._root, name.encode()):
                return None
            attribute = h5a.open(self._root, name.encode())
            kind = attribute.get_type()
            if kind.get_class() != h5t.STRING or kind.is_variable_str():
                raise FlowFileError(
                    f"the attribute {name} must be a fixed-length string, got "
                    f"{_describe(kind)}: write it as numpy.bytes_"
                )
            _check_attribute_size(name, attribute, kind)
            if attribute.shape != ():
                raise FlowFileError(
                    f"the attribute {name} must be one string, got an array "
                    f"{list(attribute.shape)}: write it as numpy.bytes_"
                )
            value = np.empty((), dtype=f"S{kind.get_size()}")
            attribute.read(value, mtype=kind)
            return bytes(value[()]).rstrip(b"\0").decode()

    def numbers(self, name: str) -> tuple[float, ...] | tuple[int, ...] | None:
        """A numeric attribute of the root as a flat tuple, None if there is none."""
        with _damage(f"the attribute {name}"):
            if not h5a.exists(self._root, name.encode()):
                return None
            attribute = h5a.open(self._root, name.encode())
            kind = attribute.get_type()
            if kind.get_class() not in (h5t.INTEGER, h5t.FLOAT):
                raise FlowFileError(
                    f"the attribute {name} must be a number, got {_describe(kind)}: "
                    "write it as a float64"
                )
            _check_attribute_size(name, attribute, kind)
            whole = kind.get_class() == h5t.INTEGER
            value = np.empty(attribute.shape, dtype=np.int64 if whole else np.float64)
            attribute.read(value)
            return tuple(value.ravel().tolist())

    def other_attributes(self, known: frozenset[str]) -> dict[str, str | float | int]:
        """All further scalar attributes of the root that are numbers or fixed-length strings."""
        names: list[str] = []
        with _damage("the attributes"):
            if h5a.get_num_attrs(self._root) > MAX_ATTRIBUTES:
                raise FlowFileError(
                    f"the file has {h5a.get_num_attrs(self._root)} attributes, more than the "
                    f"limit of {MAX_ATTRIBUTES}: remove those that are not needed"
                )
            h5a.iterate(self._root, lambda name: names.append(name.decode("ascii", "replace")))
        others: dict[str, str | float | int] = {}
        for name in sorted(set(names) - known):
            if name.isidentifier():
                value = self._scalar(name)
                if value is not None:
                    others[name] = value
        return others

    def _scalar(self, name: str) -> str | float | int | None:
        with _damage(f"the attribute {name}"):
            attribute = h5a.open(self._root, name.encode())
            kind = attribute.get_type()
            plain = attribute.get_space().get_simple_extent_type() == h5s.SCALAR
            small = kind.get_size() <= MAX_ATTRIBUTE_BYTES
            if plain and small and kind.get_class() in (h5t.INTEGER, h5t.FLOAT):
                numbers = self.numbers(name)
                return numbers[0] if numbers else None
            if plain and small and kind.get_class() == h5t.STRING and not kind.is_variable_str():
                return self.text(name)
            return None

    def open_dataset(self, name: str) -> Dataset | None:
        """A dataset of the root that lies in this file itself, None if there is none."""
        with _damage(name):
            if not self._root.links.exists(name.encode()):
                return None
            link = self._root.links.get_info(name.encode()).type
            if link != h5l.TYPE_HARD:
                raise FlowFileError(
                    f"{name} must be stored in the file itself, got "
                    f"{_LINKS.get(link, 'a user-defined link')}: copy the data into the file"
                )
            dataset = h5o.open(self._root, name.encode())
            if not isinstance(dataset, h5d.DatasetID):
                raise FlowFileError(
                    f"{name} must be a dataset, got a group or a type: {_STORE_HINT}"
                )
            return Dataset(name, dataset, len(self._image))


_STORE_HINT = "store it as a plain array"


class Dataset:
    """One dataset: its layout is known, its data is read on demand."""

    def __init__(self, name: str, dataset: Any, file_bytes: int) -> None:
        self.name = name
        self._dataset = dataset
        self._file_bytes = file_bytes
        self._plan = dataset.get_create_plist()
        # The storage comes first: asking a virtual dataset for its shape opens other files.
        if self._plan.get_layout() == h5d.VIRTUAL or self._plan.get_external_count() > 0:
            raise FlowFileError(
                f"{name} must be stored in the file itself, got data in another file (virtual "
                "or external storage): copy the data into the file"
            )
        kind = dataset.get_type()
        if kind.get_class() == h5t.FLOAT and _is_ieee(kind):
            self._itemsize = kind.get_size()
        else:
            self._itemsize = 0
        space = dataset.get_space()
        if space.get_simple_extent_type() not in (h5s.SIMPLE, h5s.SCALAR):
            raise FlowFileError(f"{name} must be an array, got an empty one: {_STORE_HINT}")
        self.layout = Layout(
            tuple(space.shape), f"float{8 * self._itemsize}" if self._itemsize else _describe(kind)
        )

    @property
    def n_bytes(self) -> int:
        """Memory that reading takes: the array, or one chunk where that is larger."""
        chunk = self._plan.get_chunk() if self._plan.get_layout() == h5d.CHUNKED else ()
        size = max(math.prod(self.layout.shape), math.prod(chunk) if chunk else 0)
        return int(size) * self._itemsize

    def read(self, dtype: str) -> npt.NDArray[Any]:
        """All of the data, after a check that the file really holds it."""
        with _damage(self.name):
            if self._plan.get_layout() == h5d.CHUNKED:
                self._check_chunks()
            elif self._dataset.get_storage_size() != self.n_bytes:
                raise self._no_data()
            array = np.empty(self.layout.shape, dtype=dtype)
            if array.size:
                self._dataset.read(h5s.ALL, h5s.ALL, array)
            return array

    def _no_data(self) -> FlowFileError:
        return FlowFileError(
            f"{self.name} declares {list(self.layout.shape)} values but not all are stored: "
            "copy or make the file again"
        )

    def _check_chunks(self) -> None:
        """Every chunk must be there and unpack to exactly its declared size, no more.

        HDF5 itself inflates a chunk as far as it goes, 1000 times the size of the file.
        """
        chunk = self._plan.get_chunk()
        expected = math.prod(-(-n // k) for n, k in zip(self.layout.shape, chunk, strict=True))
        if expected > MAX_CHUNKS:
            raise FlowFileError(
                f"{self.name} is stored in {expected} chunks, more than the limit of "
                f"{MAX_CHUNKS}: write it in chunks of whole frames"
            )
        filters = [self._plan.get_filter(i)[0] for i in range(self._plan.get_nfilters())]
        known = (h5z.FILTER_DEFLATE, h5z.FILTER_SHUFFLE, h5z.FILTER_FLETCHER32)
        if any(code not in known for code in filters) or len(set(filters)) < len(filters):
            raise FlowFileError(
                f"{self.name} is stored with the filters {filters}, expected gzip, shuffle and "
                "fletcher32 at most once each: write it again with gzip"
            )
        stored: list[Any] = []
        self._dataset.chunk_iter(stored.append)
        if len(stored) != expected:
            raise self._no_data()
        n_bytes = math.prod(chunk) * self._itemsize
        for info in stored:
            self._check_chunk(info, filters, n_bytes)

    def _check_chunk(self, info: Any, filters: list[int], n_bytes: int) -> None:
        applied = [f for i, f in enumerate(filters) if not info.filter_mask >> i & 1]
        packed = h5z.FILTER_DEFLATE in applied
        before = applied[: applied.index(h5z.FILTER_DEFLATE)] if packed else applied
        after = applied[len(before) :]
        unpacked = n_bytes + _CHECKSUM_BYTES * (h5z.FILTER_FLETCHER32 in before)
        size = info.size
        if packed and size <= self._file_bytes:
            raw = self._dataset.read_direct_chunk(info.chunk_offset)[1]
            if h5z.FILTER_FLETCHER32 in after:
                raw = raw[:-_CHECKSUM_BYTES]
            inflate = zlib.decompressobj()
            size = len(inflate.decompress(raw, unpacked + 1))
        if size != unpacked:
            raise FlowFileError(
                f"{self.name} has a chunk of {size if size < unpacked else 'more'} bytes where "
                f"{unpacked} were declared: the file is damaged, copy or make it again"
            )


def _looks_like_hdf5(image: bytes) -> bool:
    """Whether the signature stands at 0, 512, 1024, 2048, ... as HDF5 wants it."""
    offsets = [0, *(512 << i for i in range(max(len(image).bit_length() - 9, 0)))]
    return any(image[i : i + 8] == b"\x89HDF\r\n\x1a\n" for i in offsets)


def _is_ieee(kind: Any) -> bool:
    standard = (h5t.IEEE_F32LE, h5t.IEEE_F32BE, h5t.IEEE_F64LE, h5t.IEEE_F64BE)
    return any(kind.equal(other) for other in standard)


def _describe(kind: Any) -> str:
    """The name of a HDF5 type, in words."""
    if kind.get_class() == h5t.STRING and kind.is_variable_str():
        return "variable-length string"
    name = _KINDS.get(kind.get_class(), "unknown type")
    return f"{name} of {kind.get_size()} bytes" if name in ("integer", "float") else name


def _check_attribute_size(name: str, attribute: Any, kind: Any) -> None:
    space = attribute.get_space()
    if space.get_simple_extent_type() == h5s.NULL:
        raise FlowFileError(f"the attribute {name} is empty, expected a value: add one")
    n_bytes = kind.get_size() * math.prod(space.shape)
    if n_bytes > MAX_ATTRIBUTE_BYTES:
        raise FlowFileError(
            f"the attribute {name} holds {n_bytes} bytes, more than the limit of "
            f"{MAX_ATTRIBUTE_BYTES}: shorten it"
        )
