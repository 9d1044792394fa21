"""Figures that are drawn while the pressure is simulated, before the page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from granpinn.report import page as pages
from granpinn.report import painters as processes
from granpinn.results import read_results, write_results
from tests.page import Page


def test_figures_drawn_before_the_simulated_pressure_are_those_of_the_page(
    built: Path, run_dir: Path, figures: Callable[..., None]
) -> None:
    figures("friction_law", "pressure")
    whole = read_results(run_dir / "results.json")
    assert whole.simulated_pressure is not None
    write_results(replace(whole, simulated_pressure=None), run_dir / "results.json")
    drawn = pages.draw(run_dir)
    assert [p.path.stem for p in drawn] == ["friction_law", "pressure", "law_on_parts"]
    write_results(whole, run_dir / "results.json")
    before = {p.path: p.path.stat().st_mtime_ns for p in drawn}
    page = pages.build(run_dir, drawn=drawn).read_text(encoding="utf-8")
    assert {path: path.stat().st_mtime_ns for path in before} == before
    for name in ("friction_law", "pressure", "law_on_parts", "pressure_simulated"):
        early, late = (folder / "figures" / f"{name}.png" for folder in (run_dir, built))
        assert early.read_bytes() == late.read_bytes()
    narrow = Page((built / "report.html").read_text(encoding="utf-8")).values("source", "srcset")
    assert set(Page(page).values("source", "srcset")) <= set(narrow)


def test_a_process_draws_the_same_figures(
    built: Path, run_dir: Path, figures: Callable[..., None]
) -> None:
    figures("friction_law")
    painters = processes.Painters(run_dir, 1)
    try:
        drawn = pages.draw(run_dir, painters)
    finally:
        painters.stop()
    assert [p.path.stem for p in drawn] == ["friction_law", "pressure_simulated", "law_on_parts"]
    for picture in drawn:
        assert picture.path.read_bytes() == (built / "figures" / picture.path.name).read_bytes()
    assert drawn == pages.draw(run_dir)


def test_a_process_that_ends_draws_nothing(
    run_dir: Path, figures: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Such as for want of memory; the page draws the figures then."""
    monkeypatch.setattr(processes, "PROGRAM", "granpinn.report.no_such_program")
    figures("friction_law")
    with processes.painters(run_dir) as painters:
        assert pages.draw(run_dir, painters) == []
