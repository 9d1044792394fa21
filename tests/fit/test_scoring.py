"""Scores against values that can be worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from granpinn.data import Flow
from granpinn.fit.scoring import relative_l2, score, strain_rate, zones_of
from granpinn.results import ErrorPercent, Fields, Parameters
from granpinn.results.fields import D2_STAGNANT, after_start, flowing
from tests.examples import PARAMETERS, make_fields
from tests.flows import make_flow


def two_zones(**changes: object) -> Flow:
    """Rest below, simple shear D2 = 3 above: u = 3 sqrt(2) (y - y_0) from the middle row on."""
    flow = make_flow(frames=4, rows=8, columns=10)
    y_0 = flow.y[4]
    shear = np.clip(flow.y - y_0, 0, None)[None, :, None] * 3 * math.sqrt(2)
    c = np.ones_like(flow.c)
    u = np.broadcast_to(shear, c.shape).astype(np.float32)
    p = np.broadcast_to((2 - flow.y)[None, :, None] * 1e4, c.shape).astype(np.float32)
    return replace(flow, c=c, u=u, v=np.zeros_like(u), p=p, **changes)


def errors_of(flow: Flow, fields: Fields, parameters: Parameters = PARAMETERS) -> ErrorPercent:
    return score(flow, fields, parameters)


def test_relative_l2_is_the_formula_of_the_paper() -> None:
    assert relative_l2(np.array([3.0, 4.0]), np.array([3.0, 4.0])) == 0
    assert relative_l2(np.zeros(5), np.arange(5.0)) == pytest.approx(100)
    # |(0, 1)| / |(3, 4)| = 1/5
    assert relative_l2(np.array([3.0, 5.0]), np.array([3.0, 4.0])) == pytest.approx(20)
    # sqrt((1 + 4) / (9 + 16 + 25)) over both components of two vectors
    vectors, errors = np.array([[3.0, 4.0], [5.0, 0.0]]), np.diag([1.0, 2.0])
    assert relative_l2(vectors + errors, vectors) == pytest.approx(100 * math.sqrt(0.1))


def test_the_strain_rate_of_a_linear_velocity_is_exact_to_the_edge() -> None:
    y, x = np.linspace(0, 1, 5), np.linspace(-2, 1, 7)
    height, width = np.meshgrid(y, x, indexing="ij")
    u, v = 0.7 * width - 1.1 * height, 0.3 * width - 0.2 * height
    expected = math.sqrt(0.7**2 + 0.2**2 + 0.5 * (0.3 - 1.1) ** 2)
    np.testing.assert_allclose(strain_rate(u, v, y, x), expected, rtol=1e-12)


def test_differences_are_of_second_order_inside_and_one_sided_at_the_edges() -> None:
    y, x = np.array([0.0, 1.0, 2.0]), np.linspace(0, 1, 5)
    u = np.broadcast_to(x**2, (3, 5))
    found = strain_rate(u, np.zeros_like(u), y, x)
    np.testing.assert_allclose(found[1], [0.25, 0.5, 1.0, 1.5, 1.75], rtol=1e-12)


def test_gaps_are_bridged_one_sided_and_lonely_points_stay_unknown() -> None:
    y, x = np.arange(4.0), np.arange(6.0)
    u = np.broadcast_to(2 * x, (4, 6)).copy()
    u[:, 2] = np.nan  # columns 0, 1 and 3, 4, 5 remain
    u[:3, 5] = np.nan  # the last point of row 3 has no neighbour along y
    found = strain_rate(u, np.zeros_like(u), y, x)
    known = np.ones((4, 6), bool)
    known[:, 2] = known[:, 5] = False
    np.testing.assert_array_equal(np.isfinite(found), known)
    np.testing.assert_allclose(found[known], 2, rtol=1e-12)


def test_flowing_is_a_threshold_in_dimensionless_units() -> None:
    fields = replace(make_fields(make_flow(frames=2)), time=2.0)  # 2 s: 0.05 is 0.025 / s
    d2 = np.array([0.0, 0.0249, D2_STAGNANT / 2, 1.0, np.nan])
    assert flowing(fields, d2).tolist() == [False, False, True, True, False]
    assert flowing(fields).all()  # the predicted D2 = 1 / s


def test_the_start_does_not_count() -> None:
    flow = make_flow(frames=3)
    fields = make_fields(replace(flow, t=flow.t - flow.t[0]))
    first = int(flow.material[0].sum())
    np.testing.assert_array_equal(after_start(fields), np.arange(fields.index.size) >= first)


def test_errors_are_split_into_flowing_and_stagnant() -> None:
    flow = two_zones()
    inside = flow.material
    rows = np.nonzero(inside)[1]
    # D2 is 3 above the kink, 1.5 on it (mean of both sides), 0 below
    flows = rows >= 4
    factor = np.where(flows, 1.1, 1.4)
    assert flow.p is not None
    fields = make_fields(flow, p=flow.p[inside] * factor, u=1.05 * flow.u[inside])
    errors = errors_of(flow, fields)
    assert errors.velocity == pytest.approx(5, rel=1e-5)
    assert errors.pressure_flowing == pytest.approx(10, rel=1e-5)
    assert errors.pressure_stagnant == pytest.approx(40, rel=1e-5)
    p_squared = flow.p[inside].astype(np.float64) ** 2
    shares = 0.1**2 * p_squared[flows].sum() + 0.4**2 * p_squared[~flows].sum()
    assert errors.pressure == pytest.approx(100 * math.sqrt(shares / p_squared.sum()), rel=1e-5)
    found = zones_of(flow, fields)
    np.testing.assert_array_equal(found, [flows, ~flows])
    assert flows.sum() == 160


@pytest.mark.parametrize("name", ["sigma_u", "sigma_v"])
@pytest.mark.parametrize("array", [False, True])
def test_the_zones_of_a_noisy_file_come_from_the_prediction(name: str, array: bool) -> None:
    sigma = np.full((4, 8, 10), 0.01, np.float32) if array else 0.01
    flow = two_zones(**{name: sigma})
    n = flow.c.size
    predicted = np.arange(n) >= 30
    found = zones_of(flow, make_fields(flow, D2=predicted))
    np.testing.assert_array_equal(found, [predicted, ~predicted])


def test_the_first_frame_of_a_file_that_starts_at_zero_is_left_out() -> None:
    flow = two_zones()
    flow = replace(flow, t=flow.t - flow.t[0])
    n, first = flow.c.size, flow.c[0].size
    wrong = np.arange(n) < first
    assert flow.p is not None
    fields = make_fields(flow, u=flow.u.ravel() + 100 * wrong, p=flow.p.ravel() + 1e9 * wrong)
    errors = errors_of(flow, fields)
    assert errors.velocity == errors.pressure == 0
