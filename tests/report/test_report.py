"""The page of a run: its content, no need of other files, and safety against odd input."""

from __future__ import annotations

import base64
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from granpinn.data import Truth
from granpinn.figures import album
from granpinn.figures import page as pages
from granpinn.results import ErrorPercent, Input, Parameter, Parameters, Result, read_results
from tests.examples import PARAMETERS, make_result
from tests.page import Page

HOSTILE = """<script>alert(1)</script>"><img src=x onerror='alert(2)'>{{ 7 * 7 }}&lt;"""


def render(result: Result) -> Page:
    return Page(pages.render(result))


def test_the_page_needs_nothing_but_itself(built: Path) -> None:
    html = (built / "report.html").read_text(encoding="utf-8")
    page = Page(html)
    assert not {"link", "iframe", "object", "base", "form", "a", "script"} & set(page.tags)
    for needle in ("http:", "https:", "//", "url(", "@import", "javascript:"):
        assert needle not in re.sub("base64,[A-Za-z0-9+/=]+", "", html)
    (policy,) = (v for v in page.values("meta", "content") if "default-src" in v)
    assert policy == "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
    assert len(html.encode()) < 3_000_000
    assert not [a for _, a, _ in page.attributes if a.startswith("on") or a == "href"]


def test_the_figures_are_inside(built: Path) -> None:
    page = Page((built / "report.html").read_text(encoding="utf-8"))
    sources = page.values("img", "src")
    titles = {name: title for name, (title, _) in album.FIGURES.items()}
    for source, name in zip(sources, titles, strict=True):
        head, data = source.split(",")
        assert head == "data:image/png;base64"
        content = base64.b64decode(data, validate=True)
        assert content[:8] == b"\x89PNG\r\n\x1a\n"
        assert content == (built / "figures" / f"{name}.png").read_bytes()
    assert page.values("img", "alt") == list(titles.values())
    assert "Missing on this page" not in page.text


def test_the_result_comes_first(built: Path) -> None:
    page = Page((built / "report.html").read_text(encoding="utf-8"))
    result = read_results(built / "results.json")
    value = f"{result.parameters.mu_s.value:.3f}"
    order = [
        "Friction law of in memory",
        "Level V1",
        value,
        f"{result.assessment.headline.capitalize()}.",
    ]
    order += ["Friction law. Over the I of", "Pressure. In the grains", "What it rests on"]
    order += ["Results", "Figures", "The run"]
    places = [page.text.index(words, len("Friction law of in memory")) for words in order]
    assert places == sorted(places)
    (title,) = (i for i, tag in enumerate(page.tags) if tag == "title")
    assert page.tags.index("section") < page.tags.index("figure") < page.tags.index("table")
    assert title < page.tags.index("body")


def test_values_and_errors_have_their_digits() -> None:
    text = render(make_result()).text
    for words in (
        "μs 0.410 ± 0.012 true 0.400 · error 2.50 % 90 % interval 0.390 to 0.430 μ2 0.610",
        "μ2 0.610 true 0.640 · error 4.69 %",
        "Good to use. μ(I) is known to ± 6.1 %: 0.420 (0.400 to 0.440) at I = 0.01",
        "μ₂, 0.61 (no interval), is extrapolated",
        "I0 0.3 given, not identified",
        "μₛ 0.4100 0.0120 0.3900 to 0.4300 0.4000 2.50",
        "μ₂ 0.6100 - - 0.6400 4.69",
        "I₀ 0.3000 given - 0.3000 -",
        "velocity 0.80",
        "pressure 4.00 pressure, flowing - pressure, stagnant - ",
        "1,234 velocity vectors of 12 frames and 56 surface points",
        "White noise of 5 % of the maximum speed",
        "4,000 steps in 0:00 on cpu; the time limit decided how many",
        "reproduced to 0.80 %",
        "Stagnant: D2 below 0.05",
        "mixed form, default recipe, seed 7",
        "network.widths 40,40",
        "max_time none",
        "python 3.11.7, torch 2.11.0",
        "one standard deviation",
    ):
        assert words in text, words


def test_what_is_not_known_is_said() -> None:
    parameters = Parameters(PARAMETERS | {"mu_s": Parameter(0.41, fixed=False)})
    text = render(
        make_result(
            parameters=parameters,
            truth=None,
            error_percent=ErrorPercent(),
            covariance=None,
            settings={},
            stopped="steps",
            input=Input("in memory", ""),
        )
    ).text
    assert text.count("true value not known") == 2
    assert "no standard deviations were estimated" in text
    assert "The file has no reference to compare it with." in text
    assert "The file does not state the true parameters." in text
    assert "made in memory" in text
    for absent in ("Nine tenths", "Settings", "time limit", "reproduced to", "None"):
        assert absent not in text


@pytest.mark.parametrize(
    ("truth", "words"),
    [
        (Truth(I0=0.28), "true 0.280"),
        (Truth(), "true value not known"),
        (None, "true value not known"),
    ],
    ids=str,
)
def test_an_I0_that_was_identified(truth: Truth | None, words: str) -> None:
    parameters = Parameters(PARAMETERS | {"I0": Parameter(0.3, False, 0.02, (0.27, 0.33))})
    members = make_result().members
    assert members is not None
    I0 = {"I0": (0.3,) * len(members.seed)}
    members = replace(members, values=members.values | I0)
    text = render(make_result(parameters=parameters, truth=truth, members=members)).text
    assert f"I0 0.300 ± 0.020 {words}" in text
    assert "I₀ 0.3000 0.0200 0.2700 to 0.3300" in text
    assert "What they do not mean" not in text


@pytest.mark.parametrize(
    "changes",
    [
        {"input": Input(HOSTILE, HOSTILE)},
        {"settings": {HOSTILE: {HOSTILE: HOSTILE}, "list": [HOSTILE]}},
        {"recipe": HOSTILE, "device": HOSTILE, "versions": {"granpinn": HOSTILE, HOSTILE: ""}},
    ],
    ids=["input", "settings", "run"],
)
def test_hostile_names_are_text(changes: dict[str, Any]) -> None:
    harmless, page = render(make_result()), render(make_result(**changes))
    assert HOSTILE in page.text
    assert set(page.tags) == set(harmless.tags)
    assert not [name for _, name, _ in page.attributes if name.startswith("on")]


def test_folders_of_the_machine_are_not_on_the_page() -> None:
    settings = {"flow": "/home/someone/flow.h5", "out": "/home/someone/run", "steps": 40}
    text = render(make_result(settings=settings)).text
    assert "/home/someone" not in text
    assert "steps 40" in text
