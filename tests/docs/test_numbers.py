"""Measured numbers of the documentation come from the raw results."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from PIL import Image

from docs.generate import demonstration, numbers, raw

ROOT = Path(__file__).parents[2]
GIVEN = "mu(I) is <!--n:grains.mu-->old<!--/n--> % off"


def test_every_number_is_that_of_the_raw_results(capsys: pytest.CaptureFixture[str]) -> None:
    assert numbers.main(["--check"]) == 0, capsys.readouterr().out


@pytest.mark.parametrize("name", raw.FILES)
def test_a_source_exists(name: str) -> None:
    assert raw.text(name)


def test_every_name_has_a_place_and_every_reference_a_page() -> None:
    text = "".join(path.read_text(encoding="utf-8") for path in numbers.pages())
    used = {match[1] for match in numbers.PAIR.finditer(text)}
    settings = {name for name in numbers.NUMBERS if name.startswith("setting.")}
    assert (set(numbers.NUMBERS) - settings) | set(numbers.BUILT) <= used
    assert len(re.findall("<!--n:", text)) == len(numbers.PAIR.findall(text))  # none without end


def test_a_stale_number_is_named_and_filled_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "page.md"
    page.write_text(GIVEN)
    monkeypatch.setattr(numbers, "ROOT", tmp_path)
    monkeypatch.setattr(numbers, "pages", lambda: [page])
    monkeypatch.setitem(numbers.NUMBERS, "grains.mu", lambda: "-1.0 to +1.0")
    assert numbers.main(["--check"]) == 1
    assert capsys.readouterr().out.startswith("page.md: grains.mu\n")
    assert page.read_text() == GIVEN
    assert numbers.main(["--write"]) == 0
    assert page.read_text() == GIVEN.replace("old", "-1.0 to +1.0")
    assert numbers.main(["--check"]) == 0


def test_the_picture_and_the_output_of_the_readme_are_of_one_run() -> None:
    with Image.open(demonstration.PICTURE) as picture:
        assert picture.info["output"] == raw.text("demonstration")
