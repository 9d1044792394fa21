"""Measured numbers of the documentation come from the raw results."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from PIL import Image

from docs.generate import demonstration, numbers, raw, sources

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


def test_a_name_without_a_source_is_refused() -> None:
    with pytest.raises(numbers.UnknownNumberError, match="no_such"):
        numbers.filled("<!--n:no_such-->1<!--/n-->", numbers.NUMBERS)


def test_a_reference_is_made_when_the_site_is_built() -> None:
    page = "# Commands\n\n<!--n:commands--><!--/n-->\n"
    assert numbers.filled(page, numbers.NUMBERS) == page
    assert "usage: granpinn train" in numbers.on_page_markdown(page, None, None, None)


def test_the_picture_and_the_output_of_the_readme_are_of_one_run() -> None:
    with Image.open(demonstration.PICTURE) as picture:
        assert picture.info["output"] == raw.text("demonstration")


def test_errors_in_grains_are_those_of_the_law() -> None:
    """One row by hand: mu at both ends of its range and at I = 0.01 and 0.03 between."""
    row = {"mu_s": "0.2", "mu_2": "0.6", "true_s": "0.25", "true_2": "0.6", "I0": "0.3"}
    row |= {"I_low": "0.005", "I_high": "0.04", "true_low": "", "true_high": ""}
    found = sources.errors(row)
    x = [n / (n + 0.3) for n in (0.005, 0.01, 0.03, 0.04)]
    right = [(0.2 + 0.4 * y) / (0.25 + 0.35 * y) for y in x]
    assert found == pytest.approx([100 * (ratio - 1) for ratio in right])
    mean = row | {"true_s": "0.3", "true_2": "0.3", "true_low": "0.1", "true_high": "0.1"}
    assert sources.errors(mean) == pytest.approx([0.0])
