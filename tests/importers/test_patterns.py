"""Every pattern of the readers takes linear time, also over a million hostile characters."""

from __future__ import annotations

import ast
import importlib
import pkgutil
import re
import time
from pathlib import Path
from typing import Any

import pytest

import granpinn.foreign
import granpinn.importers
from granpinn.importers import DataFileError, units

N = 1_000_000
# Linear patterns take up to 0.1 s for a million characters, quadratic ones minutes.
SECONDS = 3.0

# The method that the reader calls, and pieces that a hostile text repeats.
PATTERNS: dict[str, tuple[str, tuple[str, ...]]] = {
    "columns._COLUMN": ("fullmatch", ("a", " ", "[", "(a", "a[", "]")),
    "grids._DAVIS": ("match", ("#", "# ", "DaVis ", "1 ", "#DaVis 1 2D-vector 1")),
    "grids._FACTOR": ("findall", ("conversion factor xy (", ")", ": ", " ", "1", "e")),
    "grids._FRAME": ("search", ("FRAME:", "FRAME: ", "1")),
    "grids.NUMBERED": ("findall", ("1", "1:", " 1", "1:a ")),
    "series._NUMBER": ("split", ("1", "1.", "a1", ".")),
    "series._TIME": ("findall", ("1", "1.", "1e", "1e+", "1.1e")),
    "units._NAME_WITH_POWER": ("findall", ("m", "m^", "m-", "m2", "**")),
    "units._QUANTITY": ("fullmatch", ("1", ".", "1.", "1e", "1 ", " ", "+")),
    "units._UNIT": ("fullmatch", ("m", "m*", "1/", "m ", "m2", " ", "m^")),
}


def modules() -> list[Any]:
    packages = (granpinn.importers, granpinn.foreign)
    found = [m for p in packages for m in pkgutil.iter_modules(p.__path__, f"{p.__name__}.")]
    return [importlib.import_module(module.name) for module in found]


def patterns() -> dict[str, re.Pattern[Any]]:
    return {
        f"{module.__name__.rpartition('.')[2]}.{name}": value
        for module in modules()
        for name, value in vars(module).items()
        if isinstance(value, re.Pattern)
    }


def test_every_pattern_is_a_constant_with_a_row() -> None:
    assert patterns().keys() == PATTERNS.keys()
    for module in modules():
        tree = ast.parse(Path(str(module.__file__)).read_text())
        used = {
            node.attr
            for node in ast.walk(tree)
            if isinstance(node, ast.Attribute)
            and isinstance(node.value, ast.Name)
            and node.value.id == "re"
        }
        assert used <= {"compile", "IGNORECASE", "Pattern", "Match"}, module.__name__


@pytest.mark.parametrize("name", PATTERNS)
def test_patterns_take_linear_time(name: str) -> None:
    pattern = patterns()[name]
    method, pieces = PATTERNS[name]
    for piece in pieces:
        for end in ("", "!", "\n"):
            text: Any = piece * (N // len(piece)) + end
            text = text.encode() if isinstance(pattern.pattern, bytes) else text
            start = time.process_time()
            getattr(pattern, method)(text)
            spent = time.process_time() - start
            assert spent < SECONDS, f"{piece!r} + {end!r} took {spent:.1f} s"


@pytest.mark.parametrize("piece", ["1", "1 ", " ", "m", "m*", "(", "-", "9**", "[", "1/"])
def test_long_units_and_quantities_are_refused_at_once(piece: str) -> None:
    text = piece * (N // len(piece))
    start = time.process_time()
    for call in (
        lambda: units.unit(text, "--length-unit"),
        lambda: units.split(text, "--scale"),
        lambda: units.scale(text),
        lambda: units.number(text, "--gravity"),
    ):
        with pytest.raises(DataFileError) as caught:
            call()
        assert len(str(caught.value)) <= 600
    assert time.process_time() - start < SECONDS
