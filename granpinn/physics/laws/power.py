r"""A power of the inertial number,

$$ \mu(I) = \mu_s + b\, I^n, $$

with n = 1 for disks (da Cruz, Emam, Prochnow, Roux, Chevoir, Phys. Rev. E 72, 2005), 0.4 for
spheres without friction (Peyneau and Roux, Phys. Rev. E 78, 2008).

n is fixed. Noise alone would allow to find it: in a collapse that holds one decade of I, noise of
2 % bounds its error at 0.5 %. The errors of a training do not: with n free, the last-layer step of
a simulated collapse with n = 1 went from 0.74 to 1.5 while its loss fell by 0.4 %.
"""

from __future__ import annotations

from granpinn.physics.laws.law import LEAST_I, FrictionLaw, LawParameter, Values, together


def friction(I: Values, mu_s: Values, b: Values, n: Values) -> Values:
    """mu, of the shape of I."""
    xp, I, mu_s, b, n = together(I, mu_s, b, n)
    return mu_s + b * xp.exp(n * xp.log(I + LEAST_I))


def slope(I: Values, mu_s: Values, b: Values, n: Values) -> Values:
    """I dmu/dI."""
    xp, I, mu_s, b, n = together(I, mu_s, b, n)
    return n * b * xp.exp(n * xp.log(I + LEAST_I)) + 0 * mu_s


LAW = FrictionLaw(
    name="power",
    title="power law",
    formula=r"\mu(I) = \mu_s + b\,I^n",
    parameters=(
        LawParameter("mu_s", r"\mu_s", start=0.3, may_vanish=True, help="friction at I = 0"),
        LawParameter(
            "b",
            "b",
            start=0.6,
            bounds=(0.01, 10.0),
            typical=0.6,
            may_vanish=True,
            help="rise of the friction at I = 1",
        ),
        LawParameter("n", "n", start=1.0, fixed=True, typical=1.0, help="exponent"),
    ),
    friction=friction,
    slope=slope,
)
