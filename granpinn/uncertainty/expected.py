"""Several flows of one material before their training: how well they fix one law, and which next.

The errors are those of the error model for good fits with the usual law
(uncertainty/error_bars.py). A further experiment is the range of I that it would show: of a
collapse of a column W wide, 0.2 to 6 times d/W; of a chute that is filmed from rest, 0.05 to 0.5
times the I of its steady (Bagnold) flow, for which mu(I) is the tangent of the slope. These factors
are typical of ten of the simulated pairs of bench/studies/one_law. The depth of a layer changes the
time in which it gets there, not its I. Drums are left out: no simple model gives their I.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from granpinn.data import Flow
from granpinn.data.scaling import scales_of
from granpinn.data.symmetry import steady_mean
from granpinn.estimates.facts import Facts, inertial_numbers
from granpinn.physics.laws import mu_of_i
from granpinn.uncertainty.determined import percentiles
from granpinn.uncertainty.error_bars import sd_of
from granpinn.uncertainty.error_model import Known, ends_of, load

COLLAPSE, CHUTE = (0.2, 6.0), (0.05, 0.5)
NOISE_OF_I0 = 0.01  # over the rms speed; error bars of I0 hold up to it (bench/studies/one_law)
WIDTHS = (100, 50, 25)  # of a column, grain diameters
SLOPES = (0.3, 0.5, 0.7, 0.85)  # (tan slope - mu_s) / (mu_2 - mu_s)


def expected_of(facts: Facts, level: str, of_solver: bool) -> Known | None:
    """What is known of the accuracy of a flow before its training, with the usual law.

    None if no vector shears.
    """
    numbers = inertial_numbers(facts)
    I_range = percentiles(numbers.I[numbers.flows], numbers.vectors[numbers.flows])
    if I_range is None:
        return None
    noise = math.sqrt(2) * facts.relative_noise
    return _of_range(I_range, not of_solver)._replace(
        misfit=noise,
        noise=noise,
        vectors=facts.independent,
        outline=level == "V0",
    )


def _of_range(I_range: tuple[float, float], real: bool) -> Known:
    mu_s, mu_2, I0 = (p.typical for p in mu_of_i.LAW.parameters)
    return Known(ends_of(I_range, I0), (mu_s, mu_2), real=real, I0=I0)


def too_noisy(flows: Sequence[Known]) -> str | None:
    """Why error bars of an identified I0 would not hold, in words; None if they hold."""
    noise = max((flow.noise for flow in flows), default=0.0)
    if noise <= NOISE_OF_I0:
        return None
    return (
        f"the noise of a flow is {100 * noise:.2g} % of its speed, and error bars of I0 hold up to "
        f"{100 * NOISE_OF_I0:g} %"
    )


def experiments() -> dict[str, tuple[float, float]]:
    """The ranges of I of standard experiments with the usual law, by their names."""
    mu_s, mu_2, I0 = (p.typical for p in mu_of_i.LAW.parameters)
    ranges = {
        f"collapse of a column {width} grains wide": (COLLAPSE[0] / width, COLLAPSE[1] / width)
        for width in WIDTHS
    }
    for x in SLOPES:
        angle = math.degrees(math.atan(mu_s + x * (mu_2 - mu_s)))
        name = f"chute from rest, {angle:.0f} degrees (tan = mu_s + {x:g} (mu_2 - mu_s))"
        ranges[name] = (CHUTE[0] * I0 * x / (1 - x), CHUTE[1] * I0 * x / (1 - x))
    return ranges


def percent(flows: Sequence[Known]) -> dict[str, float]:
    """Expected standard deviations in %: mu_s and mu_2 with I0 known; mu_2 and I0 with I0 free."""
    given = sd_of([flow._replace(I0=None) for flow in flows], load())
    free, values = sd_of(flows, load()), flows[0].parameters
    rows = {name: 100 * sd / values[name] for name, sd in given.items()}
    return rows | {f"{name}, I0 free": 100 * free[name] / values[name] for name in ("mu_2", "I0")}


def lines(flows: Sequence[Flow]) -> list[str]:
    """What several flows of one material determine together, and what one more would add."""
    text, every = [], []
    for flow in map(steady_mean, flows):
        name = "in memory" if flow.path is None else flow.path.name
        level = "V0" if flow.surface is None else "V1"
        known = expected_of(Facts(flow, scales_of(flow)), level, flow.of_solver)
        if known is None:
            text.append(f"{name}: no grains shear")
            continue
        assert known.I0 is not None
        low, high = (known.I0 * x / (1 - x) for x in known.x)
        text.append(f"{name}: I = {low:.2g} to {high:.2g}")
        every.append(known)
    if not every:
        return text
    now = percent(every)
    text += ["", f"{'expected standard deviation, %':58}" + "".join(f"{n:>15}" for n in now)]
    text.append(_row("these flows with one law", now))
    real = any(flow.real for flow in every)
    for name, I_range in experiments().items():
        text.append(_row(f"and a {name}", percent([*every, _of_range(I_range, real)])))
    if (reason := too_noisy(every)) is not None:
        text.append(f"a training holds I0: {reason}")
    return text


def _row(name: str, values: dict[str, float]) -> str:
    return f"{name:58}" + "".join(f"{value:15.2g}" for value in values.values())
