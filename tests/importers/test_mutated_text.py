"""Damaged copies of every text format end in a flow or one sentence, in bounded time and memory."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from tests.importers.fuzz_text import CASES
from tests.importers.mutants import KINDS, mutants

ROOT = Path(__file__).parents[2]
SEED, COUNT = 17, 40


def test_every_mutant_ends_in_a_flow_or_one_sentence() -> None:
    command = [sys.executable, "-m", "tests.importers.fuzz_text", str(SEED), str(COUNT)]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=110
    )
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert [case["format"] for case in found] == list(CASES)
    wrong = {case["format"]: case["wrong"] for case in found if case["wrong"]}
    assert not wrong, json.dumps(wrong, indent=1)[-4000:]
    assert sum(case["refused"] for case in found) > COUNT


def test_mutants_are_a_function_of_seed_and_number() -> None:
    whole = b"x,y\n" + b"1,2\n" * 50
    first = list(mutants(whole, 3, 2 * len(KINDS)))
    assert list(mutants(whole, 3, 5, start=4)) == first[4:9]
    assert list(mutants(whole, 4, 2 * len(KINDS))) != first
    assert sum(content != whole for _, content in first) > len(KINDS)
