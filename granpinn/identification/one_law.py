"""Several flows of one material to one friction law: each by itself, then the law of all."""

from __future__ import annotations

import dataclasses
import hashlib
import os
from collections.abc import Sequence
from pathlib import Path

from granpinn.checks import shared_law
from granpinn.config import Config, ConfigError
from granpinn.data import Flow
from granpinn.declared import checked
from granpinn.errors import BadInput
from granpinn.fit.scoring import scalar_error
from granpinn.identification.identified import Identification
from granpinn.identification.run import run
from granpinn.output import owned
from granpinn.physics.laws import DEFAULT
from granpinn.progress import Progress
from granpinn.results import (
    DataSummary,
    ErrorPercent,
    Input,
    Parameter,
    Parameters,
    Result,
    write_results,
)
from granpinn.results.record import NONE
from granpinn.results.records import Assumed, IdentifiedLaw
from granpinn.results.result import FlowOfLaw
from granpinn.uncertainty import one_law as fitted
from granpinn.uncertainty.determined import applied, determined, with_curve
from granpinn.uncertainty.one_law import OneLaw


def identify_one_law(
    flows: Sequence[Flow | str | os.PathLike[str]],
    config: Config,
    folder: Path | None,
    progress: Progress | None,
    begin: float,
) -> Identification:
    """The law of all flows, trained side by side; arguments and errors as of `identify`.

    The subfolders 000, 001, ... get the files of each flow.

    Raises:
        ConfigError: the settings ask for another law.
        CannotGoOn: a flow does not determine mu(I).
    """
    if config.law != DEFAULT.name:
        raise ConfigError(
            f"one law of several flows is {DEFAULT.title}, got --law {config.law}: leave it out"
        )
    with owned(folder):
        if config.checks != NONE:  # what each flow says of I0
            config = dataclasses.replace(config, free_I0=True)
        configs = [config] * len(flows)
        each = run(flows, configs, config, folder, progress, begin)
        found = one_law(each)
        if folder is not None:
            write_results(found, folder / "results.json")
        return Identification.of(found, folder, each=tuple(each))


@checked
def one_law(results: Sequence[Result]) -> Identification:
    """The friction law of several flows of one material, from the results of the single flows.

    Args:
        results: of `identify` or `load`, with one given I0.

    Returns:
        The law over the range of I of all, and in `flows` what each flow is.

    Raises:
        BadInput: there are fewer than two results, or they have different I0.
        CannotGoOn: a flow does not determine mu(I).
    """
    given = sorted({r.parameters["I0"].value for r in results if "I0" in r.parameters})
    if len(results) < 2 or len(given) > 1:
        raise BadInput(
            f"expected two results or more with one given I0, got {len(results)} with I0 = "
            f"{', '.join(f'{value:g}' for value in given)}: identify all with the same settings"
        )
    law = fitted.one_law(results)
    first = results[0]
    truth = first.truth if all(r.truth == first.truth for r in results) else None
    free, name = law.estimate.parameters, shared_law.CHECK.name
    if law.reason is not None:
        free = {n: Parameter(p.value, fixed=False) for n, p in free.items()}
    values = {
        n: free.get(n) or Parameter(value, fixed=True)
        for n, value in zip(first.friction_law.names, law.fit.theta, strict=True)
    }
    errors = {n: scalar_error(p, getattr(truth, n, None)) for n, p in values.items() if not p.fixed}
    result = dataclasses.replace(
        first,
        parameters=Parameters(values),
        covariance=None if law.reason else law.estimate.covariance,
        error_bars=None if law.reason else law.estimate.bars,
        members=None,
        data=_data(results),
        input=Input(
            ", ".join(r.input.name for r in results),
            hashlib.sha256("".join(r.input.sha256 for r in results).encode()).hexdigest(),
        ),
        truth=truth,
        error_percent=ErrorPercent(errors),
        residuals=None,
        no_law=None,
        law=IdentifiedLaw(first.law.name, reason=law.reason),
        assumptions=tuple(
            _of_all(a, r, law, f) for f, r in enumerate(results) for a in r.assumptions
        ),
        flows=tuple(FlowOfLaw(r.input, r.data, r.law.I_range, r.assessment) for r in results),
        checks={} if law.reason else {name: shared_law.compared(results, law)},
        not_done={name: f"there are no error bars: {law.reason}"} if law.reason else {},
    )
    ranges = [r.law.I_range for r in results if r.law.I_range is not None]
    whole = min(low for low, _ in ranges), max(high for _, high in ranges)
    result = applied(result, determined(result, ranges))
    return Identification.of(with_curve(result, whole))


def _of_all(assumed: Assumed, result: Result, law: OneLaw, flow: int) -> Assumed:
    """An assumption of one flow, with its effect on the law of all."""
    name, example = f"{assumed.name} of", f"{assumed.example} in"
    changed = dataclasses.replace(
        assumed, name=f"{name} {result.input.name}", example=f"{example} {result.input.name}"
    )
    if assumed.derivative is None or assumed.percent is None:
        return changed
    own, joint = result.parameters, law.estimate.parameters
    moved = law.moved(flow, {n: own[n].value * p for n, p in assumed.percent.items()})
    return dataclasses.replace(
        changed,
        derivative=law.moved(flow, assumed.derivative),
        percent={n: change / joint[n].value for n, change in moved.items()},
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
