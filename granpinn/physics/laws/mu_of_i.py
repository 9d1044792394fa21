r"""The mu(I) law, equation (2) of the paper (Jop, Forterre, Pouliquen, Nature 441, 2006).

$$ \mu(I) = \mu_s + \frac{\mu_2 - \mu_s}{1 + I_0 / I} $$
"""

from __future__ import annotations

from granpinn.physics.laws.law import FrictionLaw, LawParameter, Values


def friction(I: Values, mu_s: Values, mu_2: Values, I0: Values) -> Values:
    """mu(I), multiplied out by I so that I = 0 gives mu_s instead of a division by zero."""
    return mu_s + (mu_2 - mu_s) * I / (I0 + I)


def slope(I: Values, mu_s: Values, mu_2: Values, I0: Values) -> Values:
    """I dmu/dI."""
    return I * (mu_2 - mu_s) * I0 / (I0 + I) ** 2


LAW = FrictionLaw(
    name="mu_of_i",
    title="mu(I)",
    formula=r"\mu(I) = \mu_s + (\mu_2 - \mu_s) / (1 + I_0 / I)",
    parameters=(
        LawParameter("mu_s", r"\mu_s", start=0.3, may_vanish=True, help="friction at small I"),
        LawParameter(
            "mu_2",
            r"\mu_2",
            start=0.6,
            variable="log_above",
            typical=0.64,
            may_vanish=True,
            help="friction at large I, at least mu_s",
        ),
        LawParameter(
            "I0",
            "I_0",
            start=0.3,
            fixed=True,
            typical=0.3,
            help="inertial number I at which friction is half way from mu_s to mu_2",
        ),
    ),
    friction=friction,
    slope=slope,
    inertial_scale="I0",
)
