"""HDF5 by h5py: flow files, fields.h5, and what other readers take out of such files.

The library opens nothing but the file itself: no link to elsewhere, no external or virtual data.
Filters are gzip, shuffle and fletcher32. The sizes of a dataset and its chunks are checked before
it is read. Chunks are unpacked here: HDF5 unpacks one to 1000 times the size of the file, and fills
the rest of a chunk that is too short with whatever its memory holds.
"""

from __future__ import annotations

import math
import os
import zlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt
from h5py import h5a, h5d, h5g, h5l, h5o, h5s, h5t, h5z

from granpinn.foreign.program import Answer
from granpinn.regular import RETRY, UnsafeFileError

LIBRARY = "h5py"
MAX_ATTRIBUTES = 256
MAX_ATTRIBUTE_BYTES = 65536
MAX_CHUNKS = 1_000_000
LARGE_CHUNK = 2**26  # bytes; a chunk above it may not be larger than the data
_CHECKSUM_BYTES = 4
_FILTERS = {h5z.FILTER_DEFLATE, h5z.FILTER_SHUFFLE, h5z.FILTER_FLETCHER32}
_LINKS = {h5l.TYPE_SOFT: "a soft link", h5l.TYPE_EXTERNAL: "a link to another file"}


def read(
    path: Path, answer: Answer, names: list[str], remedy: str = "", in_place: bool = False
) -> dict[str, Any]:
    """The attributes of the root, and those datasets of these names that exist.

    Args:
        remedy: for a file with too much data.
        in_place: whether values that lie in the file as they are stay there. Such a dataset has
            `place`, its first byte in the file, instead of `values`.
    """
    with opened(path) as file:
        entries = {name: dataset_of(file, name) for name in names}
        datasets = {name: dataset for name, dataset in entries.items() if dataset is not None}
        found: dict[str, Any] = {}
        n_bytes = 0
        for name, dataset in datasets.items():
            found[name] = {
                "shape": dataset.shape,
                "dtype": describe(dataset.id.get_type()),
                "attributes": attributes(dataset),
            }
            if in_place and _is_plain(dataset):
                _require_whole(name, dataset)
                found[name]["place"] = dataset.id.get_offset()
            else:
                n_bytes += max(_n_bytes(dataset.shape, dataset), _n_bytes(dataset.chunks, dataset))
        answer.require(n_bytes, remedy)
        for name, dataset in datasets.items():
            if "place" not in found[name] and number_type(dataset.id.get_type()):
                found[name]["values"] = answer.keep(values(name, dataset))
        return {"attributes": attributes(file), "datasets": found}


def opened(path: Path) -> h5py.File:
    """The file; UnsafeFileError if it is no whole HDF5 file."""
    if not h5py.is_hdf5(path):
        raise UnsafeFileError(f"this is no HDF5 file: {RETRY}")
    try:
        return h5py.File(path, "r", locking=False)
    except Exception:  # its messages are of no use here
        raise UnsafeFileError(
            f"the file is damaged or was cut off, expected a whole HDF5 file: {RETRY}"
        ) from None


def dataset_of(file: h5py.File, name: str) -> h5py.Dataset | None:
    """A dataset that lies in this file itself, None if there is none.

    Args:
        name: of a dataset of the root, or "group/name".
    """
    place: Any = file.id
    *groups, _ = parts = name.split("/")
    for depth, part in enumerate(parts):
        encoded = part.encode("utf-8", "surrogateescape")
        if not place.links.exists(encoded):
            return None
        if (link := place.links.get_info(encoded).type) != h5l.TYPE_HARD:
            raise UnsafeFileError(
                f"{name} must be stored in the file itself, got "
                f"{_LINKS.get(link, 'a user-defined link')}: copy the data into the file"
            )
        place = h5o.open(place, encoded)
        if depth < len(groups) and not isinstance(place, h5g.GroupID):
            raise UnsafeFileError(f"{part} must be a group that holds {name}, got none: rename it")
    return own_dataset(name, place)


