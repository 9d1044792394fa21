"""Whether a training gives error bars and a verdict, and those it gives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from granpinn.config import Config, flatten
from granpinn.results import Covariance, Parameter
from granpinn.results.records import ErrorBars, Members, Residuals, Verdict
from granpinn.uncertainty import calibration, error_bars

CALIBRATED_LEVELS = ("V1", "V2")
TOO_LITTLE = (
    "mu_s and mu_2 are not known yet: so few steps, or so large a misfit of the velocity, leave "
    "errors as large as the values"
)
DECISIVE = ("form", "network", "rheology", "weights", "batch", "optimizer")
STARTS = ("rheology.start", "rheology.random_start")  # they do not matter (bench/studies/recipe)


class Judgement(NamedTuple):
    """Center (mu_s, mu_2) with its error bars, where there are any, and what to think of it."""

    free: tuple[Parameter, Parameter]
    covariance: Covariance | None
    bars: ErrorBars | None
    verdict: Verdict


def judge(
    members: Members, residuals: Residuals | None, steps: int, config: Config, lost: str | None
) -> Judgement:
    """Error bars and verdict, unless they would mean nothing: the verdict then says why."""
    table, changed = calibration.load(), uncalibrated(config)
    mu = error_bars.center(members)

    def without(words: str) -> Judgement:
        mu_s, mu_2 = (Parameter(value, fixed=False) for value in mu)
        return Judgement((mu_s, mu_2), None, None, Verdict(None, words))

    if lost is not None or residuals is None:
        return without("the training diverged")
    if changed:
        return without(_why_not(changed))
    found = error_bars.estimate(members, residuals, steps, table)
    if any(std > value for std, value in zip(found.std, mu, strict=True)):
        return without(TOO_LITTLE)
    mu_s, mu_2 = (
        Parameter(value, False, std, interval)
        for value, std, interval in zip(found.mu, found.std, found.intervals, strict=True)
    )
    rows = tuple(tuple(row) for row in found.covariance.tolist())
    verdict = error_bars.verdict(found.mu, residuals, table)
    return Judgement((mu_s, mu_2), Covariance(("mu_s", "mu_2"), rows), found.bars, verdict)


def uncalibrated(config: Config) -> list[str]:
    """The settings that are others than those which the calibration table was made with."""
    usual = flatten(Config())
    fixed = [key for key in usual if key.split(".")[0] in DECISIVE and key not in STARTS]
    changed = [key for key in fixed if flatten(config)[key] != usual[key]]
    return changed + ([] if config.level in CALIBRATED_LEVELS else ["level"])


def _why_not(settings: Sequence[str]) -> str:
    return (
        "no error bars and no verdict: they are calibrated for the default recipe at level V1 or "
        f"V2, and this run has another {', '.join(settings)}"
    )
