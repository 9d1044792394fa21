"""Attacks on one dataset of any HDF5 file; references lead to the file `OUTSIDE` beside it."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

from .hostile_edits import OUTSIDE

SENTINEL = 12345.5


def make_outside(folder: Path, like: h5py.Dataset) -> Path:
    """A file with a dataset like this one, that holds other values."""
    path = folder / OUTSIDE
    with h5py.File(path, "w") as file:
        file["secret"] = np.full(like.shape, SENTINEL).astype(like.dtype.base)
    return path


def _new(
    file: h5py.File,
    name: str,
    plan: object,
    shape: tuple[int, ...],
    kind: object,
    grows: bool = False,
) -> None:
    """The dataset made anew with a property list, with its attributes but no data."""
    attributes = {
        key: file[name].attrs[key]
        for key in file[name].attrs
        if key not in ("DIMENSION_LIST", "REFERENCE_LIST")
    }
    scales = [[*dim.values()] for dim in file[name].dims] if file[name].ndim else []
    del file[name]
    space = h5py.h5s.create_simple(shape, (h5py.h5s.UNLIMITED,) * len(shape) if grows else None)
    h5py.h5d.create(file.id, name.encode(), kind, space, plan)
    for key, value in attributes.items():
        file[name].attrs[key] = value
    for dim, found in zip(file[name].dims, scales, strict=False):
        for scale in found:
            dim.attach_scale(scale)


def _plan() -> object:
    return h5py.h5p.create(h5py.h5p.DATASET_CREATE)


def _virtual(file: h5py.File, name: str) -> None:
    plan, shape, kind = _plan(), file[name].shape, file[name].id.get_type()
    space = h5py.h5s.create_simple(shape)
    plan.set_virtual(space, OUTSIDE.encode(), b"secret", space)
    _new(file, name, plan, shape, kind)


def _external(file: h5py.File, name: str) -> None:
    plan, shape, kind = _plan(), file[name].shape, file[name].id.get_type()
    plan.set_external(OUTSIDE.encode(), 2048, math.prod(shape) * kind.get_size())
    _new(file, name, plan, shape, kind)


def _link(file: h5py.File, name: str, link: object) -> None:
    del file[name]
    file[name] = link


def _gzip(file: h5py.File, name: str, content: bytes, grow: int = 1) -> None:
    """One chunk with this content; the array grows along its first axis."""
    plan, shape, kind = _plan(), file[name].shape, file[name].id.get_type()
    shape = (shape[0] * grow, *shape[1:])
    plan.set_chunk(shape)
    plan.set_deflate(1)
    _new(file, name, plan, shape, kind)
    file[name].id.write_direct_chunk((0,) * len(shape), zlib.compress(content, 9))


def _lzf(file: h5py.File, name: str) -> None:
    plan, shape, kind = _plan(), file[name].shape, file[name].id.get_type()
    plan.set_chunk(shape)
    plan.set_filter(h5py.h5z.FILTER_LZF, h5py.h5z.FLAG_OPTIONAL)
    _new(file, name, plan, shape, kind)


def _plugin(file: h5py.File, name: str) -> None:
    """A filter that HDF5 would look for in HDF5_PLUGIN_PATH."""
    plan, shape, kind = _plan(), file[name].shape, file[name].id.get_type()
    plan.set_chunk(shape)
    plan.set_filter(32_015, h5py.h5z.FLAG_OPTIONAL)
    _new(file, name, plan, shape, kind)
    file[name].id.write_direct_chunk((0,) * len(shape), b"plugin", 0)


def _declared(file: h5py.File, name: str) -> None:
    """3.9 GiB in one chunk that unpacks to 1,000 bytes."""
    kind = file[name].id.get_type()
    rows = int(3.9 * 2**30) // (kind.get_size() * math.prod(file[name].shape[1:]))
    _gzip(file, name, bytes(1000), rows // file[name].shape[0])


def _huge_chunk(file: h5py.File, name: str) -> None:
    """A few values in one chunk that unpacks to 96 MiB of zeros, as declared."""
    plan, shape, kind = _plan(), file[name].shape, file[name].id.get_type()
    rows = 96 * 2**20 // (kind.get_size() * math.prod(shape[1:]))
    plan.set_chunk((rows, *shape[1:]))
    plan.set_deflate(1)
    _new(file, name, plan, shape, kind, grows=True)
    content = bytes(rows * kind.get_size() * math.prod(shape[1:]))
    file[name].id.write_direct_chunk((0,) * len(shape), zlib.compress(content, 9))


# What is done to a dataset, and a part of the message.
ATTACKS: dict[str, tuple[Callable[[h5py.File, str], object], str]] = {
    "virtual dataset": (_virtual, "virtual or external storage"),
    "external storage": (_external, "virtual or external storage"),
    "external link": (lambda f, n: _link(f, n, h5py.ExternalLink(OUTSIDE, "/secret")), "a link to"),
    "soft link": (lambda f, n: _link(f, n, h5py.SoftLink("/nothing")), "a soft link"),
    "loop of groups": (lambda f, n: _link(f, n, f["/"]), "must be a dataset|holds no tables"),
    "short chunk": (lambda f, n: _gzip(f, n, b"abc"), "must have chunks of .* got one of 3"),
    "long chunk": (lambda f, n: _gzip(f, n, bytes(2**27)), "must have chunks of .* got one of m"),
    "short chunk of 3.9 GiB": (_declared, "must hold at most|must have chunks of|must be \\("),
    "huge chunk of few values": (_huge_chunk, "no larger than its data, got chunks"),
    "lzf": (_lzf, "gzip, shuffle and fletcher32 only"),
    "filter of a plugin": (_plugin, "gzip, shuffle and fletcher32 only"),
}