def own_dataset(name: str, item: Any) -> h5py.Dataset:
    """The dataset of an identifier, whose data lie in this file."""
    if not isinstance(item, h5d.DatasetID):
        raise UnsafeFileError(
            f"{name} must be a dataset, got a group or a type: store the data in it"
        )
    # The storage comes first: reading the shape of a virtual dataset opens other files.
    plan = item.get_create_plist()
    if plan.get_layout() == h5d.VIRTUAL or plan.get_external_count() > 0:
        raise UnsafeFileError(
            f"{name} must be stored in the file itself, got data in another file (virtual "
            "or external storage): copy the data into the file"
        )
    if item.get_space().get_simple_extent_type() == h5s.NULL:
        raise UnsafeFileError(f"{name} must be an array, got an empty dataset: store the data")
    return h5py.Dataset(item)


def describe(kind: Any) -> str:
    """The name of a type: that of NumPy for plain numbers, else that of HDF5, such as vlen."""
    dtype = number_type(kind)
    return dtype.name if dtype else type(kind).__name__.removeprefix("Type")[:-2].lower()


def number_type(kind: Any) -> np.dtype[Any] | None:
    """The NumPy type of plain numbers; None for anything else."""
    if kind.get_class() not in (h5t.INTEGER, h5t.FLOAT) or kind.get_size() not in (1, 2, 4, 8):
        return None
    dtype: np.dtype[Any] = kind.dtype
    return dtype if kind.equal(h5t.py_create(dtype)) else None


def attributes(item: Any) -> dict[str, Any]:
    """Attributes of a group or dataset: text, or numbers as a list; of any other the type, as
    `{"type": NAME}`."""
    count = h5a.get_num_attrs(item.id)
    if count > MAX_ATTRIBUTES:
        raise UnsafeFileError(
            f"the file must have at most {MAX_ATTRIBUTES} attributes, got {count}: remove those "
            "that are not needed"
        )
    return {name: _attribute(item, name) for name in item.attrs}


def _attribute(item: Any, name: str) -> Any:
    attribute = item.attrs.get_id(name)
    kind, shape = attribute.get_type(), attribute.shape
    if kind.get_class() not in (h5t.INTEGER, h5t.FLOAT, h5t.ENUM, h5t.STRING):
        return {"type": describe(kind)}
    if attribute.get_space().get_simple_extent_type() == h5s.NULL:
        return {"type": "no value"}
    if (n_bytes := kind.get_size() * math.prod(shape)) > MAX_ATTRIBUTE_BYTES:
        return {"type": f"{n_bytes} bytes"}
    if kind.get_class() != h5t.STRING:
        return np.ravel(item.attrs[name]).tolist()
    if math.prod(shape) != 1:
        return {"type": f"an array {list(shape)} of text"}
    value = np.ravel(item.attrs[name])[0]
    content = value.encode("utf-8", "surrogateescape") if isinstance(value, str) else value
    try:
        return content[:MAX_ATTRIBUTE_BYTES].rstrip(b"\0").decode()
    except UnicodeDecodeError:
        return {"type": "text that is not UTF-8"}


def values(name: str, dataset: h5py.Dataset) -> npt.NDArray[Any]:
    """All of the data, after a check that the file really holds it."""
    kind = dataset.id.get_type()
    array = np.empty(dataset.shape, dataset.dtype)
    if dataset.chunks is None:
        _require_whole(name, dataset)
    elif _unpacked(name, dataset, array if number_type(kind) else None):
        return array
    if array.size:
        dataset.id.read(h5s.ALL, h5s.ALL, array)
    return array


def _n_bytes(shape: tuple[int, ...] | None, dataset: h5py.Dataset) -> int:
    return 0 if shape is None else math.prod(shape) * int(dataset.id.get_type().get_size())


