"""Damaged and hostile files of every format give either vectors or an error of one sentence."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.importers import DataFileError, read_vectors
from granpinn.importers.formats import FORMATS
from tests.importers.test_other_piv import davis, insight, openpiv
from tests.importers.test_pivlab_mat import all_frames, session, version_5, version_73
from tests.importers.test_pivlab_text import export
from tests.importers.test_simulation_files import ARRAYS, basilisk, dataset
from tests.importers.test_tracks import motion, write_csv

MUTANTS = 60


def npz(path: Path) -> Path:
    np.savez(path, **ARRAYS)
    return path


def netcdf(path: Path) -> Path:
    dataset().to_netcdf(path, engine="h5netcdf")
    return path


WRITERS: dict[str, tuple[str, str, Callable[[Path], Any]]] = {
    "pivlab": ("a.txt", "pivlab", export),
    "openpiv": ("a.txt", "openpiv", openpiv),
    "insight": ("a.vec", "insight", insight),
    "davis": ("a.txt", "davis", davis),
    "basilisk": ("a.txt", "basilisk", basilisk),
    "tracks": ("a.csv", "tracks", lambda path: write_csv(path, motion(tracks=4))),
    "mat 5": ("a.mat", "pivlab-mat", lambda path: version_5(path, all_frames())),
    "mat 7.3": ("a.mat", "pivlab-mat", lambda path: version_73(path, session())),
    "npz": ("a.npz", "npz", npz),
    "netcdf": ("a.nc", "netcdf", netcdf),
}


def mutants(content: bytes, rng: np.random.Generator) -> Any:
    """Cut off, with bytes changed, with a piece left out or repeated."""
    for _ in range(MUTANTS):
        damaged = bytearray(content)
        kind = rng.integers(4)
        at = int(rng.integers(len(damaged)))
        length = int(rng.integers(1, 40))
        if kind == 0:
            del damaged[at:]
        elif kind == 1:
            damaged[at : at + length] = rng.bytes(length)
        elif kind == 2:
            del damaged[at : at + length]
        else:
            damaged[at:at] = damaged[at : at + 10 * length]
        yield bytes(damaged)


# h5netcdf complains about its own half-open file when it is collected.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize(("name", "kind", "write"), WRITERS.values(), ids=WRITERS.keys())
def test_mutants(
    tmp_path: Path, seed: int, name: str, kind: str, write: Callable[[Path], Any]
) -> None:
    path = tmp_path / name
    write(path)
    content = path.read_bytes()
    rng = np.random.default_rng(seed)
    refused = 0
    for damaged in mutants(content, rng):
        path.write_bytes(damaged)
        message = ""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                fields = read_vectors(path, format=kind)
        except DataFileError as error:
            message = str(error)
        if message:
            refused += 1
            assert "\n" not in message
            continue
        gone = np.isin(fields.validity, (0, 3))
        assert np.isnan(fields.u[gone]).all()
        assert np.isfinite(fields.u[~gone]).all()
    assert refused > 0


@pytest.mark.parametrize("kind", [kind for kind in FORMATS if kind not in ("vc7", "mesh")])
@pytest.mark.parametrize("content", [b"", b"\0" * 100, b"hello world\n", b"\x89HDF\r\n\x1a\n"])
def test_something_else(tmp_path: Path, kind: str, content: bytes) -> None:
    (tmp_path / "a.bin").write_bytes(content)
    with pytest.raises(DataFileError):
        read_vectors(tmp_path / "a.bin", format=kind)
