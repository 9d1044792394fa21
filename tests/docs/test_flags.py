"""Every flag of granpinn that a page names exists."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from docs.generate import commands
from tests.docs.test_site import DOCS, PAGES

FLAG = re.compile(r"(?<![\w-])--[a-zA-Z][\w.-]*\w|--c\b")
CALL = re.compile(r"granpinn[. ](\w+)(.*)")
OTHERS = {"--no-build-isolation", "--cpus-per-task", "--python", "--torch"}


@pytest.fixture(scope="module")
def helps() -> dict[str, set[str]]:
    """The flags in the help of each command."""
    names = commands.VERBS
    return {name: set(FLAG.findall(commands.section(name))) for name in names}


@pytest.mark.parametrize("page", [*PAGES, "../README.md"])
def test_flags_exist(page: str, helps: dict[str, set[str]]) -> None:
    text = (DOCS / Path(page)).read_text(encoding="utf-8").replace("\\\n", " ")
    blocks = re.findall(r"^```\w*\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    lines = [line for block in blocks for line in block.splitlines()]
    lines = [line for line in lines if CALL.search(line) or line.startswith("--")]
    prose = re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
    for piece in [*lines, *re.findall(r"`([^`]+)`", prose)]:
        call = CALL.search(piece)
        known = helps.get(call[1]) if call else None
        flags = set(FLAG.findall(call[2] if call and known else piece))
        assert flags <= (known or set().union(*helps.values())) | OTHERS, piece
