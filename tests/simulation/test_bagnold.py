"""Bagnold flow: a layer that runs down an incline, with the friction law alone.

With gravity tilted by theta and mu_s < tan(theta) < mu_2, mu(I) = tan(theta) everywhere, so
I_theta = I0 (tan(theta) - mu_s) / (mu_2 - tan(theta)), p = rho g cos(theta) (H - y) and
u = 2/3 I_theta/d sqrt(g cos(theta)) (H^(3/2) - (H - y)^(3/2)).
"""

import numpy as np
import pytest

from tests.simulation import problems as p

TAN, D = 0.5, 0.1


def bagnold_error(cells: int) -> tuple[float, float]:
    """Relative errors of velocity and pressure after a long time, from 0.9 of the solution."""
    s, cosine = p.incline(cells, TAN, grain_diameter=D), 1 / np.sqrt(1 + TAN**2)
    mu_s, mu_2, I0 = s.theta
    i_theta = I0 * (TAN - mu_s) / (mu_2 - TAN)

    def exact(y: p.Array) -> p.Array:
        return 2 / 3 * i_theta / D * np.sqrt(cosine) * (1 - np.abs(1 - y) ** 1.5)

    state = p.steady_from(s, lambda y: 0.9 * exact(y))
    _, y = p.centers(s)
    return p.relative(state["u"], exact(y)), p.relative(state["p"], cosine * (1 - y))


def test_bagnold_flow() -> None:
    errors = [bagnold_error(n) for n in (16, 32, 64)]
    velocity = [e[0] for e in errors]
    assert velocity[-1] < 1e-4
    assert p.order(velocity) == pytest.approx(2, abs=0.1)
    assert max(e[1] for e in errors) < 1e-10


@pytest.mark.parametrize("tangent", [0.3])
def test_layer_on_a_gentle_incline_stays(tangent: float) -> None:
    """tan(theta) < mu_s: nothing but creep at the largest viscosity."""
    s = p.incline(32, tangent, largest_step=0.1)
    solver = p.start(s)
    reports = p.run(solver, 5.0, 0.1)
    creep = s.gravity_x / (2 * s.eta_max)
    assert reports[-1]["largest_speed"] == pytest.approx(creep, rel=0.1)
