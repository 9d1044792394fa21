"""LaVision's .vc7, through frames as lvpyio gives them."""

from __future__ import annotations

import os
import sys
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from granpinn.importers import DataFileError, Validity, read_vectors
from granpinn.importers import davis as davis_reader


def test_vc7_without_lvpyio(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "lvpyio", None)
    (tmp_path / "B1.vc7").write_bytes(bytes(64))
    with pytest.raises(DataFileError, match="needs LaVision's package lvpyio: pip install"):
        read_vectors(tmp_path / "B1.vc7")


class Component(list):  # type: ignore[type-arg]
    """Planes of a component with the scale of its values."""

    scale = type("Scale", (), {"slope": 0.5})


def frame(choice: Any, y_unit: str = "mm", **others: Any) -> Any:
    """What lvpyio gives of a vector field of 2 x 3."""
    from types import SimpleNamespace as Space

    shape = (2, 3)
    values = np.arange(1.0, 7).reshape(shape)
    enabled = np.array([[1, 1, 0], [1, 1, 1]])
    masks = np.array([[1, 1, 1], [1, 1, 0]], bool)
    record = np.ma.zeros(shape, dtype=[("u", "f8"), ("v", "f8")])
    record["u"], record["v"] = values, -values
    record.mask = (
        np.broadcast_to((~(enabled & masks).astype(bool))[..., None], (2, 3, 2))
        .copy()
        .view([("u", "?"), ("v", "?")])[..., 0]
    )
    plane = Space(slope=-0.1, offset=10.0, unit=y_unit)
    return Space(
        as_masked_array=lambda: record,
        scales=Space(
            x=Space(slope=0.1, offset=0.0, unit="mm"), y=plane, i=Space(unit="m/s", slope=0.5)
        ),
        grid=Space(x=16, y=16),
        shape=shape,
        enabled=[enabled],
        masks=[masks],
        active_choice=[np.asarray(choice)],
        components={"U0": None, **others},
        attributes={"FrameDt": "300 us", "AcqTimeSeries": "1500 µs"},
    )


def use(library: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Reads with a library instead of lvpyio, in this process."""
    monkeypatch.setitem(sys.modules, "lvpyio", library)
    reader = import_module("granpinn.foreign.davis")
    monkeypatch.setattr(reader, "lvpyio", library)
    answer = SimpleNamespace(keep=lambda values: values)
    monkeypatch.setattr(davis_reader, "installed", lambda name: True)

    def read_file(name: str, path: Path, least_bytes: int) -> Any:
        assert least_bytes <= 2**28  # damaged sizes in a small file take no more memory
        return reader.read(path, answer)

    monkeypatch.setattr(davis_reader, "read_file", read_file)


def test_vc7_choices(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Choice 4 is filled in, unless all vectors are: then the field was smoothed."""
    from types import SimpleNamespace as Space

    filled = [[0, 4, 0], [0, 1, 0]]
    sigma = Component([np.array([[1.0, 1, 1], [0, 1, 1]])])
    given = {"TS:Uncertainty Vx": sigma, "TS:Uncertainty Vy": sigma}
    path = tmp_path / "B1.vc7"
    path.write_bytes(bytes(64))
    frames = iter([frame(filled, **given), frame(np.full((2, 3), 4))])
    library = Space(read_buffer=lambda name: [next(frames)])
    use(library, monkeypatch)
    fields = read_vectors(path)
    V, M, N, I = Validity.VALID, Validity.MASKED, Validity.INVALID, Validity.INTERPOLATED
    np.testing.assert_array_equal(fields.validity[0], [[V, V, M], [V, I, N]])
    np.testing.assert_allclose(fields.u[0], [[4, 5, np.nan], [1, 2, np.nan]])
    np.testing.assert_allclose(fields.y, [10 - 2.4, 10 - 0.8])
    np.testing.assert_allclose(fields.sigma_u[0], [[np.nan, 0.5, 0.5], [0.5, 0.5, 0.5]])
    assert fields.t == pytest.approx([1.5e-3])
    smoothed = read_vectors(path)
    assert smoothed.count(Validity.INTERPOLATED) == 0
    assert smoothed.facts["smoothed"] == "yes"


@pytest.fixture
def vc7(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Reads the frames of a buffer as if lvpyio had found them."""
    path = tmp_path / "B1.vc7"
    path.write_bytes(bytes(64))

    def read(*frames: Any) -> Any:
        use(SimpleNamespace(read_buffer=lambda name: frames), monkeypatch)
        return read_vectors(path)

    return read


def test_vc7_has_one_unit_of_a_kind(vc7: Any) -> None:
    sigma = Component([np.ones((2, 3))])
    sigma.scale = type("Scale", (), {"slope": 1.0, "unit": "mm/s"})
    given = {"TS:Uncertainty Vx": sigma, "TS:Uncertainty Vy": sigma}
    with pytest.raises(DataFileError, match="velocity unit in all columns, got u in m/s and sigma"):
        vc7(frame(np.zeros((2, 3)), **given))
    with pytest.raises(DataFileError, match="length unit in all columns, got x in mm and y in m"):
        vc7(frame(np.zeros((2, 3)), "m"))


def test_vc7_takes_no_first_of_several(vc7: Any) -> None:
    one = frame(np.zeros((2, 3)))
    with pytest.raises(ValueError, match="a buffer holds 2 frames"):
        vc7(one, one)


def test_devices_and_pipes(tmp_path: Path) -> None:
    pipe, link = tmp_path / "a.vc7", tmp_path / "b.vc7"
    os.mkfifo(pipe)
    link.symlink_to("/dev/zero")
    for path in (pipe, link):
        with pytest.raises(DataFileError, match="no regular file|needs LaVision's package"):
            davis_reader.read_vc7(path)
        with pytest.raises(DataFileError, match="must be a file, got a device, a pipe"):
            read_vectors(path)
