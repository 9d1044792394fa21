"""The expected precision for every friction law."""

import numpy as np
import pytest

from granpinn.data import Flow, add_noise
from granpinn.inspection import AssumedLaw, inspect
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


@pytest.mark.usefixtures("no_balance")
def test_the_range_of_a_free_curve_follows_from_the_flow(demo: Flow, seed: int) -> None:
    noisy = add_noise(demo, 0.02, seed)
    found = inspect(noisy, AssumedLaw(law="free"))
    numbers = found["inertial_number"]
    assert found.law.I_low < numbers.q05 < numbers.q95 < found.law.I_high < numbers.q99
    assert "c1 to c8 to " in found.sentences[0]
    given = inspect(noisy, AssumedLaw(law="free", I_high=2.0))
    assert (given.law.I_low, given.law.I_high) == (found.law.I_low, 2.0)


@pytest.mark.usefixtures("no_balance")
@pytest.mark.parametrize("name", LAWS)
def test_the_precision_of_a_law(name: str, demo: Flow, seed: int) -> None:
    """Parameters that a law holds fixed need not be determined."""
    found = inspect(add_noise(demo, 0.02, seed), AssumedLaw(law=name))
    assert found["precision"].bounds is not None
    for free, sd in found["precision"].expected.items():
        assert 0 < found["precision"].bounds.known[free] < sd
    assert set(found["precision"].expected) == set(LAWS[name].free)
    assert found.numbers()["law"]["name"] == name
    assert ("mu_2" in " ".join(found.lines())) == ("mu_2" in LAWS[name].names)


def test_a_range_upside_down_is_refused() -> None:
    with pytest.raises(ValueError, match="I_high must be above I_low = 0.3, got 0.1"):
        AssumedLaw(law="free", I_low=0.3, I_high=0.1)
