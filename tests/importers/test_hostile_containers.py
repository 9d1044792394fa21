"""Attacks on flow files, MATLAB 7.3 and fields.h5: refused, no file is opened."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from granpinn.data import FlowFileError, read_flow, write_flow
from granpinn.data.flow_file import read_hdf5
from granpinn.importers import DataFileError, read_vectors
from granpinn.regular import UnsafeFileError
from granpinn.results import FieldsFileError, read_fields, write_fields
from tests.data.hostile_containers import ATTACKS, make_outside
from tests.flows import make_flow
from tests.importers.test_pivlab_mat import all_frames, one_frame, version_73
from tests.opened import watched
from tests.results.test_fields import full


def matlab(path: Path) -> Path:
    return version_73(path, one_frame())


def cells(path: Path) -> Path:
    return version_73(path, all_frames())


def fields(path: Path) -> Path:
    write_fields(full(), path)
    return path


def flow(path: Path) -> Path:
    write_flow(make_flow(), path)
    return path


Read = Callable[[Path], Any]

# Maker, dataset to attack, reader.
CONTAINERS: dict[str, tuple[str, Callable[[Path], Path], str, Read]] = {
    "matlab": ("a.mat", matlab, "u", lambda p: read_vectors(p, "pivlab-mat")),
    "cell": ("a.mat", cells, "#refs#/u_filtered0", lambda p: read_vectors(p, "pivlab-mat")),
    "fields": ("fields.h5", fields, "u", read_fields),
    "flow": ("flow.h5", flow, "u", read_flow),
}


ERRORS = DataFileError, FieldsFileError, FlowFileError

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
        with pytest.raises(
            (DataFileError, FieldsFileError, FlowFileError), match=message
        ) as caught:
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
    monkeypatch.setattr("granpinn.foreign.process.LEAST_BYTES", 2**20)
    monkeypatch.setattr("granpinn.foreign.process.BYTES_PER_BYTE", 1)
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        big = file.create_dataset("#refs#/a", data=np.zeros((100, 100)), compression="gzip")
        for name in ("x", "y", "u_original", "v_original"):
            file[name] = np.full((1, 1000), big.ref, h5py.ref_dtype)
    with pytest.raises(DataFileError, match="must hold at most 0.000977 GiB of data"):
        read_vectors(tmp_path / "a.mat", "pivlab-mat")


def test_damaged_text_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bytes of a variable-length attribute and its heap: HDF5 runs without end for some, allocates
    4 GiB for others, and crashes."""
    monkeypatch.setattr("granpinn.foreign.process.SECONDS", 1.0)
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["u"] = np.zeros(3)
        file["u"].attrs["units"] = "m/s"
    content = path.read_bytes()
    at, heap = content.index(b"units\0"), content.index(b"GCOL")
    refused = 0
    for place in (*range(at - 16, at + 64, 9), *range(heap, heap + 64, 9)):
        for value in (0, 127, 255):
            damaged = bytearray(content)
            damaged[place] = value
            path.write_bytes(damaged)
            try:
                found = read_hdf5(path, ["u"], 2**20, "")
            except UnsafeFileError:
                refused += 1
                continue
            assert len(str(found.datasets["u"].attributes)) < 5000
    assert refused > 3


@pytest.mark.parametrize("compression", [None, "gzip"])
def test_a_checksum_that_differs_is_refused(tmp_path: Path, compression: str | None) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        made = file.create_dataset("a", data=np.ones(9), compression=compression, fletcher32=True)
        mask, content = made.id.read_direct_chunk((0,))
        damaged = content[:-1] + bytes([content[-1] ^ 1])
        made.id.write_direct_chunk((0,), damaged, mask)
    with pytest.raises(UnsafeFileError, match="cannot be read by h5py|must have chunks of"):
        read_hdf5(path, ["a"], 2**20, "")
