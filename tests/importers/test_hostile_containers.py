"""Attacks on MATLAB 7.3, netCDF4, tracks in HDF5 and fields.h5: refused, and no file is opened."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from granpinn.data.hdf5 import open_hdf5
from granpinn.data.hdf5.chunks import fletcher32
from granpinn.data.reader import is_flow_file
from granpinn.importers import DataFileError, read_vectors
from granpinn.importers.formats import detect
from granpinn.regular import UnsafeFileError
from granpinn.results import FieldsFileError, read_fields, write_fields
from tests.data.hostile_containers import ATTACKS, make_outside
from tests.importers.test_pivlab_mat import all_frames, one_frame, version_73
from tests.importers.test_simulation_files import dataset
from tests.opened import watched
from tests.results.test_fields import full


def matlab(path: Path) -> Path:
    return version_73(path, one_frame())


def cells(path: Path) -> Path:
    return version_73(path, all_frames())


def netcdf(path: Path) -> Path:
    dataset().to_netcdf(path, engine="h5netcdf")
    return path


def tracks(path: Path) -> Path:
    kind = [("index", "i8"), ("x", "f8"), ("y", "f8"), ("frame", "i8"), ("u", "f8"), ("v", "f8")]
    with h5py.File(path, "w") as file:
        file["Frame_0/table"] = np.zeros(6, kind)
    return path


def fields(path: Path) -> Path:
    write_fields(full(), path)
    return path


Read = Callable[[Path], Any]
# Maker, dataset to attack, reader.
CONTAINERS: dict[str, tuple[str, Callable[[Path], Path], str, Read]] = {
    "matlab": ("a.mat", matlab, "u", lambda p: read_vectors(p, "pivlab-mat")),
    "cell": ("a.mat", cells, "#refs#/u_filtered0", lambda p: read_vectors(p, "pivlab-mat")),
    "netcdf": ("a.nc", netcdf, "u", lambda p: read_vectors(p, "netcdf")),
    "tracks": ("a.h5", tracks, "Frame_0/table", lambda p: read_vectors(p, "tracks")),
    "fields": ("fields.h5", fields, "u", read_fields),
}


@pytest.mark.parametrize("container", CONTAINERS)
def test_the_files_are_valid(tmp_path: Path, container: str) -> None:
    name, write, _, read = CONTAINERS[container]
    read(write(tmp_path / name))


# A reference names an object, so no link lies on the way to it.
CASES = [
    (container, attack)
    for container in CONTAINERS
    for attack in ATTACKS
    if container != "cell" or "link" not in attack
]


@pytest.mark.parametrize(("container", "attack"), CASES)
def test_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, container: str, attack: str
) -> None:
    name, write, target, read = CONTAINERS[container]
    path = write(tmp_path / name)
    change, message = ATTACKS[attack]
    with h5py.File(path, "r+") as file:
        outside = make_outside(tmp_path, file[target])
        change(file, target)
        if container == "cell":
            references = file["u_filtered"][()]
            references.flat[0] = file[target].ref
            file["u_filtered"][...] = references
    monkeypatch.chdir(tmp_path)  # external storage is looked up from here
    with watched(outside) as opened:
        with pytest.raises((DataFileError, FieldsFileError), match=message) as caught:
            read(path)
        assert not opened()
    assert "\n" not in str(caught.value)


def test_a_careless_reader_would_open_the_other_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = matlab(tmp_path / "a.mat")
    monkeypatch.chdir(tmp_path)
    for attack in ("virtual dataset", "external storage", "external link"):
        with h5py.File(path, "r+") as file:
            outside = make_outside(tmp_path, file["v"])
            ATTACKS[attack][0](file, "u")
        with watched(outside) as opened, h5py.File(path) as file:
            assert file["u"][()] is not None
            assert opened()


def test_one_matrix_named_by_a_thousand_cells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The bytes that are read count, not those of the file."""
    monkeypatch.setattr("granpinn.importers.matlab.MAX_BYTES", 2**20)
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        big = file.create_dataset("#refs#/a", data=np.zeros((100, 100)), compression="gzip")
        for name in ("x", "y", "u_original", "v_original"):
            file[name] = np.full((1, 1000), big.ref, h5py.ref_dtype)
    with pytest.raises(DataFileError, match="must hold at most 0.000977 GiB of data"):
        read_vectors(tmp_path / "a.mat", "pivlab-mat")


def _text_file(path: Path, **options: Any) -> h5py.File:
    file = h5py.File(path, "w", **options)
    file["u"] = np.zeros(3)
    return file


@pytest.mark.parametrize("count", [1, 9, 60, 200])
@pytest.mark.parametrize("library", ["earliest", "latest"])
@pytest.mark.parametrize("block", [0, 1024])
def test_variable_length_text_is_that_of_hdf5(
    tmp_path: Path, count: int, library: str, block: int
) -> None:
    """In object headers of both versions, and in the heap of an object with many attributes."""
    path = tmp_path / "a.h5"
    options = {"libver": library, "userblock_size": block or None, "track_order": bool(block)}
    with _text_file(path, **options) as file:
        for place in (file, file["u"]):
            for i in range(count):
                place.attrs[f"text{i}"] = "é" * (i % 5) + f"value {i}" * (i % 9)
            place.attrs["text0"] = "again"  # the old text is left in the file
        expected = {name: file["u"].attrs[name] for name in file["u"].attrs}
    with open_hdf5(path, 2**20) as safe:
        opened = safe.open_dataset("u")
        assert opened is not None
        for attributes in (opened.attributes, safe.attributes):
            assert {name: attributes.any_text(name) for name in expected} == expected


