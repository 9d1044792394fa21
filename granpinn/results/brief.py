"""The answer of an identification in a few lines: values, the law, the grade and its reason.

mu_s   0.398  (0.395 to 0.402)   true 0.400   90 % intervals
mu_2   0.659  (0.623 to 0.697)   true 0.640   extrapolated: the flow reaches 0.33 I0
I0     0.300                     true 0.300   given
mu(I)  0.402 +- 0.004 at I = 0.0048 to 0.465 +- 0.008 at I = 0.1
GOOD   the equations hold; ...
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from granpinn.results.assessment import evidence, reach_of
from granpinn.results.parameters import NOT_DETERMINED

if TYPE_CHECKING:
    from granpinn.results.parameters import Parameter
    from granpinn.results.result import Result


def lines(result: Result) -> list[str]:
    """The lines for a terminal."""
    rows = [_row(result, name, p) for name, p in result.parameters.items()]
    seen = next((row for row in rows if row[1].endswith(")")), None)
    if seen is not None:
        seen[3] = "; ".join(["90 % intervals", *filter(None, [seen[3]])])
    wide = [max(len(row[k]) for row in rows) for k in range(4)]
    made = [
        "   ".join(cell.ljust(w) for cell, w in zip(row, wide, strict=True) if w).rstrip()
        for row in rows
    ]
    made.append(f"mu(I)   {_curve(result)}")
    made += [f"flow    {flow}" for flow in result.flows]
    made.append(f"{result.assessment.grade.upper():4s}    {evidence(result)}")
    return made


def _row(result: Result, name: str, p: Parameter) -> list[str]:
    """Name, value with interval, true value, and a note."""
    value = number(p.value) if p.determined else NOT_DETERMINED
    if p.interval_90 is not None:
        value += f"  ({number(p.interval_90[0])} to {number(p.interval_90[1])})"
    true = getattr(result.truth, name, None)
    reach = reach_of(result) if name == "mu_2" else None
    notes = ["given"] if p.fixed else []
    if result.determined is not None and not p.determined:
        notes += [result.determined.why(name)]
    notes += [] if reach is None else [f"extrapolated: the flow reaches {reach:.2g} I0"]
    return [f"{name:5s}", value, "" if true is None else f"true {number(true)}", "".join(notes)]


def _curve(result: Result) -> str:
    """mu at both ends of the I of the data, with half of the 90 % interval."""
    law, curve = result.law, result.law.curve
    if curve is None:
        return f"{NOT_DETERMINED}: {law.reason}" if law.reason else NOT_DETERMINED
    ends = [0, -1] if curve.I[-1] > curve.I[0] else [0]
    if not any(map(curve.determines, ends)):
        return f"{NOT_DETERMINED} at I = {' to '.join(f'{curve.I[k]:.2g}' for k in ends)}"
    words = []
    for k in ends:
        if not curve.determines(k):
            words.append(f"{NOT_DETERMINED} at I = {curve.I[k]:.2g}")
            continue
        mu = number(curve.mu[k])
        if curve.low is not None and curve.high is not None:
            mu += f" +- {number((curve.high[k] - curve.low[k]) / 2)}"
        words.append(f"{mu} at I = {curve.I[k]:.2g}")
    reason = f"; the error is not known: {law.reason}" if curve.low is None and law.reason else ""
    return " to ".join(words) + reason


def number(value: float) -> str:
    """Three decimals; two digits of a small number, three of a large one."""
    return f"{value:.3f}" if 0.001 <= abs(value) < 100 or value == 0 else f"{value:.3g}"
