"""The raw results that the documentation uses: a result that moves changes this table only."""

from __future__ import annotations

import csv
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
STUDIES = "bench/studies"
FILES = {
    "flows": f"{STUDIES}/coverage/results/rows.csv",  # identifications of flows of known law
    "coverage": f"{STUDIES}/coverage/results/report.md",  # how often the intervals hold
    "references": f"{STUDIES}/identification/results/rows.csv",
    "rules": f"{STUDIES}/ablation/results/rows.csv",
    "laws": f"{STUDIES}/laws/choice/results/rows.csv",
    "exact flows": f"{STUDIES}/floor/results/rows.csv",
    "scenes": f"{STUDIES}/grains/results/scenes.md",
    "contradictions": f"{STUDIES}/reliability/results/contradictions.csv",
    "windows": f"{STUDIES}/window/results/rows.json",
    "tracks": f"{STUDIES}/experiment/results/tracks.json",
    "jets": "bench/results/jet_step.json",
    "commands": "bench/results/commands.csv",
    "demonstration": "docs/results/demonstration.txt",  # what the command of README.md prints
    "tests": "docs/results/tests.txt",  # the last lines of the second command of README.md
}


def text(name: str) -> str:
    """A raw result."""
    return (ROOT / FILES[name]).read_text(encoding="utf-8")


@cache
def rows(name: str) -> list[dict[str, str]]:
    """A raw result in CSV, one dictionary each row."""
    return list(csv.DictReader(text(name).splitlines()))