def _is_plain(dataset: h5py.Dataset) -> bool:
    """Whether the numbers lie in the file as NumPy can use them."""
    dtype = number_type(dataset.id.get_type())
    contiguous = dataset.id.get_create_plist().get_layout() == h5d.CONTIGUOUS
    return bool(contiguous and dtype is not None and dtype.isnative)


def _require_whole(name: str, dataset: h5py.Dataset) -> None:
    if dataset.id.get_storage_size() != _n_bytes(dataset.shape, dataset):
        raise _incomplete(name, dataset)


def _incomplete(name: str, dataset: h5py.Dataset) -> UnsafeFileError:
    return UnsafeFileError(
        f"{name} must hold the {list(dataset.shape)} values that it declares, got fewer: the file "
        "was not written to its end, make it again"
    )


def _unpacked(name: str, dataset: h5py.Dataset, array: npt.NDArray[Any] | None) -> bool:
    """Unpacks every chunk, whose size must be as declared, into an array, if there is one.

    Returns:
        Whether the array has all values. HDF5 must read those with checksums.
    """
    shape, chunk, plan = dataset.shape, dataset.chunks, dataset.id.get_create_plist()
    filters = [plan.get_filter(i)[0] for i in range(plan.get_nfilters())]
    size = _n_bytes(chunk, dataset)
    expected = math.prod(-(-n // k) for n, k in zip(shape, chunk, strict=True))
    if expected > MAX_CHUNKS:
        raise UnsafeFileError(
            f"{name} must be stored in at most {MAX_CHUNKS} chunks, got {expected}: write it in "
            "chunks of whole frames"
        )
    if not set(filters) <= _FILTERS or len(set(filters)) < len(filters):
        raise UnsafeFileError(
            f"{name} must be stored with gzip, shuffle and fletcher32 only, each at most once, got "
            f"the filters {filters}: write it again with gzip"
        )
    if size > max(_n_bytes(shape, dataset), LARGE_CHUNK):
        raise UnsafeFileError(
            f"{name} must be stored in chunks that are no larger than its data, got chunks "
            f"{list(chunk)} for values {list(shape)}: write it in chunks of whole frames"
        )
    places: list[tuple[int, ...]] = []
    dataset.id.chunk_iter(lambda info: places.append(info.chunk_offset))
    if len({p for p in places if all(a < n for a, n in zip(p, shape, strict=True))}) != expected:
        raise _incomplete(name, dataset)
    fill = array is not None and h5z.FILTER_FLETCHER32 not in filters

    def unpack(place: tuple[int, ...]) -> None:
        mask, content = dataset.id.read_direct_chunk(place)
        applied = [code for i, code in enumerate(filters) if not mask >> i & 1]
        try:
            for code in reversed(applied):
                if code == h5z.FILTER_DEFLATE:
                    content = zlib.decompressobj().decompress(content, size + _CHECKSUM_BYTES + 1)
                elif code == h5z.FILTER_FLETCHER32:
                    content = content[:-_CHECKSUM_BYTES]
            got = "more" if len(content) > size else str(len(content))
        except zlib.error:
            got = "no gzip"
        if got != str(size):
            raise UnsafeFileError(
                f"{name} must have chunks of {size} bytes as declared, got one of {got}: the file "
                "is damaged, make it again"
            )
        if array is None or not fill:
            return
        if h5z.FILTER_SHUFFLE in applied:  # the first bytes of all values, then the second ...
            content = np.frombuffer(content, np.uint8).reshape(array.itemsize, -1).T.tobytes()
        target = array[tuple(slice(a, a + k) for a, k in zip(place, chunk, strict=True))]
        inside = tuple(map(slice, target.shape))
        target[...] = np.frombuffer(content, array.dtype).reshape(chunk)[inside]

    # zlib leaves Python meanwhile.
    with ThreadPoolExecutor(min(8, len(os.sched_getaffinity(0)))) as pool:
        for _ in pool.map(unpack, places):
            pass
    return fill
