"""The page "How it is tested": gates with their tests, and what the records of attacks show.

The records are bench/studies/reliability/results/*.json. A record that is missing is shown as not
run.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

RESULTS = Path(__file__).parents[2] / "bench" / "studies" / "reliability" / "results"
MODULES = "python -m bench.studies.reliability."
CLASSES = 10  # kinds of failures that are listed for each record


class Gate(NamedTuple):
    """A gate that the tests keep.

    Attributes:
        name: as in the tests.
        claim: what must hold.
        tests: files of tests that `pytest` runs, and scripts.
    """

    name: str
    claim: str
    tests: tuple[str, ...]


class Attack(NamedTuple):
    """A gate that a command keeps, with its record."""

    name: str
    claim: str
    record: str
    command: str


KEPT_BY_TESTS = (
    Gate(
        "K-1",
        "kernels err at most twice as much as float32 automatic differentiation, gradients 3 times",
        ("tests/kernels/test_accuracy.py",),
    ),
    Gate(
        "K-2", "gradients agree with differences in float64", ("tests/kernels/test_gradients.py",)
    ),
    Gate("K-3", "operators keep the rules of torch", ("tests/kernels/test_operators.py",)),
    Gate("K-4", "repeats are equal to the last bit", ("tests/kernels/test_determinism.py",)),
    Gate("K-5", "GPU and CPU agree within K-1", ("tests/kernels/test_accuracy.py",)),
    Gate("K-6", "compute-sanitizer reports nothing on a GPU", ("bench/sanitize.sh",)),
    Gate(
        "V-1",
        "residuals of manufactured fields are zero",
        ("tests/kernels/test_oracle.py", "tests/kernels/test_pointwise.py"),
    ),
    Gate("V-2", "the simulator has its order", ("tests/simulation/test_smooth_flows.py",)),
    Gate(
        "V-3",
        "Bagnold flow is found, and manufactured flows solve the equations",
        ("tests/simulation/test_bagnold.py", "tests/bench/test_floor.py"),
    ),
    Gate("T-1", "a resumed run has the same bits", ("tests/training/test_resume.py",)),
    Gate(
        "T-3",
        "a fault while saving leaves the checkpoint before",
        ("tests/training/test_checkpoint.py", "tests/output/test_writing.py"),
    ),
    Gate(
        "T-4",
        "a signal in any phase saves and stops in 10 s, a second one at once",
        ("tests/training/test_signals.py",),
    ),
    Gate(
        "T-5",
        "NaN and infinity in any tensor are noticed in their step and never saved",
        ("tests/training/test_guard.py",),
    ),
    Gate(
        "T-6",
        "every flipped bit of a checkpoint is refused",
        ("tests/training/test_checkpoint.py",),
    ),
    Gate(
        "F-1",
        "hostile flow files are refused in one sentence",
        ("tests/data/test_hostile_files.py",),
    ),
    Gate(
        "F-2",
        "mutants of flow files and instrument files are read or refused",
        ("tests/data/test_mutants.py", "tests/importers/test_mutants.py"),
    ),
    Gate(
        "F-5",
        "what is no regular file is never replaced; every file is written whole or not at all",
        ("tests/output/test_writing.py", "tests/test_repository.py"),
    ),
    Gate("F-3", "no pickle, no eval, no shell, no network", ("tests/test_repository.py",)),
    Gate(
        "F-6",
        "one flow in 2,700 forms of all formats gives one flow to rounding, or a refusal",
        ("tests/importers/test_forms.py",),
    ),
)
KEPT_BY_COMMANDS = (
    Attack(
        "F-1, F-2, F-4",
        "each command on damaged files: no crash, no hang over 15 s, no traceback, no other file "
        "opened, at most 3 times the memory",
        "mutants.json",
        "mutants --seeds 0:10000 --jobs 2",
    ),
    Attack(
        "F-1, F-2, F-4",
        "the same since libraries open the files, in a process that all mutants share",
        "mutants_of_readers.json",
        "mutants --command convert inspect --seeds 0:500",
    ),
    Attack(
        "F-1, F-2, F-4",
        "the same for DaVis buffers, and the seeds that were missing of the other formats",
        "mutants_of_readers_again.json",
        "mutants --command convert inspect --seeds 425:500",
    ),
    Attack(
        "F-5, T-3",
        "a fault at every write of every file, and a disk that is full at every 4 kB: one "
        "sentence, earlier files whole, then the same bits",
        "output_faults.json",
        "output_faults",
    ),
    Attack(
        "F-5",
        "devices, FIFOs, sockets, links and files of others as outputs are left as they are",
        "hostile_targets.json",
        "hostile_targets",
    ),
    Attack("K-6", "ASan and UBSan report nothing", "sanitizers.json", "sanitize_host"),
    Attack(
        "V-4",
        "planted mistakes in kernels, physics and data are caught by the tests",
        "planted_mistakes.json",
        "planted_mistakes",
    ),
    Attack("T-2", "kill -9 at random moments, then the same bits", "kills-cpu.json", "kills"),
    Attack("T-2", "the same on a GPU", "kills-cuda.json", "kills --device cuda"),
)


def gate_table() -> str:
    """The gates that the tests keep."""
    return "\n".join(gates())


def record_tables(results: Path = RESULTS) -> str:
    """All records."""
    return "\n".join(records(results))


def gates() -> Iterator[str]:
    """The gates that the tests keep."""
    yield from ("| gate | what must hold | tests |", "|---|---|---|")
    for gate in KEPT_BY_TESTS:
        yield f"| {gate.name} | {gate.claim} | {', '.join(f'`{path}`' for path in gate.tests)} |"


def records(results: Path) -> Iterator[str]:
    """A table of all attacks, then for each record its command, machine and failures."""
    read = {attack: record(results / attack.record) for attack in KEPT_BY_COMMANDS}
    yield "| gate | what must hold | inputs | failed | outcomes | time |"
    yield "|---|---|---|---|---|---|"
    for attack, found in read.items():
        yield f"| {attack.name} | {attack.claim} | {' | '.join(cells(found))} |"
    for attack, found in read.items():
        yield from ("", f"### {attack.name}: {attack.record.removesuffix('.json')}", "")
        if found is None:
            yield f"Not run. `{MODULES}{attack.command}` runs it."
        else:
            yield from section(found)


def record(path: Path) -> dict[str, Any] | None:
    """A record; None if there is none."""
    if not path.is_file():
        return None
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def cells(found: dict[str, Any] | None) -> tuple[str, str, str, str]:
    """Inputs, failures, outcomes and time."""
    if found is None:
        return ("not run", "", "", "")
    counts = sorted(found["outcomes"].items(), key=lambda item: -item[1])
    outcomes = ", ".join(f"{count:,} {name}" for name, count in counts)
    return (f"{found['tried']:,}", f"{failures(found):,}", outcomes, duration(found["seconds"]))


def failures(found: dict[str, Any]) -> int:
    """Number of inputs that ended as they must not; a record may list only some of them."""
    return int(found.get("failed", len(found["failures"])))


def duration(seconds: float) -> str:
    """A time for people."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


