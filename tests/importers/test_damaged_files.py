"""Damaged and hostile files of every format give either vectors or an error of one sentence."""

from __future__ import annotations

from pathlib import Path

import pytest

from granpinn.importers import DataFileError, read_vectors
from granpinn.importers.formats import FORMATS


@pytest.mark.parametrize("kind", [kind for kind in FORMATS if kind not in ("vc7", "mesh")])
@pytest.mark.parametrize("content", [b"", b"\0" * 100, b"hello world\n", b"\x89HDF\r\n\x1a\n"])
def test_something_else(tmp_path: Path, kind: str, content: bytes) -> None:
    (tmp_path / "a.bin").write_bytes(content)
    with pytest.raises(DataFileError):
        read_vectors(tmp_path / "a.bin", format=kind)
