"""A flow between side walls gives its law with their friction, and a wrong one without it."""

from __future__ import annotations

import numpy as np
import pytest

from granpinn import identify
from granpinn.fit import assumptions
from granpinn.fit.case import pose
from granpinn.physics.laws import mu_of_i
from granpinn.results import Result
from tests.flows import make_channel, make_chute
from tests.runs import tiny

FRICTION = 0.3
RANGE = np.array([0.05, 0.1, 0.2])  # I of the flow: 0.04 to 0.3


def identified(friction: float, sd: float = 0.0) -> Result:
    settings = {
        "steps": 4000,
        "network__widths": (32, 32),
        "batch__interior": 256,
        "batch__surface": 16,
        "batch__collocation": 8.0,
        "side_walls__friction": friction,
        "side_walls__friction_sd": sd,
    }
    flow = make_channel(friction=FRICTION, rows=120)
    flow.attributes["surface_sd"] = 0.0
    return identify(flow, tiny(**settings))


def test_the_friction_of_the_walls_is_told_from_that_of_the_grains() -> None:
    truth = mu_of_i.friction(RANGE, 0.3, 0.7, 0.3)
    with_walls = identified(FRICTION)
    np.testing.assert_allclose(mu_of_i.friction(RANGE, *with_walls.theta), truth, rtol=0.02)
    assert with_walls.assumptions == ()
    assert with_walls.checks["momentum_balance"].balance.wall_friction == FRICTION
    # without the term, the walls count as friction between grains: mu_w z / W = 0.12 on average
    without = identified(0.0)
    assert (mu_of_i.friction(RANGE, *without.theta) - truth)[:2].min() > 0.06
    assert without.theta[0] == pytest.approx(0.5, abs=0.05)  # the slope, at every depth


def test_the_law_by_the_friction_of_the_walls() -> None:
    """Its derivative at every depth is -z / W = (mu - tan) / mu_w, which is linear in I/(I + I0).

    So it is (0.3 - 0.5) / 0.3 in mu_s and (0.7 - 0.5) / 0.3 in mu_2.
    """
    (walls,) = identified(FRICTION, 0.05).assumptions
    assert walls.derivative == pytest.approx({"mu_s": -2 / 3, "mu_2": 2 / 3}, rel=0.1)
    assert (walls.sd, walls.unit) == (0.05, "1")
    assert "friction of the side walls higher by 0.01: mu_s -2." in str(walls)


def test_friction_is_not_negative_in_either_training() -> None:
    case = pose(
        make_channel(rows=14), tiny(side_walls__friction=0.02, side_walls__friction_sd=0.05)
    )
    found = assumptions.side_walls(case)
    assert found is not None
    k = [member.problem.physics.side_wall for member in found.pair()]
    assert k[0] == 0
    height = case.scales.length
    assert k[1] == pytest.approx(2 * 0.1 * height / 24)
    for friction, sd in ((0.0, 0.05), (0.1, 0.0)):
        walls = tiny(side_walls__friction=friction, side_walls__friction_sd=sd)
        assert assumptions.side_walls(pose(make_channel(rows=14), walls)) is None
    assert assumptions.side_walls(pose(make_chute(), tiny())) is None
