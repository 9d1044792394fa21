"""Uncertain assumptions: their effect on the law, and their part of the error bars."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from granpinn import results
from granpinn.config import Config
from granpinn.data import Flow
from granpinn.fit import assumptions
from granpinn.fit.case import pose
from granpinn.identification import start
from granpinn.identification.identify import identify, identify_many
from granpinn.kernels.builds import choose_device
from granpinn.results.records import Assumed
from granpinn.uncertainty import sensitivity
from granpinn.uncertainty.error_bars import covariance, judge
from granpinn.uncertainty.error_model import Known
from granpinn.uncertainty.sensitivity import Assumption, effects
from tests.examples import make_result
from tests.flows import make_flow
from tests.runs import make_trainer, tiny

LINE = Assumed("surface line", "m", 0.01, "one grain higher", {"mu_s": 2.0, "mu_2": -5.0})


def solver(**changes: Any) -> Flow:
    return make_flow(attributes={"grid_spacing_of_solver": 0.04}, **changes)


def test_the_covariance_of_assumptions() -> None:
    other = dataclasses.replace(LINE, sd=1.0, derivative={"mu_s": 0.0, "mu_2": 0.1})
    expected = [[4e-4, -1e-3], [-1e-3, 2.5e-3 + 0.01]]
    np.testing.assert_allclose(covariance([LINE, other], ("mu_s", "mu_2")), expected)
    lost = dataclasses.replace(LINE, derivative=None)
    assert not covariance([lost], ("mu_s", "mu_2")).any()


def test_no_error_bars_where_an_effect_is_not_known() -> None:
    example = make_result()
    lost = dataclasses.replace(LINE, derivative=None, why=sensitivity.DIVERGED)
    known = Known((0.02, 0.3), (0.4, 0.64))
    arguments = example, known, Config()
    assert not isinstance(judge(*arguments, (LINE,)), str)
    assert judge(*arguments, (lost,)) == "the effect of the surface line is not known"


def test_the_derivative_is_the_difference_of_two_trainings(monkeypatch: pytest.MonkeyPatch) -> None:
    """The copies are a pair for each assumption, one standard deviation lower and higher."""
    trainer = make_trainer(tiny(), make_flow())
    member = trainer.objective.members[0]
    seen = []

    def continued(_: Any, copies: Any, most: int) -> list[Tensor | None]:
        seen.append((copies, most))
        return [torch.tensor(t) for t in ([0.3, 0.7, 0.3], [0.4, 0.5, 0.3])] + [None, None]

    monkeypatch.setattr(sensitivity, "continued", continued)

    def assumption(name: str) -> Assumption:
        return Assumption(Assumed(name, "m", 0.02, "5 mm higher"), lambda: (member, member), 0.005)

    (found,) = effects(trainer, {0: [assumption("line"), assumption("wall")]}).values()
    assert [e for e, _ in seen[0][0]] == [0, 0, 0, 0]
    line, wall = found
    assert line.derivative == pytest.approx({"mu_s": 2.5, "mu_2": -5.0})
    mu_s, mu_2, _ = trainer.solution(0)[1].tolist()
    assert line.percent == pytest.approx({"mu_s": 1.25 / mu_s, "mu_2": -2.5 / mu_2})
    assert str(line).startswith(f"5 mm higher: mu_s {1.25 / mu_s:+.1f} %")
    assert str(line).endswith("(line known to 0.02 m)")
    assert wall.derivative is None
    assert "its effect is not known: a training with" in str(wall)
    assert effects(trainer, {}) == {}


def test_the_surface_line_moves_by_its_standard_deviation() -> None:
    flow = make_flow()
    there = flow.c > 0  # partly filled cells have vectors, too
    flow = dataclasses.replace(
        flow,
        u=np.where(there, np.nan_to_num(flow.u, nan=0.1), np.nan).astype(np.float32),
        v=np.where(there, np.nan_to_num(flow.v, nan=-0.1), np.nan).astype(np.float32),
    )
    case = pose(flow, tiny())
    found = assumptions.surface(case)
    assert found is not None
    lower, upper = found.pair()
    moved = upper.data.surface_points - lower.data.surface_points
    distance = moved.norm(dim=1) * case.scales.length
    np.testing.assert_allclose(distance, 2 * found.record.sd, rtol=1e-4)
    own = case.member.data.surface_points
    middle = (upper.data.surface_points + lower.data.surface_points) / 2
    torch.testing.assert_close(middle, own, rtol=0, atol=1e-6)
    assert lower.seed == upper.seed == case.member.seed
    assert (upper.data.point_weights[:, 0] > 0).sum() > (lower.data.point_weights[:, 0] > 0).sum()


def test_a_batch_gives_each_flow_its_own(tmp_path: Path) -> None:
    flows = [solver(), make_flow(), make_flow(attributes={"surface_sd": 0.02})]
    found = identify_many(flows, tiny(members=2, steps=200), run_dir=tmp_path)
    assert [[a.sd for a in result.assumptions] for result in found] == [[], [0.0125], [0.02]]
    read = results.read_results(tmp_path / "002" / "results.json")
    assert read.assumptions == found[2].assumptions
    (line,) = read.assumptions
    assert line.derivative is not None
    assert any(line.derivative.values())
    assert "surface line one grain higher: mu_s" in read.summary()


def test_a_time_limit_keeps_time(monkeypatch: pytest.MonkeyPatch) -> None:
    steps = []
    real = sensitivity.continued

    def continued(trainer: Any, copies: Any, most: int) -> Any:
        steps.append((trainer.step, most))
        return real(trainer, copies, most)

    monkeypatch.setattr(sensitivity, "continued", continued)
    identify(make_flow(), tiny(steps=None, max_time=4.0))
    (made, most) = steps[0]
    assert most <= assumptions.TIME_SHARE * made / 2
    cases = [pose(flow, tiny()) for flow in (make_flow(), solver())]
    assert assumptions.share(cases) == 0.25
    assert assumptions.share(cases[1:]) == 0
    config = tiny(max_time=100.0, steps=None)
    with_rest = start.start(cases[:1], config, None, None, 0.0, choose_device("cpu"))
    assert with_rest.limit is not None
    assert with_rest.limit.later == pytest.approx(20.0)
