"""Bagnold flow: a layer that runs down an incline, with the friction law alone.

With gravity tilted by theta and mu_s < tan(theta) < mu_2, mu(I) = tan(theta) everywhere, so
I_theta = I0 (tan(theta) - mu_s) / (mu_2 - tan(theta)), p = rho g cos(theta) (H - y) and
u = 2/3 I_theta/d sqrt(g cos(theta)) (H^(3/2) - (H - y)^(3/2)).
"""

import numpy as np
import pytest

from granpinn._collapse import Side
from tests.simulation import problems as p

TAN, D = 0.5, 0.1


def bagnold_error(cells: int) -> tuple[float, float]:
    """Relative errors of velocity and pressure after a long time, from 0.9 of the solution."""
    cosine = 1 / np.sqrt(1 + TAN**2)
    s = p.parameters(
        8,
        cells,
        1 / cells,
        newtonian=False,
        eta_max=1e4,
        grain_diameter=D,
        gravity_x=TAN * cosine,
        gravity_y=-cosine,
        left=Side.periodic,
        right=Side.periodic,
        air_density=0.0,
        largest_step=1.0,
        cfl=1e3,  # nothing is advected: the flow is uniform along the incline
    )
    mu_s, mu_2, I0 = s.theta
    i_theta = I0 * (TAN - mu_s) / (mu_2 - TAN)

    def exact(y: p.Array) -> p.Array:
        return 2 / 3 * i_theta / D * np.sqrt(cosine) * (1 - np.abs(1 - y) ** 1.5)

    solver = p.start(s, u=lambda x, y: 0.9 * exact(y) + 0 * x)
    p.run(solver, 600.0, 1.0)
    state = solver.state()
    _, y = p.centers(s)
    velocity = np.linalg.norm(state["u"] - exact(y)) / np.linalg.norm(exact(y) + 0 * state["u"])
    weight = cosine * (1 - y)
    pressure = np.linalg.norm(state["p"] - weight) / np.linalg.norm(weight + 0 * state["p"])
    return float(velocity), float(pressure)


def test_bagnold_flow() -> None:
    errors = [bagnold_error(n) for n in (16, 32, 64)]
    velocity = [e[0] for e in errors]
    assert velocity[-1] < 1e-4
    assert p.order(velocity) == pytest.approx(2, abs=0.1)
    assert max(e[1] for e in errors) < 1e-10


@pytest.mark.parametrize("tangent", [0.3])
def test_layer_on_a_gentle_incline_stays(tangent: float) -> None:
    """tan(theta) < mu_s: nothing but creep at the largest viscosity."""
    cosine = 1 / np.sqrt(1 + tangent**2)
    s = p.parameters(8, 32, 1 / 32, newtonian=False, eta_max=1e4, air_density=0.0)
    s.gravity_x, s.gravity_y = tangent * cosine, -cosine
    s.left = s.right = Side.periodic
    s.largest_step = 0.1
    solver = p.start(s)
    reports = p.run(solver, 5.0, 0.1)
    creep = s.gravity_x / (2 * s.eta_max)
    assert reports[-1]["largest_speed"] == pytest.approx(creep, rel=0.1)
