"""The expected precision for every friction law."""

import numpy as np
import pytest

from granpinn.inspection import AssumedLaw
from granpinn.inspection.precision import expected_precision, sensitivities
from granpinn.physics.laws import LAWS


def test_bound_of_one_parameter() -> None:
    """Constant friction shows at every inertial number: a calculation by hand."""
    gamma_dot, I, n = np.array([2.0, 2.0]), np.array([1e-9, 1e9]), np.array([100.0, 400.0])
    found = expected_precision(gamma_dot, I, n, 0.1, AssumedLaw(0.5, law="coulomb"))
    assert found is not None
    assert found.known == found.unknown
    assert found.known["mu_s"] == pytest.approx(0.1 / (0.097 * 2 * 500**0.5) / 0.5)
    assert found.correlation is None


@pytest.mark.parametrize("name", LAWS)
def test_sensitivities_are_derivatives(name: str) -> None:
    """With a cohesion, of ln(c + mu p) times mu; without, p has no effect."""
    law, step = AssumedLaw(law=name), 1e-6
    I, p = np.geomspace(1e-3, 10, 20), np.geomspace(1, 0.1, 20)
    friction, theta = law.friction_law.friction, np.array(law.theta)

    def value(at: np.ndarray) -> np.ndarray:
        mu = friction(I, *at)
        if law.friction_law.cohesion is None:
            return mu
        return friction(I, *theta) * np.log(law.friction_law.cohesion_of(at) + mu * p)

    for k, derivative in enumerate(sensitivities(I, law, p).T):
        change = step * np.eye(len(theta))[k]
        up, down = (value(theta + s * change) for s in (1, -1))
        np.testing.assert_allclose(derivative, (up - down) / (2 * step), rtol=1e-6, atol=1e-9)
