"""Vectors are placed by their coordinates: rows in any order give one flow, or a question."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.importers import DataFileError, read, read_vectors
from tests.importers import scene
from tests.importers.fuzz_text import CASES, MATERIAL, Case
from tests.importers.test_pivlab_text import export
from tests.importers.test_tracks import motion, write_csv


def same(one: Any, other: Any) -> None:
    """Two flows with equal bits."""
    for name in ("t", "y", "x", "u", "v", "c"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), name)
    for part in ("particles", "surface"):
        first, second = getattr(one, part), getattr(other, part)
        assert (first is None) == (second is None)
        for name, values in vars(first).items() if first else ():
            if values is not None and part == "surface":  # its points keep their order
                np.testing.assert_array_equal(np.sort(values), np.sort(getattr(second, name)))
            elif values is not None:
                np.testing.assert_array_equal(values, getattr(second, name), name)


def flow_of(case: Case, folder: Path, changes: dict[str, Any]) -> Any:
    files = sorted(p for p in folder.iterdir() if not case.setting or p.name != case.name)
    given = {case.setting: str(folder / case.name)} if case.setting else {}
    material = {} if "dimensionless" in case.settings else MATERIAL
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return read(files, **material, **(case.settings | given | changes))


HEADERS = {"pivlab": 3, "pivlab bare": 0}


@pytest.mark.parametrize("kind", ["shuffled", "reversed", "sorted by y"])
@pytest.mark.parametrize("name", [name for name in CASES if name != "times"])
def test_the_order_of_rows_does_not_matter(tmp_path: Path, name: str, kind: str) -> None:
    """Either the flow has equal bits, or the direction of y must be given, and then it has."""
    case = CASES[name]
    path = tmp_path / case.name
    case.write(path)
    if case.other:
        case.other(tmp_path)
    up = {"flip_y": "yes"} if "flip_y" not in case.settings else {}
    images = name in ("pivlab", "pivlab bare", "openpiv", "insight", "surface")
    up = up if images and name != "insight" else {}
    expected = flow_of(case, tmp_path, up)
    rows = path.read_text().splitlines()
    head, rows = rows[: HEADERS.get(name, 1)], rows[HEADERS.get(name, 1) :]
    rows = [row for row in rows if row]
    order = np.random.default_rng(5).permutation(len(rows))
    if kind == "reversed":
        order = np.arange(len(rows))[::-1]
    elif kind == "sorted by y":
        order = np.argsort(rows, kind="stable")[::-1]
    scene.write_lines(path, [*head, *(rows[i] for i in order)])
    if name in ("pivlab", "pivlab bare", "openpiv", "insight"):
        with pytest.raises(DataFileError, match="flip_y yes or no"):
            flow_of(case, tmp_path, {})
    if name == "insight":
        up = {"flip_y": "no"}
    same(flow_of(case, tmp_path, up), expected)


def test_calibrated_rows_in_another_order_ask_for_the_direction(tmp_path: Path) -> None:
    """Lengths in meters say nothing of the direction either."""
    files = [export(tmp_path / f"a{k}.txt", k, view=scene.METERS) for k in range(3)]
    settings = {"frame_rate": "500 Hz", **MATERIAL}
    expected = read(files, **settings)
    rows = files[0].read_text().splitlines()
    scene.write_lines(files[0], [*rows[:3], *reversed(rows[3:])])
    with pytest.raises(DataFileError, match="flip_y yes or no"):
        read(files, **settings)
    same(read(files, flip_y="yes", **settings), expected)


def test_tracks_in_any_order_are_one_flow(tmp_path: Path) -> None:
    columns = motion(0.05, tracks=20)
    order = np.random.default_rng(2).permutation(columns["x"].size)
    one = read_vectors(write_csv(tmp_path / "a.csv", columns))
    shuffled = {name: values[order] for name, values in columns.items()}
    other = read_vectors(write_csv(tmp_path / "b.csv", shuffled))
    for name in ("t", "x", "y", "u", "v", "sigma_u", "sigma_v"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
