r"""A free curve: a uniform cubic B-spline of $\ln I$ with eight coefficients.

$$ \mu(I) = \sum_{k=1}^{8} c_k\, B(x + 2 - k), \qquad
   x = 5\, \frac{\ln(I / I_{low})}{\ln(I_{high} / I_{low})} \in [0, 5], \qquad
   6\,B(r) = (2 - |r|)_+^3 - 4\,(1 - |r|)_+^3 $$

(de Boor, A Practical Guide to Splines, 2001). x stays within 0 and 5, so mu is constant below I_low
and above I_high. Nothing makes the curve rise. I_low and I_high are the 2 % and the 98 % quantile
of I in the flow, unless they are given.
"""

from __future__ import annotations

import dataclasses
from typing import Any

from granpinn.physics.laws.law import LEAST_I, FrictionLaw, LawParameter, Values, together

COEFFICIENTS = 8
INTERVALS = COEFFICIENTS - 3


def friction(I: Values, *theta: Values) -> Values:
    """mu, of the shape of I."""
    xp, x, _, c = _place(I, theta)
    total = 0
    for k, coefficient in enumerate(c):
        r = abs(x + (1 - k))
        total = total + coefficient * (_positive(xp, 2 - r) ** 3 - 4 * _positive(xp, 1 - r) ** 3)
    return total / 6


def slope(I: Values, *theta: Values) -> Values:
    """I dmu/dI."""
    xp, x, by_log, c = _place(I, theta)
    total = 0
    for k, coefficient in enumerate(c):
        r = x + (1 - k)
        size = 4 * _positive(xp, 1 - abs(r)) ** 2 - _positive(xp, 2 - abs(r)) ** 2
        total = total + coefficient * xp.sign(r) * size
    return by_log * total / 2


def _place(I: Values, theta: tuple[Values, ...]) -> tuple[Any, Values, Values, list[Values]]:
    """The library of arrays, x, dx / d ln I and the coefficients."""
    xp, I, *c, I_low, I_high = together(I, *theta)
    rate = INTERVALS / xp.log(I_high / I_low)
    x = rate * xp.log(I / I_low + LEAST_I)
    inside = (x > 0) & (x < INTERVALS)
    return xp, xp.clip(x, 0, INTERVALS), xp.where(inside, rate, 0 * rate), c


def _positive(xp: Any, values: Values) -> Values:
    """(values)_+"""
    return xp.where(values > 0, values, 0 * values)


# A range of I of the paper's collapse, and the curve that is nearest to its mu(I) there.
_RANGE = (0.003, 0.5)
_TYPICAL = (0.4005, 0.4021, 0.4055, 0.4150, 0.4383, 0.4870, 0.5530, 0.6006)

LAW = FrictionLaw(
    name="free",
    title="free curve",
    formula=r"\mu(I) = \sum_k c_k B_k(\ln I)",
    parameters=(
        *(
            LawParameter(
                f"c{k}",
                f"c_{k}",
                start=0.4,
                typical=value,
                help=f"coefficient {k} of {COEFFICIENTS} of the curve, from small to large I",
            )
            for k, value in enumerate(_TYPICAL, 1)
        ),
        LawParameter(
            "I_low",
            r"I_\mathrm{low}",
            start=_RANGE[0],
            fixed=True,
            typical=_RANGE[0],
            quantile=0.02,
            help="inertial number I below which the curve is constant",
        ),
        LawParameter(
            "I_high",
            r"I_\mathrm{high}",
            start=_RANGE[1],
            fixed=True,
            typical=_RANGE[1],
            quantile=0.98,
            help="inertial number I above which the curve is constant",
        ),
    ),
    friction=friction,
    slope=slope,
    curve=tuple(f"c{k}" for k in range(1, COEFFICIENTS + 1)),
)

COHESION = "c"
"""The free curve with a cohesion, to ask data for both (granpinn/training/information.py)."""
WITH_COHESION = dataclasses.replace(
    LAW,
    name="free_cohesive",
    parameters=(*LAW.parameters, LawParameter(COHESION, "c", start=0.0, may_vanish=True)),
    friction=lambda I, *theta: friction(I, *theta[:-1]),
    slope=lambda I, *theta: slope(I, *theta[:-1]),
    cohesion=COHESION,
    compiled=False,
)