def section(found: dict[str, Any]) -> Iterator[str]:
    """How one record was made, and its failures."""
    versions = ", ".join(f"{name} {value}" for name, value in found["versions"].items())
    yield f"{found['date']}, {found['device']}; {versions}."
    yield from ("", "```bash", found["command"], "```")
    details = found.get("details", {})
    if formats := details.get("formats") or details.get("cases"):
        yield from ("", "| input | outcomes |", "|---|---|")
        for name, row in formats.items():
            yield f"| {name} | {', '.join(f'{key} {shown(row[key])}' for key in row)} |"
    for name, reason in details.get("not run", {}).items():
        yield from ("", f"{name}: not run, {', '.join(reason)} is not installed.")
    if left := details.get("not_run"):
        yield from ("", "Not run:", "", *(f"- {name}" for name in left))
    if failures(found):
        yield from ("", "Failures:", "")
        kinds = details.get("classes") or {plain(row): 1 for row in found["failures"]}
        for name, count in list(kinds.items())[:CLASSES]:
            yield f"- {count:,} x `{name.replace('`', ' ')}`"


def shown(value: float) -> str:
    """A count, or a number with two digits behind the point."""
    return f"{value:,}" if isinstance(value, int) else f"{value:.2f}"


def plain(row: Any) -> str:
    """A failure in one line."""
    if isinstance(row, dict):
        return ", ".join(f"{key}: {value}" for key, value in row.items())[:200].replace("\n", " ")
    return str(row)[:200]
