"""The answers of the groups of run.py, as lines.

python -m bench.studies.one_law.table [GROUPS.json]
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies.one_law.run import PATH
from granpinn.arrays import Float64
from granpinn.checks.shared_law import DIFFERENT
from granpinn.physics.laws import DEFAULT

Groups = list[dict[str, Any]]
NAMES = ("mu_s", "mu_2", "I0")
CLOSE = 10.0  # error of I0, %


def theta(parameters: dict[str, Any]) -> Float64:
    return np.array([parameters[name]["value"] for name in NAMES])


def errors(group: dict[str, Any], parameters: dict[str, Any]) -> Float64:
    """Errors of mu_s, mu_2 and I0, % of the truth."""
    return np.asarray(100 * (theta(parameters) / group["truth"] - 1))


def held(group: dict[str, Any]) -> list[bool | None]:
    """Whether the intervals of mu_s, mu_2 and I0 hold the truth; None: there is none."""
    found: list[bool | None] = []
    for name, truth in zip(NAMES, group["truth"], strict=True):
        parameter = group["parameters"][name]
        interval = None if parameter.get("undetermined") else parameter["interval_90"]
        found.append(None if interval is None else interval[0] <= truth <= interval[1])
    return found


def of_curve(group: dict[str, Any]) -> Float64:
    """Least, largest and rms error of mu(I) of a law over the I of all flows, %."""
    low, high = group["I_range"]
    I = np.geomspace(low, high, 50)
    true = DEFAULT.friction(I, *group["truth"])
    e = 100 * (DEFAULT.friction(I, *theta(group["parameters"])) / true - 1)
    return np.array([e.min(), e.max(), np.sqrt(np.mean(e**2))])


def of_pairs(name: str, every: Groups) -> Iterator[str]:
    """Lines of simulated pairs: I0, intervals, and mu_2 against the single flows."""
    free = [g for g in every if not g["parameters"]["I0"]["fixed"]]
    e = np.array([errors(g, g["parameters"]) for g in free])
    intervals = [held(g) for g in free]
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
    joint = np.array([errors(g, g["parameters"])[1] for g in every])
    apart = np.array([[errors(g, a["parameters"])[1] for a in g["apart"]] for g in every])
    labels = ("one law", "collapse alone", "chute alone")
    parts = [
        f"{label} {np.median(np.abs(v)):.1f}, {_rms(v):.1f}"
        for label, v in zip(labels, [joint, *apart.T], strict=True)
    ]
    yield f"  mu_2, median and rms error in %: {'; '.join(parts)}"


def lines(every: Groups) -> Iterator[str]:
    """All answers."""

    def of(kind: str) -> Groups:
        return [group for group in every if group["kind"] == kind]

    for kind in ("pair", "noisy"):
        yield from of_pairs(kind, of(kind)) if of(kind) else ()
    for group in of("grains") + of("same"):
        low, high, rms = of_curve(group)
        yield f"{group['kind']} {group['name']}: {low:+.1f} to {high:+.1f} %, rms {rms:.1f}"
    for kind in ("pair", "grains", "same", "foreign"):
        p = [group["p_value"] for group in of(kind)]
        yield f"{kind}: p < {DIFFERENT:g} in {sum(v < DIFFERENT for v in p)} of {len(p)}"
    for group in of("twice"):
        parts = []
        for name in NAMES[:2]:
            joint, once = group["parameters"][name], group["once"][name]
            if joint["std"] is not None and once["std"] is not None:
                moved = (joint["value"] - once["value"]) / once["std"]
                narrowed = joint["std"] / once["std"]
                parts.append(f"{name} {moved:+.1f} sd, sd times {narrowed:.2f}")
        yield f"twice: {'; '.join(parts)}"
    yield f"at most {1000 * max(group['seconds'] for group in every):.0f} ms for a law"


def _rms(values: Float64) -> float:
    return float(np.sqrt(np.mean(values**2)))


if __name__ == "__main__":
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else PATH
    content = json.loads(path.read_text(encoding="utf-8"))
    print("\n".join(lines(content["groups"])))
    print(content["date"], content["device"], json.dumps(content["machine"]))
