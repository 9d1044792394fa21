"""Bagnold flow: a layer that runs down an incline, with the friction law alone.

With gravity tilted by theta and k = 2 mu_w / W of side walls, mu(I) = tan(theta) - k z / 2 at the
depth z (Jop, Forterre and Pouliquen 2005), p = rho g cos(theta) z, and du/dz = -I sqrt(p) / d.
"""

import numpy as np
import pytest

from tests.simulation import problems as p

TAN, D = 0.5, 0.1


def errors_of_the_steady_state(cells: int, wall: float) -> tuple[float, float]:
    """Relative errors of velocity and pressure after a long time, from 0.9 of the solution."""
    s = p.incline(cells, TAN, grain_diameter=D, side_wall=wall, side_wall_speed=1e-6)
    cosine = 1 / np.sqrt(1 + TAN**2)
    mu_s, mu_2, I0 = s.theta
    fine = np.linspace(0, 1, 40_001)
    mu = TAN - wall / 2 * (1 - fine)
    rate = I0 * (mu - mu_s) / (mu_2 - mu) * np.sqrt(cosine * (1 - fine)) / D
    profile = np.concatenate([[0], np.cumsum((rate[1:] + rate[:-1]) / 2) * fine[1]])

    def exact(y: p.Array) -> p.Array:
        return np.interp(y, fine, profile)

    state = p.steady_from(s, lambda y: 0.9 * exact(y))
    _, y = p.centers(s)
    return p.relative(state["u"], exact(y)), p.relative(state["p"], cosine * (1 - y))


@pytest.mark.parametrize(
    ("wall", "finest", "within"), [(0.0, 1e-4, 0.1), (0.1, 3e-4, 0.2)], ids=["free", "side walls"]
)
def test_bagnold_flow(wall: float, finest: float, within: float) -> None:
    errors = [errors_of_the_steady_state(n, wall) for n in (16, 32, 64)]
    velocity = [e[0] for e in errors]
    assert velocity[-1] < finest
    assert p.order(velocity) == pytest.approx(2, abs=within)
    assert max(e[1] for e in errors) < 1e-10
