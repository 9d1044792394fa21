"""The result of several flows that have one friction law, from the fits of the flows."""

from __future__ import annotations

import dataclasses
import hashlib
import math
from collections.abc import Sequence

import numpy as np

from granpinn.config import Config
from granpinn.fit import ensemble
from granpinn.fit.case import Case
from granpinn.fit.context import Context
from granpinn.physics.laws import DEFAULT
from granpinn.results import DataSummary, ErrorPercent, Input, Parameter, Parameters, Result
from granpinn.results.records import Assumed
from granpinn.results.result import FlowOfLaw
from granpinn.uncertainty.determined import LARGEST, Range, applied, determined_over, over
from granpinn.uncertainty.error_bars import estimate, sd_of
from granpinn.uncertainty.error_model import Known, Pair, ends_of, load
from granpinn.uncertainty.expected import expected_of, too_noisy

STEPS_OF_I0 = 100_000  # with them error bars of I0 hold (bench/studies/one_law)


def with_free_I0(cases: Sequence[Case]) -> tuple[list[Case], str | None]:
    """The cases with a law whose I0 is free, if their ranges of I together determine it.

    With noise it is held, because its error bars do not hold then. An I0 in the settings that is
    not the usual one is given, and stays as it is.

    Returns:
        The cases, and a sentence on I0; None: the law has none, or it is given.
    """
    law, usual = cases[0].member.law, DEFAULT.parameter("I0").start
    if law.name != DEFAULT.name or any(usual != case.config.I0 for case in cases):
        return list(cases), None
    flows = [expected_of(case.facts, case.config.level, case.flow.of_solver) for case in cases]
    known = [flow for flow in flows if flow is not None]
    sd = sd_of(known, load())["I0"] / usual if len(known) > 1 else math.inf
    share = f"the expected error of I0 from the ranges of I of all flows is {100 * sd:.2g} %"
    if sd > LARGEST["I0"]:
        return list(cases), f"I0 is held at {usual:g}: {share}"
    if (reason := too_noisy(known)) is not None:
        return list(cases), f"I0 is held at {usual:g}: {reason}"
    free = law.with_free({"I0": usual})
    fixed = {name: value for name, value in cases[0].member.fixed.items() if name != "I0"}
    made = [
        dataclasses.replace(case, member=dataclasses.replace(case.member, law=free, fixed=fixed))
        for case in cases
    ]
    return made, f"I0 is identified: {share}"


def share_error_bars(contexts: Sequence[Context]) -> None:
    """Give the fits of all flows the error bars of their one law (uncertainty/error_bars.py).

    They have none if the fit of one flow has none.
    """
    results = [context.result for context in contexts]
    first = results[0]
    ranges = [result.law.I_range for result in results if result.law.I_range is not None]
    reason = next((_reason(result) for result in results if result.covariance is None), None)
    covariance, bars = None, None
    free: dict[str, Parameter] = {}
    if reason is None:
        assert first.members is not None
        flows = [known_of(context.result, context.case) for context in contexts]
        free, covariance, bars = estimate(first.members, flows, load(), _assumed(results))
        every = [words for r in results if r.error_bars for words in r.error_bars.outside]
        bars = dataclasses.replace(bars, outside=tuple(dict.fromkeys(every)))
    for context in contexts:
        values = {
            name: free.get(name) or dataclasses.replace(p, std=None, interval_90=None)
            for name, p in context.result.parameters.items()
        }
        result = dataclasses.replace(
            context.result,
            parameters=Parameters(values),
            covariance=covariance,
            error_bars=bars,
            law=dataclasses.replace(context.result.law, reason=reason),
        )
        context.ranges = ranges
        context.keep(result)


def result_of(contexts: Sequence[Context], config: Config) -> Result:
    """The result of all flows: their law over the range of I of all, and what each flow is.

    Args:
        contexts: their fits, with their laws over their own range of I.
        config: the settings of all.
    """
    results = [context.result for context in contexts]
    first = results[0]
    truth = first.truth if all(r.truth == first.truth for r in results) else None
    known = first.error_percent if truth is not None else {}
    result = dataclasses.replace(
        first,
        data=_data(results),
        input=Input(
            ", ".join(r.input.name for r in results),
            hashlib.sha256("".join(r.input.sha256 for r in results).encode()).hexdigest(),
        ),
        settings=dataclasses.asdict(config),
        truth=truth,
        error_percent=ErrorPercent({n: known.get(n) for n in first.friction_law.free}),
        zones=None,
        inertial_number=None,
        loss=None,
        residuals=None,
        determined=None,
        assumptions=_assumed(results),
        flows=tuple(
            FlowOfLaw(r.input, r.data, r.law.I_range, r.residuals, r.assessment) for r in results
        ),
        checks={},
        not_done={},
    )
    if result.error_bars is not None:
        outside = (*_untested(results), *result.error_bars.outside)
        bars = dataclasses.replace(result.error_bars, outside=outside)
        result = dataclasses.replace(result, error_bars=bars)
    ranges = [r.law.I_range for r in results if r.law.I_range is not None]
    if not ranges:
        return result
    low, high = min(low for low, _ in ranges), max(high for _, high in ranges)
    if first.law.name == DEFAULT.name and any(r.determined for r in results):
        I0 = result.parameters["I0"].value
        means = np.array([r.determined.I for r in results if r.determined is not None])
        x = float(np.mean(means / (means + I0)))
        found = determined_over(result, Range(low, high, I0 * x / (1 - x)), ranges)
        result = result if found is None else applied(result, found)
    return over(result, (low, high))


def known_of(result: Result, case: Case) -> Known:
    """What the fit of a flow knows of its accuracy."""
    assert result.residuals is not None
    assert result.law.I_range is not None
    mu_s, mu_2, I0 = result.theta
    x: Pair = ends_of(result.law.I_range, I0)
    known = ensemble.known_by(case, result.residuals, result.timing.steps, x, (mu_s, mu_2))
    return known._replace(I0=None if result.parameters["I0"].fixed else I0)


def _untested(results: Sequence[Result]) -> list[str]:
    """In what no study has tested the error bars of one law, in words."""
    first, found = results[0], []
    if first.error_bars is not None and first.error_bars.grains is not None:
        found.append("several flows of grains with one law")
    if not first.parameters["I0"].fixed and first.timing.steps < STEPS_OF_I0:
        found.append(f"I0 after {first.timing.steps} steps (tested: {STEPS_OF_I0})")
    return found


def _reason(result: Result) -> str:
    return f"{result.input.name}: {result.law.reason or 'its fit has no error bars'}"


def _assumed(results: Sequence[Result]) -> tuple[Assumed, ...]:
    """The assumptions of all flows, with the flow in their names; all move the one law."""
    return tuple(
        dataclasses.replace(
            a, name=f"{a.name} of {r.input.name}", example=f"{a.example} in {r.input.name}"
        )
        for r in results
        for a in r.assumptions
    )


def _data(results: Sequence[Result]) -> DataSummary:
    """The data of all flows together."""
    every = [result.data for result in results]
    vectors = [data.independent for data in every if data.independent is not None]
    return DataSummary(
        n_points=sum(data.n_points for data in every),
        n_surface=sum(data.n_surface for data in every),
        noise=every[0].noise,
        n_frames=sum(data.n_frames for data in every),
        independent=sum(vectors) if len(vectors) == len(every) else None,
    )
