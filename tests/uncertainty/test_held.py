"""Error bars on data that hold other inertial numbers than the calibration, or noise."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from granpinn.results import Residuals
from granpinn.results.records import Members
from granpinn.uncertainty import calibration, error_bars
from granpinn.uncertainty.held import Held, NoiseError, ReachError, by_noise, carried, ends_of, line

MU = (0.4, 0.64)
USUAL = (0.02, 0.28)
REACH = ReachError(USUAL, (1.0, 1.0), (0.0, 0.0), 60, "here")
NOISE = NoiseError((0.05, 0.08), (1.0, 0.5), -0.5, 60_000.0, 60, "here")
TABLE = dataclasses.replace(calibration.load(), reach=REACH, noise=NOISE, misfit=1e-3)
CLEAN = Residuals(
    velocity=1e-4, noise=0.0, surface=1e-5, momentum=1e-6, continuity=1e-6, constitutive=1e-6
)


def friction_errors(D: np.ndarray, x: tuple[float, float]) -> np.ndarray:
    """Relative standard deviations of mu at x, from the second moment of z: an own derivation."""
    sd = []
    for at in x:
        a = np.array([1 - at, at])
        mu = MU[0] * (1 - at) + MU[1] * at
        sd.append(MU[0] * np.sqrt(a @ D @ a) / mu)
    return np.array(sd)


def members(*redrawn: bool) -> Members:
    n = len(redrawn)
    values = {"mu_s": (MU[0],) * n, "mu_2": (MU[1],) * n}
    return Members(seed=tuple(range(n)), values=values, redrawn=redrawn)


def test_the_ends_of_a_range() -> None:
    assert ends_of((0.1, 0.3), 0.3) == pytest.approx((0.25, 0.5))
    low, high = ends_of((0.1, 0.1), 0.3)
    assert low < high
    np.testing.assert_allclose(line((0.0, 1.0)), np.eye(2))


def test_errors_of_friction_pass_from_flow_to_flow() -> None:
    D = np.array([[4e-5, -1e-4], [-1e-4, 9e-4]])
    x = (0.01, 0.1)
    found = carried(D, MU, x, REACH)
    np.testing.assert_allclose(friction_errors(found, x), friction_errors(D, USUAL), rtol=1e-9)
    assert found[1, 1] > 4 * D[1, 1]  # mu_2 is a longer continuation
    np.testing.assert_allclose(carried(D, MU, USUAL, REACH), D, rtol=1e-9)


def test_errors_at_the_upper_end_grow_as_it_falls() -> None:
    D = np.diag([4e-5, 9e-4])
    grows = dataclasses.replace(REACH, power=(0.0, 2.0), size=(1.5, 1.0))
    x = (0.01, 0.14)
    expected = friction_errors(D, USUAL) * np.array([1.5, 2.0**2])
    np.testing.assert_allclose(friction_errors(carried(D, MU, x, grows), x), expected, rtol=1e-9)
    far = (0.01, 0.5)  # a flow that reaches more is not trusted more at the ends of its range
    expected = friction_errors(D, USUAL) * np.array([1.5, 1.0])
    np.testing.assert_allclose(
        friction_errors(carried(D, MU, far, grows), far), expected, rtol=1e-9
    )


def test_noise_adds_errors_by_its_powers_and_the_number_of_vectors() -> None:
    x = (0.01, 0.2)
    held = Held(x, noise=0.1, vectors=15_000.0)
    found = by_noise(MU, held, NOISE)
    np.testing.assert_allclose(friction_errors(found, x), [0.05 * 0.2, 0.08 * 0.2**0.5], rtol=1e-9)
    more = by_noise(MU, held._replace(vectors=60_000.0), NOISE)
    assert more[0, 0] < found[0, 0]


def test_intervals_widen_with_noise_and_with_a_smaller_range() -> None:
    def half(held: Held | None, *redrawn: bool) -> np.ndarray:
        known = error_bars.estimate(members(*(redrawn or (False,))), CLEAN, 40_000, TABLE, (), held)
        return np.array([high - low for low, high in known.intervals])

    usual = half(Held(USUAL))
    np.testing.assert_allclose(half(None), usual, rtol=1e-9)
    assert (half(Held(USUAL, 0.3, 60_000.0)) > 1.5 * usual).all()
    assert half(Held((0.005, 0.08)))[1] > 2 * usual[1]
    # members with a second draw of the noise share its bias
    again = half(Held(USUAL, 0.3, 60_000.0), False, True), half(Held(USUAL), False, True)
    assert (again[0] > 1.5 * again[1]).all()


def test_the_shipped_tables_know_other_data() -> None:
    for level in ("V0", "V1"):
        table = calibration.of_level(level)
        assert table is not None
        assert table.reach is not None
        assert table.noise is not None
        assert min(table.reach.size) >= 1


@pytest.mark.parametrize("x", [(0.3, 0.2), (-0.1, 0.2), (0.1, 1.0)])
def test_impossible_ends_are_refused(x: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="must ascend"):
        dataclasses.replace(REACH, x=x)


@pytest.mark.parametrize(
    "change", [{"size": (0.0, 0.1)}, {"power": (1.0, -1.0)}, {"correlation": 1.0}, {"vectors": 0.0}]
)
def test_impossible_effects_of_noise_are_refused(change: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="must be positive"):
        dataclasses.replace(NOISE, **change)  # type: ignore[arg-type]
