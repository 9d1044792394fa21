"""The error bars of a training, or the reason why it has none."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

from granpinn.config import Config, flatten
from granpinn.physics.laws import DEFAULT, LAWS
from granpinn.results import Covariance, Parameter, Residuals
from granpinn.results.assumed import Assumed
from granpinn.results.records import ErrorBars, Members
from granpinn.uncertainty import error_bars, error_model, of_assumptions
from granpinn.uncertainty.center import center
from granpinn.uncertainty.error_model import Known

DECISIVE = ("form", "network", "rheology", "weights", "batch", "optimizer")
STARTS = ("rheology.start", "rheology.random_start")  # no influence (bench/studies/recipe)


class Judgement(NamedTuple):
    """The identified parameters, with error bars or the reason why they have none."""

    free: dict[str, Parameter]
    covariance: Covariance | None
    bars: ErrorBars | None
    reason: str | None = None


def judge(
    members: Members,
    residuals: Residuals | None,
    known: Known | None,
    config: Config,
    diverged: bool,
    symmetries: Sequence[str] = (),
    assumed: Sequence[Assumed] = (),
) -> Judgement:
    """The error bars of a training.

    Args:
        known: what the run knows of its accuracy; None: no grains shear, or another law.
        symmetries: of the flow, in words (granpinn/data/symmetry.py).
        assumed: assumptions whose effect enters the error bars.
    """
    law, middle = LAWS[config.law], center(members, LAWS[config.law])

    def without(reason: str) -> Judgement:
        values = (Parameter(value, fixed=False) for value in middle)
        free = dict(zip(law.free, values, strict=True))
        return Judgement(free, None, None, reason)

    if diverged or residuals is None:
        return without("the training diverged")
    if law is not DEFAULT:
        return without(f"there are error bars for {DEFAULT.title} only")
    if changed := untested(config):
        return without(
            f"the error bars are those of the default recipe, and this run has another "
            f"{', '.join(changed)}"
        )
    if known is None:
        return without("no grains shear")
    if missing := of_assumptions.unknown(assumed):
        return without(f"the effect of the {' and '.join(missing)} is not known")
    found = error_bars.estimate(members, known, error_model.load(), assumed)
    bars = found.bars
    if not known.real:  # grains of all kinds were tested, of simulated flows collapses
        unlike = tuple(f"a flow that is {words.partition(':')[0]}" for words in symmetries)
        bars = dataclasses.replace(bars, outside=(*unlike, *bars.outside))
    return Judgement(found.parameters, found.covariance, bars)


def untested(config: Config) -> list[str]:
    """Names of the settings that differ from those that the error model was made with."""
    usual, own = flatten(Config()), flatten(config)
    decisive = [key for key in usual if key.split(".")[0] in DECISIVE and key not in STARTS]
    return [key for key in decisive if own[key] != usual[key]]
