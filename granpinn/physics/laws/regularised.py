r"""The partially regularised mu(I) law (Barker and Gray, J. Fluid Mech. 828, 2017, 5-32).

$$ \mu(I) = \sqrt{\frac{\alpha}{\ln(A/I)}} \quad (I \le I_1), \qquad
   \mu(I) = \frac{\mu_s I_0 + \mu_2 I + \mu_\infty I^2}{I_0 + I} \quad (I > I_1), \qquad
   A = I_1 \exp\frac{\alpha\,(I_0 + I_1)^2}{(\mu_s I_0 + \mu_2 I_1 + \mu_\infty I_1^2)^2}. $$

mu is continuous at I_1 and I mu'(I) jumps there, from mu(I_1)^3 / (2 alpha) to the slope of the
second branch. The equations are well-posed below I_1 for alpha < 2.

The source takes the least I at which mu(I) is well-posed for I_1: 0.004 for its glass beads. Here
I_1 is a parameter of its own. Another deviation: I + 1e-30 under the logarithm, so that mu at
I = 0 is small (0.15) instead of 0, and 1/mu is finite.
"""

from __future__ import annotations

from granpinn.physics.laws import mu_of_i
from granpinn.physics.laws.law import LEAST_I, FrictionLaw, LawParameter, Values, together


def friction(I: Values, *theta: Values) -> Values:
    """mu, of the shape of I."""
    xp, I, *values = together(I, *theta)
    mu_s, mu_2, I0, mu_inf, alpha, I1 = values
    creep = xp.sqrt(alpha / _logarithm(xp, I, *values))
    return xp.where(I < I1, creep, (mu_s * I0 + mu_2 * I + mu_inf * I**2) / (I0 + I))


def slope(I: Values, *theta: Values) -> Values:
    """I dmu/dI."""
    xp, I, *values = together(I, *theta)
    mu_s, mu_2, I0, mu_inf, alpha, I1 = values
    L = _logarithm(xp, I, *values)
    inertial = I * ((mu_2 - mu_s) * I0 + mu_inf * I * (2 * I0 + I)) / (I0 + I) ** 2
    return xp.where(I < I1, xp.sqrt(alpha / L) / (2 * L), inertial)


def _logarithm(
    xp: Values,
    I: Values,
    mu_s: Values,
    mu_2: Values,
    I0: Values,
    mu_inf: Values,
    alpha: Values,
    I1: Values,
) -> Values:
    """ln(A / I) below I_1; that at I_1 above."""
    mu_1 = (mu_s * I0 + mu_2 * I1 + mu_inf * I1**2) / (I0 + I1)
    below = xp.where(I < I1, I, I1) + LEAST_I
    return xp.log(I1) - xp.log(below) + alpha / mu_1**2


LAW = FrictionLaw(
    name="regularised",
    title="regularised mu(I)",
    formula=r"\mu = \sqrt{\alpha / \ln(A/I)}\ (I \le I_1),\quad "
    r"(\mu_s I_0 + \mu_2 I + \mu_\infty I^2) / (I_0 + I)\ (I > I_1)",
    parameters=(
        LawParameter("mu_s", r"\mu_s", start=0.3, help="friction just above I1"),
        LawParameter(
            "mu_2",
            r"\mu_2",
            start=0.6,
            variable="log_above",
            typical=0.64,
            help="friction at I well above I0, without the part of mu_inf",
        ),
        mu_of_i.LAW.parameter("I0"),
        LawParameter(
            "mu_inf",
            r"\mu_\infty",
            start=0.05,
            fixed=True,
            typical=0.05,
            may_vanish=True,
            help="slope of the friction at the largest I",
        ),
        LawParameter(
            "alpha",
            r"\alpha",
            start=1.9,
            fixed=True,
            typical=1.9,
            help="the friction of creep, well-posed below 2",
        ),
        LawParameter(
            "I1",
            "I_1",
            start=0.004,
            fixed=True,
            typical=0.004,
            help="inertial number I below which grains creep",
        ),
    ),
    friction=friction,
    slope=slope,
    inertial_scale="I0",
)
