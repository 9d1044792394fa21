"""The answers of the rows of run.py, as lines.

python -m bench.studies.one_law.table
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies.one_law.run import read
from granpinn.arrays import Float64
from granpinn.checks.shared_law import DIFFERENT, best_fit
from granpinn.physics.laws import DEFAULT
from granpinn.uncertainty.error_model import Known

Rows = Sequence[dict[str, Any]]
PATH = Path(__file__).parent / "results" / "rows.csv"
NAMES = ("mu_s", "mu_2", "I0")
CLOSE = 10.0  # error of I0, %


def records(rows: Rows, kind: str) -> list[dict[str, Any]]:
    """The records of one kind of cases."""
    return [row["record"] for row in rows if row["kind"] == kind]


def theta(parameters: dict[str, Any]) -> Float64:
    return np.array([parameters[name]["value"] for name in NAMES])


def errors(record: dict[str, Any], parameters: dict[str, Any]) -> Float64:
    """Errors of mu_s, mu_2 and I0, % of the truth."""
    return np.asarray(100 * (theta(parameters) / record["truth"] - 1))


def held(record: dict[str, Any]) -> list[bool | None]:
    """Whether the intervals of mu_s, mu_2 and I0 hold the truth; None: there is none."""
    found: list[bool | None] = []
    for name, truth in zip(NAMES, record["truth"], strict=True):
        interval = record["joint"]["parameters"][name]["interval_90"]
        found.append(None if interval is None else interval[0] <= truth <= interval[1])
    return found


def best(record: dict[str, Any]) -> Float64:
    """The law that fits the laws of the single flows best, with their I0."""
    known = [Known(*flow["known"])._replace(I0=None) for flow in record["apart"]]
    I = np.concatenate([flow["I_range"] for flow in record["apart"]])
    start = theta(record["joint"]["parameters"])
    none = [np.zeros((2, 2))] * len(known)
    return np.array(best_fit(known, none, I, DEFAULT, start.tolist()).theta)


def of_curve(record: dict[str, Any], law: Float64) -> Float64:
    """Least, largest and rms error of mu(I) of a law over the I of all flows, %."""
    low = min(flow["I_range"][0] for flow in record["flows"])
    high = max(flow["I_range"][1] for flow in record["flows"])
    I = np.geomspace(low, high, 50)
    e = 100 * (DEFAULT.friction(I, *law) / DEFAULT.friction(I, *record["truth"]) - 1)
    return np.array([e.min(), e.max(), np.sqrt(np.mean(e**2))])


def of_pairs(name: str, every: list[dict[str, Any]]) -> Iterator[str]:
    """Lines of simulated pairs: I0, intervals, and mu_2 against the single flows."""
    free = [r for r in every if not r["joint"]["parameters"]["I0"]["fixed"]]
    e = np.array([errors(r, r["joint"]["parameters"]) for r in free])
    intervals = [held(r) for r in free]
    counts = [
        f"{sum(v is True for v in column)}/{sum(v is not None for v in column)}"
        for column in zip(*intervals, strict=True)
    ]
    close = int(np.sum(np.abs(e[:, 2]) <= CLOSE))
    yield (
        f"{name}: {len(every)} pairs, I0 free in {len(free)}, within {CLOSE:g} % in {close}; "
        f"its error: median {np.median(np.abs(e[:, 2])):.1f}, mean {e[:, 2].mean():.1f}, rms "
        f"{_rms(e[:, 2]):.1f} %; intervals of mu_s, mu_2, I0 hold {', '.join(counts)}"
    )
    joint = np.array([errors(r, r["joint"]["parameters"])[1] for r in every])
    apart = np.array([[errors(r, a["parameters"])[1] for a in r["apart"]] for r in every])
    values = [joint, *apart.T]
    labels = ("one law", "collapse alone", "chute alone")
    parts = [
        f"{label} {np.median(np.abs(v)):.1f}, {_rms(v):.1f}"
        for label, v in zip(labels, values, strict=True)
    ]
    yield f"  mu_2, median and rms error in %: {'; '.join(parts)}"


def of_grains(record: dict[str, Any]) -> Iterator[str]:
    """The errors of mu(I) of the trained law, and of the one that fits the single laws best."""
    laws = {"one law": theta(record["joint"]["parameters"]), "best fit": best(record)}
    for name, law in laws.items():
        low, high, rms = of_curve(record, law)
        yield f"{name} {low:+.1f} to {high:+.1f} %, rms {rms:.1f}"


def alarms(every: list[dict[str, Any]]) -> str:
    p = [record["shared_law"]["p_value"] for record in every]
    return f"{sum(v < DIFFERENT for v in p)} of {len(p)}"


def lines(rows: Rows) -> Iterator[str]:
    """All answers."""
    for kind in ("pair", "long", "noisy"):
        yield from of_pairs(kind, records(rows, kind))
    for kind in ("grains", "same"):
        for row in rows:
            if row["kind"] == kind:
                yield f"{kind} {row['case']}: mu(I) {'; '.join(of_grains(row['record']))}"
    for kind in ("pair", "grains", "same", "foreign"):
        yield f"{kind}: p < {DIFFERENT:g} in {alarms(records(rows, kind))}"
    for record in records(rows, "twice"):
        joint, once = record["joint"]["parameters"], record["apart"][0]["parameters"]
        parts = []
        for name in NAMES[:2]:
            moved = (joint[name]["value"] - once[name]["value"]) / once[name]["std"]
            narrowed = joint[name]["std"] / once[name]["std"]
            parts.append(f"{name} {moved:+.1f} sd, sd times {narrowed:.2f}")
        yield f"twice: {'; '.join(parts)}"
    for row in rows:
        if row["kind"] == "cost":
            joint, apart = row["record"]["steps_per_s"]
            yield f"cost {row['case']}: {apart / joint:.2f} times side by side"


def _rms(values: Float64) -> float:
    return float(np.sqrt(np.mean(values**2)))


if __name__ == "__main__":
    rows = read(PATH)
    print("\n".join(lines(rows)))
    first = rows[0]["record"]
    print(first["date"], first["device"], json.dumps(first["machine"]))
