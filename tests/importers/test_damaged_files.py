"""Damaged and hostile files of every format give either vectors or an error of one sentence."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.importers import DataFileError, read_vectors
from granpinn.importers.formats import FORMATS
from tests.importers.test_simulation_files import ARRAYS

MUTANTS = 60


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


def test_mutants_of_arrays(tmp_path: Path, seed: int) -> None:
    """The other formats are damaged in test_mutated_text.py and test_container_mutants.py."""
    path = tmp_path / "a.npz"
    np.savez(path, **ARRAYS)
    content = path.read_bytes()
    rng = np.random.default_rng(seed)
    refused = 0
    for damaged in mutants(content, rng):
        path.write_bytes(damaged)
        message = ""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                fields = read_vectors(path, format="npz")
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
