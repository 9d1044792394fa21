"""One physical flow in every form gives one flow to rounding, or a refusal, and nothing else.

Every choice alone; with `-m long` two at a time too.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.importers.forms import FAMILIES
from tests.importers.forms.form import FLOAT64, Given, verdict
from tests.importers.forms.physical import flow


@pytest.mark.parametrize("pairs", [False, pytest.param(True, marks=pytest.mark.long)])
@pytest.mark.parametrize("name", FAMILIES)
def test_every_form_is_the_same_flow_or_is_refused(tmp_path: Path, name: str, pairs: bool) -> None:
    found = FAMILIES[name].outcomes(tmp_path, pairs)
    wrong = {form: text for form, (text, _) in found.items() if text.startswith("wrong")}
    assert not wrong
    unread = {form: text for form, (text, must) in found.items() if must and text != "equal"}
    assert not unread


def test_there_are_many_forms() -> None:
    for pairs, count in ((False, 400), (True, 1500)):
        forms = [form for family in FAMILIES.values() for form in family.forms(pairs)]
        assert len(forms) > count
        assert sum(must for _, must in forms) > count / 2


def _other(**changes: Any) -> Given:
    return Given(lambda: replace(flow(), **changes), flow(), FLOAT64)


GONE = {name: np.where(flow().x > 0, getattr(flow(), name), np.nan) for name in "uv"}
VERDICTS = {
    "equal": (_other(), "equal"),
    "rounded": (_other(x=flow().x * (1 + 2.0**-52)), "equal"),
    "refused": (_other(density=-1.0), "refused: density must be"),
    "another error": (_other(nothing=1), "wrong: TypeError"),
    "late": (_other(t=flow().t + 1e-6), "wrong: t 0.00"),
    "fewer vectors": (_other(**GONE), "wrong: u 83 NaN for 65"),
    "no surface": (_other(surface=None), "wrong: surface.t, surface.x, surface.y in one of them"),
    "unit": (_other(length_unit="mm"), "wrong: length_unit mm for m"),
}


@pytest.mark.parametrize(("given", "expected"), VERDICTS.values(), ids=VERDICTS.keys())
def test_the_verdict_sees_every_difference(given: Given, expected: str) -> None:
    assert verdict(given).startswith(expected), verdict(given)
