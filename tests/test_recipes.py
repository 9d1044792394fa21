"""The recipes of CONTRIBUTING.md: how many product files a law, a term or a reader takes.

A name that stands in further files is wired in there, and the next law, term, optimiser or reader
would have to be too.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SUFFIXES = (".py", ".h", ".cpp", ".cu", ".cuh", ".html")
EXAMPLES = {
    "granpinn/commands/inspect.py",
    "granpinn/commands/simulate.py",
}  # in the help of commands

LAW = {
    "csrc/math/laws/coulomb.h",
    "csrc/math/laws/laws.h",  # a row
    "granpinn/physics/laws/coulomb.py",
    "granpinn/physics/laws/__init__.py",  # a row
    "granpinn/reference/friction.py",  # once more, on purpose
}
TERM = {
    "csrc/math/terms.h",  # a row
    "csrc/math/forms/mixed.h",
    "granpinn/physics/terms.py",  # a row
    "granpinn/reference/equations.py",
}
READER = {"granpinn/importers/grids.py", "granpinn/importers/series.py"}
OPTIMISER = {"granpinn/training/optimise.py", "granpinn/config/sections.py"}


def files_with(pattern: str) -> set[str]:
    """Product files in whose code, comments and docstrings left out, a name stands."""
    found = set()
    for folder in ("granpinn", "csrc"):
        for path in (ROOT / folder).rglob("*"):
            if path.suffix not in SUFFIXES:
                continue
            text = path.read_text(encoding="utf-8")
            text = re.sub(r'r?"""[\s\S]*?"""|//.*|#(?!\s*include|\s*define).*', "", text)
            if re.search(pattern, text, re.IGNORECASE):
                found.add(path.relative_to(ROOT).as_posix())
    return found


def test_a_law_is_its_header_its_module_two_rows_and_the_oracle() -> None:
    assert files_with("coulomb") - EXAMPLES == LAW


def test_a_residual_term_takes_four_files() -> None:
    assert files_with("constitutive") == TERM


def test_a_reader_takes_two_files() -> None:
    assert files_with("openpiv") == READER


def test_an_optimiser_is_chosen_in_two_files() -> None:
    """Its arithmetic is torch's, or a fused update of csrc/step.h, which both backends call."""
    assert files_with('"muon"') == OPTIMISER


def test_contributing_names_the_files_of_the_recipes() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    generic = {"coulomb": "NAME"}
    for path in LAW | TERM | READER | OPTIMISER:
        for name, word in generic.items():
            path = path.replace(name, word)
        assert path.replace("forms/mixed", "forms/FORM") in text


@pytest.mark.parametrize("line", range(8))
def test_the_path_of_a_velocity_is_true(line: int) -> None:
    """Every file and function of the reader's path in CONTRIBUTING.md exists."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    path = re.search(r"<!-- path -->\n```text\n(.*?)```", text, re.DOTALL)
    assert path is not None
    lines = path.group(1).strip().splitlines()
    assert len(lines) <= 8
    if line >= len(lines):
        return
    file, functions, *_ = re.split(r"\s{2,}", lines[line].strip())
    source = (ROOT / file).read_text(encoding="utf-8")
    for name in functions.split(", "):
        assert re.search(rf"\b{re.escape(name.split('.')[-1])}\b", source), (file, name)
