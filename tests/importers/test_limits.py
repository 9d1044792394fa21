"""Numbers and sizes: what a file or an option says is checked before it is believed."""

from __future__ import annotations

import io
import os
import resource
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.importers import (
    DataFileError,
    read,
    read_vectors,
    units,
)
from granpinn.importers.columns import HEAD, MAX_COLUMNS, head_of
from tests.importers import scene
from tests.importers.forms.physical import SETTINGS
from tests.importers.test_other_piv import davis, openpiv
from tests.importers.test_pivlab_text import export
from tests.importers.test_simulation_files import ARRAYS
from tests.importers.test_surface import arrays

DIGITS = "9" * 5000
PLAIN: dict[str, Any] = {"dimensionless": True, "grain_diameter": "0.1"}


@pytest.mark.parametrize("text", ["1_0", "٣", "1e400", "-1e999", DIGITS, "", "0x10", "1" * 65])
def test_one_parser_for_all_numbers_of_options(text: str) -> None:
    with pytest.raises(DataFileError, match="the place must be a finite number"):
        units.number(text, "the place")
    with pytest.raises(DataFileError, match="the place must be"):
        units.whole(f"{text}.5", "the place")


def replaced(write: Callable[..., Any], old: str, new: str, name: str = "a.txt") -> Any:
    def make(folder: Path) -> Path:
        path = Path(write(folder / name))
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new, 1))
        return path

    return make


def lines(*content: str) -> Callable[[Path], Path]:
    return lambda folder: scene.write_lines(folder / "a.csv", list(content))


TRACKS = "frame,particle,x,y"
WRONG: dict[str, tuple[Callable[[Path], Path], str]] = {
    "frame of 5,000 digits": (replaced(export, "FRAME: 1", f"FRAME: {DIGITS}"), "FRAME must be"),
    "grid of 5,000 digits": (replaced(davis, " 32 9 7 ", f" 32 {DIGITS} 7 "), "columns must be"),
    "cell of 5,000 digits": (
        replaced(openpiv, "16\t24", f"{DIGITS}\t24"),
        "got '9{64}' in row 1",
    ),
    "number beyond float64": (
        replaced(openpiv, "16\t24", "16\t1e400"),
        "a finite y of at most 1e",
    ),
    "underscore": (replaced(openpiv, "16\t24", "1_6\t24"), "numbers in column 1, got '1_6'"),
    "place of 1e300": (replaced(openpiv, "16\t24", "1e300\t24"), "finite x of at most 1e"),
    "long csv cell": (
        lines(TRACKS + ",note", '1,1,1,1,"' + "a" * 140_000 + '"'),
        f"lines of at most {HEAD} bytes",
    ),
    "long line": (lines(TRACKS, "1," * 2**20), f"lines of at most {HEAD} bytes"),
    "long header": (lines("x,y,frame," + "a" * HEAD), f"lines of at most {HEAD} bytes"),
    "no line end": (lines("1" * 3_000_000), "lines of at most"),
    "columns": (lines("x,y,frame," + "a," * 2000, "1"), f"at most {MAX_COLUMNS}, got 1"),
    "zero byte": (lines(TRACKS, "1,1,1,1", "2,1,\0,1"), "must be text, got binary data"),
    "huge place": (lines(TRACKS, "1,1,1,1e300", "2,1,1,1"), "a finite y of at most 1e"),
    "one time in a track": (
        lines(TRACKS + ",t", *(f"{k},1,{k},{k},5" for k in range(5))),
        "another time in every frame",
    ),
}


@pytest.mark.parametrize(("make", "message"), WRONG.values(), ids=WRONG.keys())
def test_hostile_text_is_one_sentence(
    tmp_path: Path, make: Callable[[Path], Path], message: str
) -> None:
    path = make(tmp_path)
    kind = "tracks" if path.suffix == ".csv" else "auto"
    with pytest.raises(DataFileError, match=message) as caught:
        read_vectors(path, format=kind)
    assert len(str(caught.value)) <= 600
    assert str(caught.value).isprintable()


def test_devices_and_pipes_are_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.txt")
    for path in (tmp_path / "pipe.txt", Path("/dev/zero")):
        with pytest.raises(DataFileError, match="must be a file, got a device, a pipe"):
            read_vectors(path)
        with pytest.raises(DataFileError, match="this is no regular file"):
            head_of(path)


