"""What a study keeps of a result, so that the result can be judged again without its training."""

from __future__ import annotations

from typing import Any

from granpinn.inspection.momentum_balance import Baseline
from granpinn.results import Result
from granpinn.results.decoding import plain


def records_of(result: Result) -> dict[str, Any]:
    """The records of a result that its error bars and its assessment come from, as JSON values."""
    balance = result.checks.get("momentum_balance")
    return {
        "level": result.level,
        "data": plain(result.data),
        "members": None if result.members is None else plain(result.members.values),
        "residuals": plain(result.residuals),
        "I_range": result.law.I_range,
        "measured_noise": result.data.measured_noise,
        "independent": result.data.independent,
        "steps": result.timing.steps,
        "baseline": balance_of(balance.balance if balance else None),
        "failure": result.failure,
    }


def balance_of(found: Baseline | None) -> dict[str, Any] | None:
    """Why there is no momentum balance, or the points (I, mu, standard error, cells) of it that
    laws are compared with."""
    if found is None:
        return None
    points = [(p.I, p.mu, p.se, p.cells) for p in found.shown]
    return {"reason": found.reason, "carried": found.carried, "points": points}
