r"""Cohesive grains: friction mu(I) and a cohesion c, a stress (Coulomb 1773, with mu(I)),

$$ |\tau| = c + \mu(I)\, p, \qquad \mu(I) = \mu_s + \frac{\mu_2 - \mu_s}{1 + I_0 / I}. $$

The curve of this law is mu(I), without c. Cohesion enters the equations as a level of the pressure
does: for constant friction, grains with c under the pressure p move as grains without it under
p + c / mu (Caquot 1934). So only the given pressure of the free surface tells c from friction.
"""

from __future__ import annotations

from granpinn.physics.laws import mu_of_i
from granpinn.physics.laws.law import FrictionLaw, LawParameter, Values


def friction(I: Values, mu_s: Values, mu_2: Values, I0: Values, c: Values) -> Values:
    """mu(I), of the shape of I; c has no effect."""
    return mu_of_i.friction(I, mu_s, mu_2, I0) + 0 * c


def slope(I: Values, mu_s: Values, mu_2: Values, I0: Values, c: Values) -> Values:
    """I dmu/dI."""
    return mu_of_i.slope(I, mu_s, mu_2, I0) + 0 * c


LAW = FrictionLaw(
    name="cohesive",
    title="cohesive mu(I)",
    formula=r"|\tau| = c + \mu(I)\,p,\quad \mu(I) = \mu_s + (\mu_2 - \mu_s) / (1 + I_0 / I)",
    parameters=(
        *mu_of_i.LAW.parameters,
        LawParameter(
            "c",
            "c",
            start=0.01,
            bounds=(1e-5, 1.0),
            typical=0.01,
            may_vanish=True,
            help="cohesion, the yield stress at p = 0",
        ),
    ),
    friction=friction,
    slope=slope,
    inertial_scale="I0",
    cohesion="c",
)
