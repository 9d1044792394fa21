"""Figures that are drawn while the pressure is simulated, before the page."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.figures import album
from granpinn.report import film as films
from granpinn.report import page as pages
from granpinn.report import painters as processes
from granpinn.report.early import draw
from granpinn.results import Fields, read_fields, read_results, write_results
from granpinn.results import fields as fields_file
from tests.page import Page

OF_CHECKS = ["pressure_simulated"]


def test_figures_drawn_before_the_simulated_pressure_are_those_of_the_page(
    built: Path, run_dir: Path, figures: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> None:
        raise AssertionError("the film was made again")

    figures("friction_law", "pressure")
    whole = read_results(run_dir / "results.json")
    assert whole.simulated_pressure is not None
    write_results(replace(whole, simulated_pressure=None), run_dir / "results.json")
    early = draw(run_dir)
    monkeypatch.setattr(films, "film_of", refused)
    drawn = early.pictures
    assert [p.path.stem for p in drawn] == ["friction_law", "pressure"]
    write_results(whole, run_dir / "results.json")
    before = {p.path: p.path.stat().st_mtime_ns for p in drawn}
    page = pages.build(run_dir, prepared=early).read_text(encoding="utf-8")
    assert {path: path.stat().st_mtime_ns for path in before} == before
    for name in ("friction_law", "pressure", "pressure_simulated"):
        found, expected = (folder / "figures" / f"{name}.png" for folder in (run_dir, built))
        assert found.read_bytes() == expected.read_bytes()
    narrow = Page((built / "report.html").read_text(encoding="utf-8")).values("source", "srcset")
    assert set(Page(page).values("source", "srcset")) <= set(narrow)
    assert early.film is not None
    for sheet in early.film.sheets:
        assert sheet.png in page
        assert sheet.png in (built / "report.html").read_text(encoding="utf-8")


def test_the_page_reads_what_is_new_in_the_fields(
    run_dir: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, real, names = read_fields(run_dir / "fields.h5"), fields_file._on_grid, []

    def noted(file: Any, name: str, shape: tuple[int, int, int]) -> Any:
        names.append(name)
        return real(file, name, shape)

    monkeypatch.setattr(fields_file, "_on_grid", noted)
    before = {name: v for name, v in whole.values.items() if name != "p_simulated"}
    found = pages.read(run_dir, known=replace(whole, values=before))[0].fields
    assert names == ["p_simulated"]
    assert found is not None
    assert list(found.values) == list(whole.values)
    for name, value in whole.values.items():
        np.testing.assert_array_equal(found.values[name], value)
    np.testing.assert_array_equal(found.c, whole.c)


def test_a_film_without_room_becomes_smaller(
    run_dir: Path, figures: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As it would without the one that was made early."""
    made, real = [], films.film_of

    def noted(fields: Fields, frame: int, pixels: int = films.MAX_PIXELS) -> films.Film:
        made.append(pixels)
        return real(fields, frame, pixels)

    figures()
    monkeypatch.setattr(films, "film_of", noted)
    monkeypatch.setattr(films, "MIN_PIXELS", 4)
    monkeypatch.setattr(films, "BUDGET", 3000)
    early = draw(run_dir)
    found = pages.build(run_dir, prepared=early).read_text(encoding="utf-8")
    pixels = made.copy()
    assert pages.build(run_dir).read_text(encoding="utf-8") == found
    assert len(pixels) > 1
    assert made == pixels * 2


def test_a_process_draws_the_same_figures(
    built: Path, run_dir: Path, figures: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    every, real = [*album.FIGURES, *OF_CHECKS], processes._answer
    some = ["friction_law", *OF_CHECKS]

    def answer(process: subprocess.Popen[str], line: str) -> Any:
        found = real(process, line)
        if line:
            return found
        assert found == every
        return some

    monkeypatch.setattr(processes, "_answer", answer)
    figures("friction_law")
    painters = processes.Painters(run_dir, 1)
    try:
        early = draw(run_dir, painters)
    finally:
        painters.stop()
    assert [p.path.stem for p in early.pictures] == some
    for picture in early.pictures:
        assert picture.path.read_bytes() == (built / "figures" / picture.path.name).read_bytes()
    assert early[:2] == draw(run_dir)[:2]  # fields hold arrays


def test_a_process_that_ends_draws_nothing(
    run_dir: Path, figures: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Such as for want of memory; the page draws the figures then."""
    monkeypatch.setattr(processes, "PROGRAM", "granpinn.report.no_such_program")
    figures("friction_law")
    with processes.painters(run_dir) as painters:
        assert draw(run_dir, painters).pictures == []