def test_damaged_text_is_refused_at_once(tmp_path: Path) -> None:
    """Every byte around a variable-length attribute and its heap: HDF5 runs without end for some,
    allocates 4 GiB for others, and crashes."""
    path = tmp_path / "a.h5"
    with _text_file(path) as file:
        file["u"].attrs["units"] = "m/s"
    content = path.read_bytes()
    at, heap = content.index(b"units\0"), content.index(b"GCOL")
    for place in (*range(at - 16, at + 64), *range(heap, heap + 64)):
        for value in (0, 1, 127, 255):
            damaged = bytearray(content)
            damaged[place] = value
            path.write_bytes(damaged)
            try:
                with open_hdf5(path, 2**20) as safe:
                    opened = safe.open_dataset("u")
                    text = opened.attributes.any_text("units") if opened else None
            except UnsafeFileError:
                continue
            assert text is None or len(text) < 5000


def test_is_flow_file_reads_no_variable_text(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.attrs["format_name"] = "granpinn-flow"
    content = bytearray(path.read_bytes())
    heap = content.index(b"GCOL")
    content[heap + 24 : heap + 32] = b"\xf0" + b"\xff" * 7
    path.write_bytes(content)
    assert not is_flow_file(path)
    with pytest.raises(DataFileError, match="of no known format"):
        detect(path)


@pytest.mark.parametrize("size", [0, 1, 2, 3, 1000, 100_001])
def test_checksums_are_those_of_hdf5(tmp_path: Path, size: int, seed: int) -> None:
    data = np.random.default_rng(seed).integers(0, 256, size, np.uint8)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        chunks = (size,) if size else (1,)
        made = file.create_dataset("a", data=data, chunks=chunks, maxshape=(None,), fletcher32=True)
        if size:
            _, raw = made.id.read_direct_chunk((0,))
            assert fletcher32(raw[:-4]) == int.from_bytes(raw[-4:], "little")
    with open_hdf5(tmp_path / "a.h5", 2**20) as safe:
        opened = safe.open_dataset("a")
        assert opened is not None
        np.testing.assert_array_equal(opened.read(), data)


KINDS = ("<f4", ">f8", "<f2", "<i2", ">u4", "|u1", "<i8")
STORAGE: dict[str, dict[str, Any]] = {
    "contiguous": {},
    "chunks": {"chunks": (3, 5, 2)},
    "gzip": {"compression": "gzip", "chunks": (7, 11, 5)},
    "all filters": {"compression": "gzip", "shuffle": True, "fletcher32": True},
    "can grow": {"chunks": (3, 5, 2), "shuffle": True, "maxshape": (None,) * 3},
}


@pytest.mark.parametrize("storage", STORAGE)
def test_numbers_are_those_of_hdf5(tmp_path: Path, storage: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for kind in KINDS:
            values = (100 * rng.random((7, 11, 5))).astype(kind)
            file.create_dataset(kind, data=values, **STORAGE[storage])
    with open_hdf5(tmp_path / "a.h5", 2**20) as safe, h5py.File(tmp_path / "a.h5") as file:
        for kind in KINDS:
            opened = safe.open_dataset(kind)
            assert opened is not None
            assert opened.read().dtype == file[kind].dtype
            for wanted in (kind, "f4", "f8"):
                expected = np.empty(file[kind].shape, wanted)
                file[kind].read_direct(expected)
                np.testing.assert_array_equal(opened.read(wanted), expected)


FILTERS = {
    "gzip": lambda plan: plan.set_deflate(3),
    "shuffle": lambda plan: plan.set_shuffle(),
    "fletcher32": lambda plan: plan.set_fletcher32(),
}


@pytest.mark.parametrize(
    "order",
    [(), ("fletcher32",), ("shuffle", "gzip", "fletcher32"), ("shuffle", "fletcher32", "gzip")],
)
@pytest.mark.parametrize("userblock", [0, 512])
def test_filters_in_both_orders_behind_a_user_block(
    tmp_path: Path, order: tuple[str, ...], userblock: int
) -> None:
    values = np.random.default_rng(1).normal(size=(7, 11))
    with h5py.File(tmp_path / "a.h5", "w", userblock_size=userblock) as file:
        plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plan.set_chunk((3, 5))
        for name in order:
            FILTERS[name](plan)
        space = h5py.h5s.create_simple(values.shape)
        made = h5py.h5d.create(file.id, b"a", h5py.h5t.IEEE_F64LE, space, plan)
        made.write(h5py.h5s.ALL, h5py.h5s.ALL, values)
    with open_hdf5(tmp_path / "a.h5", 2**20) as safe:
        opened = safe.open_dataset("a")
        assert opened is not None
        np.testing.assert_array_equal(opened.read(), values)