def npz(path: Path, **changes: Any) -> Path:
    np.savez(path, **(ARRAYS | changes))
    return path


def npz_with(path: Path, name: str, header: str, data: bytes) -> Path:
    """An archive whose member `name` has a header of its own."""
    npz(path)
    content = io.BytesIO()
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as new:
        for member in old.namelist():
            body = old.read(member)
            if member == f"{name}.npy":
                text = header.encode().ljust(118) + b"\n"
                body = b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + data
            new.writestr(member, body)
    path.write_bytes(content.getvalue())
    return path


SHAPE = "{{'descr': '{}', 'fortran_order': False, 'shape': ({}), }}"
ARCHIVES: dict[str, tuple[Callable[[Path], Path], str]] = {
    "no frames": (
        lambda p: npz(p, t=[], **{n: np.ones((0, 7, 9)) for n in "uvcp"}),
        "at least one vector|at least two",
    ),
    "declares more than it has": (
        lambda p: npz_with(p, "u", SHAPE.format("<f8", "1000000000000,"), b"\0" * 8),
        "its arrays need more than",
    ),
    "int8 that grows": (
        lambda p: npz_with(p, "u", SHAPE.format("|i1", "2000000000,"), b""),
        "its arrays need more than",
    ),
    "negative": (lambda p: npz_with(p, "u", SHAPE.format("<f8", "-1,"), b""), "cannot be read"),
    "objects": (
        lambda p: npz_with(p, "u", SHAPE.format("|O", "1,"), b"\0" * 8),
        "Object arrays cannot be loaded",
    ),
    "deep header": (lambda p: npz_with(p, "u", "(" * 60_000, b""), "cannot be read by numpy"),
    "minus signs": (lambda p: npz_with(p, "u", "-" * 4000 + "1", b""), "cannot be read by numpy"),
    "text": (lambda p: npz(p, u=np.full((1, 2), "a")), "u must hold numbers"),
    "complex": (lambda p: npz(p, u=1j * np.ones((3, 7, 9))), "must hold plain numbers"),
    "long unit": (lambda p: npz(p, length_unit="m" * 60_000), "cannot be read|must be a unit such"),
}


@pytest.mark.parametrize(("make", "message"), ARCHIVES.values(), ids=ARCHIVES.keys())
def test_hostile_npz_is_one_sentence(
    tmp_path: Path, make: Callable[[Path], Path], message: str
) -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(DataFileError, match=message):
        read_vectors(make(tmp_path / "a.npz"))
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000  # kB


def test_the_limit_of_the_address_space_counts() -> None:
    code = (
        "import resource; from granpinn.data import large; "
        "n = large.address_space() + 2**27; resource.setrlimit(resource.RLIMIT_AS, (n, n)); "
        "assert 0 < large.available() <= 2**27"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("value", [-0.1, np.inf])
def test_standard_deviations_that_are_none_are_refused(value: float) -> None:
    sigma = np.full(arrays()["u"].shape, 0.1)
    wrong = sigma.copy()
    wrong[0, 0, 0] = value
    expected = f"sigma_v must be positive, and NaN where it is not known, got {value} at 1 vectors"
    with pytest.raises(DataFileError, match=expected):
        read(arrays(sigma_u=sigma, sigma_v=wrong), **PLAIN)


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("scale", "1e300 m/px"),
        ("scale", "1e-310 mm/px"),
        ("frame_rate", "1e-320 Hz"),
        ("grain_diameter", "1e40 m"),
        ("grain_diameter", "1e999**1e999 m"),
        ("gravity", "1e60 m/s^2"),
        ("sigma", "1e200 px/frame"),
        ("window", "1e200 px"),
        ("origin", "1_0,3"),
        ("frames", f"0:{DIGITS}"),
    ],
)
def test_hostile_settings_are_one_sentence(tmp_path: Path, setting: str, value: str) -> None:
    files = [export(tmp_path / f"a{k}.txt", k) for k in range(3)]
    given = {**SETTINGS, setting: value}
    with pytest.raises(DataFileError, match=setting) as caught:
        read(files, **given)
    assert len(str(caught.value)) <= 600
