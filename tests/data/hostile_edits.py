"""Changes of a flow file that leave valid HDF5, but break the format or attack its reader."""

from __future__ import annotations

import zlib
from collections.abc import Callable

import h5py
import numpy as np

OUTSIDE = "outside.h5"
MIB = 2**20


def _replace(file: h5py.File, name: str, *args: object, **options: object) -> h5py.Dataset:
    del file[name]
    return file.create_dataset(name, *args, **options)


def _packed_zeros(n_bytes: int) -> bytes:
    compressor = zlib.compressobj(9)
    parts = [compressor.compress(bytes(MIB)) for _ in range(n_bytes // MIB)]
    return b"".join([*parts, compressor.flush()])


def _chunk_that_inflates(file: h5py.File) -> None:
    """3 GiB of zeros behind a chunk that declares 5,760 bytes."""
    shape = file["u"].shape
    u = _replace(file, "u", shape=shape, dtype="f4", chunks=(3, *shape[1:]), compression="gzip")
    for frame in range(0, shape[0], 3):
        u.id.write_direct_chunk((frame, 0, 0), _packed_zeros(3 * 1024 * MIB // 40))


def _chunk_inside_chunk(file: h5py.File) -> None:
    """gzip applied twice: a million to one."""
    u = file["u"]
    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_chunk(u.shape)
    plan.set_deflate(9)
    plan.set_deflate(9)
    shape = u.shape
    del file["u"]
    space = h5py.h5s.create_simple(shape)
    new = h5py.h5d.create(file.id, b"u", h5py.h5t.IEEE_F32LE, space, plan)
    new.write_direct_chunk((0, 0, 0), zlib.compress(_packed_zeros(512 * MIB)))


def _honest_zeros(file: h5py.File) -> None:
    """600 MiB that are really stored, in a file of 1 MiB: read, then refused for its content."""
    shape = (100, 1024, 512)
    for name, size in zip(("t", "y", "x"), shape, strict=True):
        _replace(file, name, data=np.arange(1.0, size + 1))
    packed = _packed_zeros(20 * MIB)
    for name in ("u", "v", "c"):
        field = _replace(
            file, name, shape=shape, dtype="f4", chunks=(10, *shape[1:]), compression="gzip"
        )
        for frame in range(0, shape[0], 10):
            field.id.write_direct_chunk((frame, 0, 0), packed)
    del file["p"]


def _many_chunks(file: h5py.File) -> None:
    shape = (200, 128, 128)
    for name, size in zip(("t", "y", "x"), shape, strict=True):
        _replace(file, name, data=np.arange(1.0, size + 1))
    for name in ("u", "v", "c"):
        _replace(file, name, shape=shape, dtype="f4", chunks=(1, 1, 1), fillvalue=1.0)
    del file["p"]


def _giant_chunk(file: h5py.File) -> None:
    shape = file["u"].shape
    _replace(file, "u", shape=shape, dtype="f4", chunks=(900,) * 3, maxshape=(None,) * 3)


def _huge(file: h5py.File, **options: object) -> None:
    _replace(file, "t", shape=(2**24,), dtype="f8", **options)
    del file["p"]
    for name in ("u", "v", "c"):
        _replace(file, name, shape=(2**24, 24, 20), dtype="f4", **options)


def _virtual_without_end(file: h5py.File) -> None:
    """Unlimited: already the question for its shape makes HDF5 open the source."""
    shape, endless = file["u"].shape, h5py.h5s.UNLIMITED
    space = h5py.h5s.create_simple(shape, (endless, *shape[1:]))
    frames = h5py.h5s.create_simple(shape, (endless, *shape[1:]))
    for selection in (space, frames):
        selection.select_hyperslab((0, 0, 0), (endless, 1, 1), block=(1, *shape[1:]))
    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_virtual(space, OUTSIDE.encode(), b"u", frames)
    del file["u"]
    h5py.h5d.create(file.id, b"u", h5py.h5t.IEEE_F32LE, space, plan)


def _link(file: h5py.File, link: object) -> None:
    del file["u"]
    file["u"] = link


def _loop(file: h5py.File) -> None:
    _link(file, h5py.SoftLink("/w"))
    file["w"] = h5py.SoftLink("/u")


def _retype(file: h5py.File, dtype: object) -> None:
    _replace(file, "u", shape=file["u"].shape, dtype=dtype)


def _set_values(file: h5py.File, name: str, index: object, value: float) -> None:
    file[name][index] = value


def _one_number_of_bytes(file: h5py.File, name: str, size: int) -> None:
    file.attrs.create(name, np.zeros(size, dtype="f8"))


# What is done to a valid file, and a part of the message that this must lead to.
EDITS: dict[str, tuple[Callable[[h5py.File], object], str]] = {
    # Bombs
    "chunk that inflates": (_chunk_that_inflates, "u must have chunks of"),
    "chunk inside chunk": (_chunk_inside_chunk, "u must be stored with gzip"),
    "honest zeros": (_honest_zeros, "c must be 1"),
    "declared terabyte": (lambda f: _huge(f, chunks=True), "at most 1 GiB"),
    "declared terabyte, contiguous": (_huge, "at most 1 GiB"),
    "nothing stored": (lambda f: _retype(f, "f4"), "u must hold the"),
    "nothing stored, chunked": (
        lambda f: _replace(f, "u", shape=f["u"].shape, dtype="f4", chunks=True),
        "u must hold the",
    ),
    "one giant chunk": (_giant_chunk, "at most 1 GiB"),
    "millions of chunks": (_many_chunks, "at most 1000000 chunks"),
    "huge attribute": (lambda f: _one_number_of_bytes(f, "density", 8000), "density must be one"),
    "many attributes": (
        lambda f: [f.attrs.create(f"a{i}", 1.0) for i in range(300)],
        "at most 256 attributes",
    ),
    # Ways out of the file
    "unlimited virtual dataset": (_virtual_without_end, "virtual or external"),
    "loop of soft links": (_loop, "a soft link"),
    "lossy filter": (
        lambda f: _replace(f, "u", data=np.ones(f["u"].shape, "f4"), scaleoffset=2),
        "stored with gzip, shuffle and fletcher32 only",
    ),
    # Kinds and types
    "group": (lambda f: (f.pop("u"), f.create_group("u")), "u must be a dataset"),
    "named type": (lambda f: _link(f, np.dtype("f4")), "u must be a dataset"),
    "empty dataset": (
        lambda f: _replace(f, "u", data=h5py.Empty("f4")),
        "u must be an array",
    ),
    "scalar": (lambda f: _replace(f, "u", data=np.float32(1)), "got float32 []"),
    "variable-length strings": (
        lambda f: _retype(f, h5py.string_dtype()),
        "got string",
    ),
    "fixed strings": (lambda f: _retype(f, "S4"), "got string"),
    "variable-length numbers": (lambda f: _retype(f, h5py.vlen_dtype("f4")), "got vlen"),
    "object references": (lambda f: _retype(f, h5py.ref_dtype), "got reference"),
    "region references": (lambda f: _retype(f, h5py.regionref_dtype), "got reference"),
    "compound": (lambda f: _retype(f, [("a", "f4")]), "got compound"),
    "complex": (lambda f: _retype(f, "c8"), "got co"),
    "enumeration": (lambda f: _retype(f, "?"), "got enum"),
    "array type": (lambda f: _retype(f, "(2,)f4"), "got array"),
    "opaque": (lambda f: _retype(f, "V4"), "got opaque"),
    "integers": (lambda f: _replace(f, "u", data=np.zeros(f["u"].shape, "i4")), "got int32"),
    "half floats": (lambda f: _replace(f, "u", data=f["u"][:].astype("f2")), "got float16"),
    "long floats": (lambda f: _retype(f, "f16"), "u must be float32 or float64"),
    # Shapes
    "no u": (lambda f: f.pop("u"), "u is missing"),
    "no datasets": (lambda f: [f.pop(name) for name in list(f)], "t is missing"),
    "transposed": (
        lambda f: _replace(f, "u", data=np.transpose(f["u"][:])),
        "u must be [T, Y, X] = [12, 24, 20], got [20, 24, 12]: transpose it",
    ),
    "walls that move": (
        lambda f: f.create_dataset("wall_t", data=np.zeros(2)),
        "wall_t must not be there",
    ),
    "two dimensions": (lambda f: _replace(f, "u", data=f["u"][0]), "got float32 [24, 20]"),
    "four dimensions": (
        lambda f: _replace(f, "u", data=f["u"][:][None]),
        "got float32 [1, 12, 24, 20]",
    ),
    "other grid": (lambda f: _replace(f, "u", data=f["u"][:, :-1]), "give a value at every point"),
    "short surface": (
        lambda f: _replace(f, "surface_x", data=f["surface_x"][:-1]),
        "surface_x must be [n] = ",
    ),
    "half a surface": (lambda f: f.pop("surface_y"), "surface_y is missing"),
    # Attributes
    "other format": (
        lambda f: f.attrs.__setitem__("format_name", np.bytes_("other")),
        "must be 'granpinn-flow', got 'other'",
    ),
    "name as number": (
        lambda f: f.attrs.create("format_name", 1),
        "must be one text, got 1 numbers",
    ),
    "names": (
        lambda f: f.attrs.create("format_name", np.array([b"a", b"b"])),
        "format_name must be one text",
    ),
    "no name": (lambda f: f.attrs.pop("format_name"), "got None"),
    "newer version": (lambda f: f.attrs.create("format_version", 2), "format_version must be 1"),
    "no version": (lambda f: f.attrs.pop("format_version"), "got None"),
    "density as text": (lambda f: f.attrs.create("density", np.bytes_("2")), "density must be a n"),
    "density as reference": (
        lambda f: f.attrs.create("density", f["u"].ref, dtype=h5py.ref_dtype),
        "got reference",
    ),
    "empty density": (lambda f: f.attrs.create("density", h5py.Empty("f8")), "got no value"),
    "negative density": (lambda f: f.attrs.create("density", -2.0), "density must be from"),
    "two densities": (lambda f: f.attrs.create("density", [1.0, 2.0]), "density must be one"),
    "zero densities": (lambda f: f.attrs.create("density", np.empty(0)), "got 0: correct it"),
    "no grain diameter": (lambda f: f.attrs.pop("grain_diameter"), "grain_diameter is missing"),
    "no unit": (lambda f: f.attrs.pop("length_unit"), "length_unit is missing"),
    "unit in another encoding": (
        lambda f: f.attrs.create("length_unit", np.bytes_(b"\xb5m")),
        "length_unit must be one text, got text that is not UTF-8",
    ),
    "gravity in 3D": (
        lambda f: f.attrs.create("gravity", [0, 0, -1.0]),
        "gravity must be a list of 2",
    ),
    "sigma twice": (
        lambda f: (f.attrs.create("sigma_u", 1.0), f.create_dataset("sigma_u", data=f["c"][:])),
        "sigma_u must be either",
    ),
    # Values, as an instrument or a careless script leaves them
    "frames of NaN": (
        lambda f: [_set_values(f, name, slice(3, 5), np.nan) for name in "uv"],
        "only NaN in 2 of 12 frames",
    ),
    "infinity": (lambda f: _set_values(f, "u", (3, 0, 0), np.inf), "u must be from"),
    "no grains": (lambda f: _set_values(f, "c", ..., 0.5), "got at most 0.5: set c"),
    "time stands still": (lambda f: _set_values(f, "t", 3, f["t"][2]), "t must increase"),
}
