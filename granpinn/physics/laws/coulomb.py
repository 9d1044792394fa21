"""Constant friction, mu = mu_s at every I (Coulomb)."""

from __future__ import annotations

from granpinn.physics.laws.law import FrictionLaw, LawParameter, Values


def friction(I: Values, mu_s: Values) -> Values:
    """mu, of the shape of I."""
    return mu_s + 0 * I


def slope(I: Values, mu_s: Values) -> Values:
    """I dmu/dI = 0."""
    return 0 * (I * mu_s)


LAW = FrictionLaw(
    name="coulomb",
    title="constant friction",
    formula=r"\mu = \mu_s",
    parameters=(LawParameter("mu_s", r"\mu_s", start=0.3, may_vanish=True, help="friction"),),
    friction=friction,
    slope=slope,
)
