"""A new check is one new file: it is made, judged, printed, drawn, written and read again."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import pytest

from granpinn import checks, identify, load
from granpinn.config import ConfigError
from granpinn.data import Flow
from granpinn.results import ResultsFileError, read_results
from granpinn.results.record import every
from tests.runs import tiny

FILE = '''
"""The largest predicted speed."""

from dataclasses import dataclass

import numpy as np

from granpinn.figures.style import Drawing, new_figure
from granpinn.results.record import CARE, Check, Reason, Record, Table


@dataclass(frozen=True)
class LargestSpeed(Record):
    title = "Largest speed"
    notes = "Of the network, at the points of the grid."

    speed: float

    @property
    def words(self):
        return f"no grain is faster than {self.speed:.3g}"

    @property
    def table(self):
        return Table(("", "speed"), [("largest", f"{self.speed:.4f}")])

    def reasons(self, result):
        return [Reason(CARE, "A test says so.")]

    def figures(self):
        return {"largest_speed": (self.title, lambda run: Drawing(new_figure(1.0), "Empty."))}


def make(context):
    values = context.predicted().values
    return LargestSpeed(float(np.hypot(values["u"], values["v"]).max()))


CHECK = Check("largest_speed", LargestSpeed, make, seconds=0.5, quick=False)
'''


@contextmanager
def added(room: ModuleType, name: str, text: str, folder: Path) -> Iterator[None]:
    """The file in the folder of the checks, as it were."""
    place = folder / "checks"
    place.mkdir()
    (place / f"{name}.py").write_text(text)
    room.__path__.append(str(place))
    every.cache_clear()
    yield
    room.__path__.remove(str(place))
    sys.modules.pop(f"{room.__name__}.{name}", None)
    every.cache_clear()


@pytest.fixture
def new_check(tmp_path: Path) -> Iterator[None]:
    with added(checks, "largest_speed", FILE, tmp_path):
        yield


def test_one_file_is_enough(
    new_check: None, flow: Flow, tmp_path: Path, figures: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert len(FILE.splitlines()) < 60
    folder = tmp_path / "run"
    result = identify(flow, tiny(checks="largest_speed"), run_dir=folder)
    assert list(result.checks) == ["largest_speed"]
    record = result.checks["largest_speed"]
    assert "A test says so." in result.assessment.reasons
    assert f"no grain is faster than {record.speed:.3g}" in result.summary()
    assert f"largest  {record.speed:.4f}" in result.summary()
    assert read_results(folder / "results.json").checks == load(folder).checks == result.checks
    monkeypatch.setattr("granpinn.figures.album.FIGURES", {})
    page = load(folder).report().read_text()
    assert "<h2>Largest speed</h2>" in page
    assert (folder / "figures" / "largest_speed.png").exists()


def test_a_check_that_is_not_there_is_refused(flow: Flow, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="checks must be words of none, quick, all, compar"):
        identify(flow, tiny(checks="largest_speed"))
    identify(flow, tiny(checks="none"), run_dir=tmp_path)
    path = tmp_path / "results.json"
    path.write_text(path.read_text().replace('"checks": {}', '"checks": {"os": {}}'))
    with pytest.raises(ResultsFileError, match="checks.os is not known; expected comparison"):
        read_results(path)


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({}, {"momentum_balance"}),
        ({"checks": "none"}, set()),
        ({"checks": "none", "free_I0": True}, {"unknown_I0"}),
        ({"checks": "unknown_I0"}, {"unknown_I0"}),
    ],
)
def test_the_settings_say_which_checks_are_made(
    settings: dict[str, object], expected: set[str]
) -> None:
    assert {check.name for check in checks.wanted(tiny(**settings))} == expected
