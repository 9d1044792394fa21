"""The error bars of a training and the verdict on its law, if it can have them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from granpinn.config import Config, flatten
from granpinn.physics.laws import LAWS
from granpinn.results import Covariance, Parameter, Residuals
from granpinn.results.assumed import Assumed
from granpinn.results.records import ErrorBars, Members, Verdict
from granpinn.uncertainty import calibration, error_bars, of_assumptions, of_law
from granpinn.uncertainty.center import center, nearest
from granpinn.uncertainty.held import Held

TOO_LITTLE = (
    "mu_s and mu_2 are not known yet: so few steps, or so large a misfit of the velocity, leave "
    "errors as large as the values"
)
DECISIVE = ("form", "network", "rheology", "weights", "batch", "optimizer")
STARTS = ("rheology.start", "rheology.random_start")  # no influence (bench/studies/recipe)


class Judgement(NamedTuple):
    """The identified parameters, with error bars if they have any, and the verdict."""

    free: dict[str, Parameter]
    covariance: Covariance | None
    bars: ErrorBars | None
    verdict: Verdict


def judge(
    members: Members,
    residuals: Residuals | None,
    steps: int,
    config: Config,
    diverged: bool,
    symmetries: Sequence[str] = (),
    assumed: Sequence[Assumed] = (),
    noise: Callable[[], float | None] = lambda: None,
    held: Held | None = None,
) -> Judgement:
    """Error bars and verdict; without error bars, the verdict gives the reason.

    Args:
        symmetries: of the flow, in words (granpinn/data/symmetry.py).
        assumed: assumptions whose effect enters the error bars.
        noise: measures that of the vectors, in the unit of `residuals.noise`; None: not known.
        held: what the data hold; None: as the flows of the calibration.
    """
    law, changed = LAWS[config.law], uncalibrated(config)
    table = calibration.of_level(config.level) or calibration.load()
    middle = center(members, law)

    def without(words: str) -> Judgement:
        values = (Parameter(value, fixed=False) for value in middle)
        free = dict(zip(law.free, values, strict=True))
        return Judgement(free, None, None, Verdict(None, words, dict.fromkeys(table.residuals)))

    if diverged or residuals is None:
        return without("the training diverged")
    if law.name != table.law:
        title = LAWS[table.law].title
        return without(f"no error bars and no verdict: they are calibrated for {title} alone")
    if changed:
        return without(_why_not(changed))
    if symmetries:
        return without(
            "no error bars and no verdict: they are calibrated on collapses, and this flow is "
            + " and ".join(words.partition(":")[0] for words in symmetries)
        )
    if missing := of_assumptions.unknown(assumed):
        return without(f"no error bars: the effect of the {' and '.join(missing)} is not known")
    found = error_bars.estimate(members, residuals, steps, table, assumed, held)
    if any(std > value for std, value in zip(found.std, middle, strict=True)):
        return without(TOO_LITTLE)
    free = {
        name: Parameter(value, False, std, interval)
        for name, value, std, interval in zip(
            law.free, found.mu, found.std, found.intervals, strict=True
        )
    }
    rows = tuple(tuple(row) for row in found.covariance.tolist())
    long = (
        steps >= table.lengths[0].steps
    )  # a shorter training misses the velocity by more than the noise
    verdict = of_law.verdict(found.mu, residuals, table, noise() if long else None)
    return Judgement(free, Covariance(law.free, rows), found.bars, verdict)


def shown(members: Members, config: Config) -> int:
    """Index of the member whose fields a result shows: the one nearest to the center."""
    law, table = LAWS[config.law], calibration.load()
    return nearest(members, law, table.scatter if law.name == table.law else None)


def uncalibrated(config: Config) -> list[str]:
    """Names of the settings that differ from those of the calibration study."""
    usual = flatten(Config())
    fixed = [key for key in usual if key.split(".")[0] in DECISIVE and key not in STARTS]
    changed = [key for key in fixed if flatten(config)[key] != usual[key]]
    return changed + (["level"] if calibration.of_level(config.level) is None else [])


def _why_not(settings: Sequence[str]) -> str:
    *others, last = (level for level, path in calibration.PATHS.items() if path.exists())
    levels = f"{', '.join(others)} or {last}"
    return (
        f"no error bars and no verdict: they are calibrated for the default recipe at level "
        f"{levels}, and this run has another {', '.join(settings)}"
    )
