"""Damaged and hostile files of every format give either vectors or an error of one sentence."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from granpinn.importers import DataFileError, read_vectors
from granpinn.importers.series import FORMATS
from tests.importers.test_other_piv import davis, openpiv
from tests.importers.test_pivlab_text import export
from tests.importers.test_simulation_files import basilisk
from tests.importers.test_tracks import motion, write_csv


@pytest.mark.parametrize("kind", list(FORMATS))
@pytest.mark.parametrize("content", [b"", b"\0" * 100, b"hello world\n", b"\x89HDF\r\n\x1a\n"])
def test_something_else(tmp_path: Path, kind: str, content: bytes) -> None:
    (tmp_path / "a.bin").write_bytes(content)
    with pytest.raises(DataFileError):
        read_vectors(tmp_path / "a.bin", format=kind)


def pivlab(path: Path) -> Path:
    return export(path, newline="\n")


def tracks(path: Path) -> Path:
    return write_csv(path, motion())


def half(text: str) -> str:
    return text[: len(text) // 2]


def head(text: str) -> str:
    return text.split("\n")[0] + "\n"


# Writer, change of the text, and a part of the message.
WRONG: dict[str, tuple[Callable[[Path], Path], Callable[[str], str], str]] = {
    "pivlab cut off": (
        pivlab,
        lambda s: "\n".join(s.splitlines()[:-9]),
        "must hold a full grid of vectors, got 54 rows",
    ),
    "pivlab cut inside a line": (
        pivlab,
        lambda s: s[:-9],
        "5 cells in its last row",
    ),
    "pivlab of two frames": (
        pivlab,
        lambda s: s + "\n".join(s.splitlines()[3:]),
        "one vector at every point, got 63 points twice",
    ),
    "pivlab types": (
        pivlab,
        lambda s: s.replace(",2\n", ",7\n").replace(",1\n", ",7\n"),
        "vector type 0, 1, 2, 3, got 7",
    ),
    "pivlab letters": (
        pivlab,
        lambda s: s.replace("24,", "24;hello,", 1),
        "must have 5 cells in every row",
    ),
    "empty": (pivlab, lambda s: "", "is empty"),
    "blank": (pivlab, lambda s: "PIVlab, ASCII chart\n\n", "must have the columns x, y, u, v"),
    "binary": (pivlab, lambda s: "PIVlab\0\0\0", "must be text, got binary"),
    "openpiv flags": (
        openpiv,
        lambda s: s.replace("\t0\t0\n", "\t9\t0\n"),
        "must have the flags 0, 1, 2, got 9",
    ),
    "openpiv cut": (openpiv, half, "expected 6 cells|full grid"),
    "openpiv header alone": (openpiv, head, "no rows of numbers"),
    "davis cut": (
        davis,
        lambda s: "\n".join(s.split("\n")[:30]),
        "must hold 63 vectors as its header says, got 29",
    ),
    "davis head": (davis, lambda s: s.replace("2D-vector", "image"), "must begin with '#DaVis"),
    "basilisk names": (
        basilisk,
        lambda s: s.replace("5:u.x", "5:w"),
        "must have the columns u.x, got x, y, f, p, w, u.y",
    ),
    "basilisk columns": (
        basilisk,
        lambda s: s.replace(" 6:u.y", " 6:u.y 7:q"),
        "must have 7 cells in every row as in its header, at most 1000, got 6",
    ),
    "basilisk cut": (basilisk, half, "expected 6 cells|full grid"),
    "tracks that are not linked": (
        tracks,
        lambda s: s.replace("particle", "nothing"),
        "columns particle \\(or u, v\\)",
    ),
    "tracks cut off": (tracks, lambda s: s[:-20], "4 cells in its last row"),
    "tracks of text": (
        tracks,
        lambda s: s.replace("\n", "\n1,b,1,1\n", 1),
        "must have numbers in col",
    ),
    "tracks of commas": (
        tracks,
        lambda s: "frame,particle,x,y\n1,1,2,5,3,5\n",
        "a comma both between columns",
    ),
    "tracks without y": (
        tracks,
        lambda s: "# a\nframe,particle,x,z\n1,1,2,5\n",
        "must have the columns y, got frame, part",
    ),
    "tracks header alone": (tracks, head, "no rows of numbers"),
    "nothing measured": (
        tracks,
        lambda s: head(s) + ",,,\n,,,\n",
        "holds no particle with a position and a time",
    ),
}


@pytest.mark.parametrize(("write", "change", "message"), WRONG.values(), ids=WRONG.keys())
def test_wrong_text_is_refused(tmp_path: Path, write: Any, change: Any, message: str) -> None:
    path = write(tmp_path / "a.txt")
    path.write_text(change(path.read_text()))
    with pytest.raises(DataFileError, match=message) as caught:
        read_vectors(path, format="tracks" if write is tracks else "auto")
    assert "\n" not in str(caught.value)
