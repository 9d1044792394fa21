"""Edits that leave valid HDF5 of any layout: types, shapes, attributes, values.

Those of storage, links and data of other files are the ATTACKS and, on flow files, the EDITS of
tests/data.
"""

from __future__ import annotations

import math
from pathlib import Path
from random import Random
from typing import Any

import h5py
import numpy as np

from tests.data.hostile_containers import ATTACKS
from tests.data.hostile_edits import EDITS

SIGNATURE = b"\x89HDF\r\n\x1a\n"
NUMBERS = (
    *(np.nan, np.inf, -np.inf, 0.0, -0.0, -1.0, 1.0, 1e-300, 5e-324, 1e-30, 1e12, 1e30, 1e300),
    *(1e308, -1e308, 2**31, 2**53, 2**63, 1000.0, 0.001, 1.7e9, 12000.0, 1e9, 1.0000001),
)
TEXTS = (
    *("", "x", "kg", "m" * 30_000, "kg" * 20_000, "m**9999999", "1/0 m", "mm/px", "s^-1", "é"),
    *("(" * 3000, "m/" * 3000, "nan", "1e400 m", "\x00", "%", "<b>", " " * 40_000, "m ^ " * 5000),
)
SIZES = (0, 1, 2, 3, 7, 1000, 2**16, 2**31 - 1, 2**31, 2**40, 2**62)
# Takes more memory than a small file may: it really holds 600 MiB, which the format allows.
LARGE = {"honest zeros"}
MOST = 2**22  # bytes of a dataset that is edited, and of a file
FLOW_EDITS = sorted(set(EDITS) - LARGE)


def edited(content: bytes, draw: Random, folder: Path) -> bytes:
    """An HDF5 file with one to three edits; edits that HDF5 refuses are left out."""
    path = folder / "edited.h5"
    path.write_bytes(content)
    with h5py.File(path, "r+") as file:
        for _ in range(draw.choice((1, 1, 2, 3))):
            try:
                _edit(file, draw)
            except Exception:  # the damage before leaves objects that h5py cannot handle
                continue
    # A file that is really large may take as much memory.
    made = path.read_bytes() if path.stat().st_size <= MOST else content
    path.unlink()
    return made


def is_hdf5(content: bytes) -> bool:
    """Whether a file begins as HDF5, with or without a user block."""
    return content[:8] == SIGNATURE or content[512:520] == SIGNATURE


def _edit(file: h5py.File, draw: Random) -> None:
    datasets: list[str] = []
    objects: list[str] = ["/"]

    def visit(name: str, node: Any) -> None:
        objects.append(name)
        # What an edit before has made huge stays as it is: it would take minutes to fill.
        if isinstance(node, h5py.Dataset):
            size = max(node.size or 0, math.prod(node.chunks or ()))
            if size * node.dtype.itemsize <= MOST:
                datasets.append(name)

    file.visititems(visit)
    if "u" in datasets and draw.random() < 0.2:
        EDITS[draw.choice(FLOW_EDITS)][0](file)
    elif datasets and draw.random() < 0.1:
        ATTACKS[draw.choice(sorted(ATTACKS))][0](file, draw.choice(datasets))
    elif not datasets or draw.random() < 0.45:
        _attribute(file[draw.choice(objects)].attrs, draw)
    else:
        edit = draw.choice((_values, _values, _axis, _retype, _reshape))
        edit(file, draw.choice(datasets), draw)


def _attribute(attributes: Any, draw: Random) -> None:
    names = list(attributes) or ["units"]
    name = draw.choice(names)
    kind = draw.randrange(7)
    if kind == 0:
        attributes.pop(name, None)
    elif kind in (1, 2, 3):
        shape = draw.choice(((), (), (), (1,), (2,), (9999,), (0,), (3, 3)))
        value: Any = np.full(shape, draw.choice(NUMBERS), draw.choice(("f8", "f8", "f4")))
        attributes.create(name, value)
    elif kind == 4:
        attributes.create(name, np.bytes_(draw.choice(TEXTS).encode()))
    elif kind == 5:
        attributes.create(name, draw.choice(TEXTS), dtype=h5py.string_dtype())
    else:
        dtype = draw.choice(("i1", "u8", "?", "c16", "f2", "V8", "(3,)f8", [("a", "f4")]))
        attributes.create(name, np.zeros((), dtype))


def _values(file: h5py.File, name: str, draw: Random) -> None:
    data = file[name]
    if not data.size or data.dtype.kind not in "fiu":
        return
    values = data[...].ravel()
    value, count = draw.choice(NUMBERS), draw.choice((1, 3, values.size // 2, values.size))
    places = draw.sample(range(values.size), max(1, min(count, values.size)))
    kind = draw.randrange(4)
    with np.errstate(all="ignore"):
        if kind == 0:
            values[places] = np.asarray(value).astype(values.dtype)
        elif kind == 1:
            values = (values * value).astype(data.dtype)
        elif kind == 2:
            values = (values + value).astype(data.dtype)
        else:
            values[places] = values[draw.sample(places, len(places))]
        data[...] = values.reshape(data.shape)


def _axis(file: h5py.File, name: str, draw: Random) -> None:
    """An axis in another order, shifted, or with equal values."""
    nodes = [file[n] for n in file]
    lines = [n for n in nodes if isinstance(n, h5py.Dataset) and n.ndim == 1]
    lines = [n for n in lines if n.size * n.dtype.itemsize <= MOST]
    if not lines:
        return
    data = draw.choice(lines)
    if data.dtype.kind != "f" or not data.size:
        return
    values = data[...]
    order = draw.sample(range(values.size), values.size)
    with np.errstate(all="ignore"):
        data[...] = draw.choice(
            (values[::-1], values[order], values * 0, values + 1.7e9, values + 1e16, values * 1e300)
        )


def _replace(file: h5py.File, name: str, *args: Any, **options: Any) -> h5py.Dataset:
    attributes = dict(file[name].attrs)
    del file[name]
    made = file.create_dataset(name, *args, **options)
    for key, value in attributes.items():
        made.attrs[key] = value
    return made


def _retype(file: h5py.File, name: str, draw: Random) -> None:
    kinds = ("i1", "u8", "f2", "f8", "f16", "c8", "S4", "V4", "?", "(2,)f4", ">f8", "i8", "u1")
    special = (h5py.string_dtype(), h5py.vlen_dtype("f4"), h5py.ref_dtype, [("a", "f4")])
    dtype = draw.choice((*kinds, *special))
    values, shape = file[name][...], file[name].shape
    try:
        _replace(file, name, data=values.astype(dtype))
    except (TypeError, ValueError, KeyError):
        if name in file:
            del file[name]
        file.create_dataset(name, shape, dtype)


def _reshape(file: h5py.File, name: str, draw: Random) -> None:
    """Another shape; huge ones are declared and not stored."""
    shape = list(file[name].shape) or [1]
    kind = draw.randrange(4)
    if kind == 0 and len(shape) > 1:
        draw.shuffle(shape)
    elif kind == 1:
        shape.insert(draw.randrange(len(shape) + 1), draw.choice((1, 2)))
    elif kind == 2 and len(shape) > 1:
        shape.pop()
    else:
        shape[draw.randrange(len(shape))] = draw.choice(SIZES)
    options = draw.choice(({}, {"chunks": True}, {"chunks": True, "compression": "gzip"}))
    fill = draw.choice((None, 0, 1, np.nan))
    _replace(file, name, shape=tuple(shape), dtype=file[name].dtype, fillvalue=fill, **options)
