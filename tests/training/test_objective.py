"""Batches, scaling and weights: the arguments of the fused loss."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from torch import Tensor

from granpinn import reference
from granpinn.config import Batch, Config
from granpinn.data import Flow
from granpinn.data.scaling import scales_of
from granpinn.estimates.facts import Facts
from granpinn.kernels import ops
from granpinn.training import problem
from granpinn.training.objective import INTERIOR, SURFACE, Evaluation, Objective
from granpinn.training.points import training_set
from granpinn.training.problem import Problem, with_wall_friction
from granpinn.training.trainer import Trainer
from tests.runs import make_trainer, tiny


def posed(flow: Flow, config: Config) -> problem.Problem:
    scales = scales_of(flow)
    return problem.build(Facts(flow, scales), training_set(flow, scales, config.level), config)


@pytest.mark.parametrize("form", ["mixed", "strong"])
@pytest.mark.parametrize("level", ["V0", "V1", "V2"])
def test_everything_is_the_reference_loss_of_the_batch(form: str, level: str, flow: Flow) -> None:
    config = tiny(form=form, level=level, dtype="float64", seed=4)
    trainer = make_trainer(config, flow)
    objective, theta = trainer.objective, trainer.law_variables.theta
    assert_reference_loss(evaluation(trainer, 9), objective, trainer.params, theta, config.batch)


def assert_reference_loss(
    found: Evaluation, objective: Objective, params: Tensor, theta: Tensor, batch: Batch
) -> None:
    """Of the first member, whose seed is 4, in step 9."""
    n, m = objective.places[0, [1, 3]].tolist()
    i = ops.sample_indices(4, 9, INTERIOR, batch.interior, n)
    j = ops.sample_indices(4, 9, SURFACE, batch.surface, m)
    p = objective.members[0].problem
    at = (params[0], theta[0], objective.pool.at(i, j), objective.term_weights[0])
    expected = reference.residual_loss(*at, p.spec, p.physics)
    own = (found.loss, found.terms, found.grad_params, found.grad_theta)
    for ours, truth in zip(own, expected, strict=True):
        torch.testing.assert_close(ours[0], truth, rtol=1e-8, atol=1e-10)


def evaluation(
    trainer: Trainer, step: int, prefit: bool = False, relaxation: float = 1.0
) -> Evaluation:
    """What the step would be given, without making it."""
    control = trainer.control
    control.counter.copy_(torch.tensor([step, step, step]))
    control.table[0, 1:] = relaxation
    return trainer.objective.evaluate(control, trainer.params, trainer.law_variables.theta, prefit)


def test_the_prefit_is_the_first_term_of_everything(flow: Flow) -> None:
    trainer = make_trainer(tiny(dtype="float64"), flow)
    alone = evaluation(trainer, 3, prefit=True)
    trainer.objective.term_weights[:, 1:] = 0
    whole = evaluation(trainer, 3)
    assert not alone.grad_theta.any()
    assert not alone.terms[:, 1:].any()
    torch.testing.assert_close(alone.terms[:, 0], whole.terms[:, 0])
    torch.testing.assert_close(alone.loss, whole.loss)
    torch.testing.assert_close(alone.grad_params, whole.grad_params)


def test_scaled_units_map_inputs_to_the_unit_cube(flow: Flow) -> None:
    found = posed(flow, tiny())
    data = training_set(flow, scales_of(flow), "V1")
    mapped = (data.points - torch.tensor(found.spec.input_shift)) * torch.tensor(
        found.spec.input_scale
    )
    torch.testing.assert_close(mapped.amin(0), -torch.ones(3))
    torch.testing.assert_close(mapped.amax(0), torch.ones(3))
    d, g_x, g_y, eta_min, eta_max, U_out, P_out, p_floor, law_rate, k, s, v_factor = found.physics
    scales = scales_of(flow)
    assert d == flow.grain_diameter / scales.length
    assert (g_x, g_y) == (0, -1)
    viscosity = scales.pressure * scales.time
    assert eta_min * viscosity == pytest.approx(1e-3)
    assert eta_max * viscosity == pytest.approx(1e4)
    assert U_out == pytest.approx(float(data.velocity.square().mean().sqrt()))
    assert (P_out, p_floor) == (0.2, 1e-6)
    weights = Config().weights
    ratio = weights.sigma_constitutive / weights.law_error
    rate = Facts(flow, scales).shear_rate
    assert law_rate == pytest.approx(ratio * rate)
    assert k == 0
    assert s == 1
    assert v_factor == 1


def test_side_walls_count_where_the_file_states_their_distance(flow: Flow) -> None:
    """k = 2 mu_w H0 / W; the file may have any unit."""
    narrow = replace(flow, attributes={"wall_gap": 0.08})
    found = posed(narrow, tiny(side_walls__friction=0.3))
    height = scales_of(flow).length
    assert found.physics.side_wall == pytest.approx(2 * 0.3 * height / 0.08)
    assert found.physics.side_wall_speed == 0.01 * Facts(narrow, scales_of(narrow)).speed
    assert found.physics[:9] == posed(flow, tiny()).physics[:9]
    smooth = posed(narrow, tiny(side_walls__friction=0.0))
    assert smooth.physics.side_wall == 0
    assert with_wall_friction(smooth, narrow, scales_of(flow), 0.3) == found
    other = with_wall_friction(found, narrow, scales_of(flow), 0.15)
    assert other.physics.side_wall == pytest.approx(found.physics.side_wall / 2)
    assert replace(other, physics=found.physics) == found
    assert with_wall_friction(found, flow, scales_of(flow), 0.15).physics.side_wall == 0


def test_file_units_give_the_paper_its_own_numbers(flow: Flow) -> None:
    """The paper's loss has unit weights in the units of the data."""
    found = posed(flow, Config(recipe="paper"))
    scales = scales_of(flow)
    assert found.spec.input_shift == (0, 0, 0)
    assert found.spec.input_scale == (scales.length, scales.length, scales.time)
    U_out, P_out = found.physics.velocity_scale, found.physics.pressure_scale
    assert U_out * scales.velocity == pytest.approx(1)
    assert P_out * scales.pressure == pytest.approx(1)
    velocity, surface, momentum, continuity, _ = found.term_weights
    assert velocity == pytest.approx(scales.velocity**2)
    assert surface == pytest.approx(scales.pressure**2)
    assert momentum == pytest.approx((flow.density * 9.81) ** 2)
    assert continuity == pytest.approx(scales.time**-2)


def test_the_velocity_weighs_less_where_the_data_are_noisy(flow: Flow) -> None:
    clean = replace(posed(flow, tiny()), term_weights=[0.003**-2, 1, 1, 1, 1])
    noisy = replace(clean, noise=0.05, share=0.2)

    def sigma(problem: Problem, misfit: float) -> float:
        return float(problem.term_weights[0] * problem.velocity_factor(misfit)) ** -0.5

    assert sigma(replace(clean, noise=0.0), 0.2) == pytest.approx(0.003)
    assert sigma(noisy, 0.04) == pytest.approx(0.2 * 0.04)  # fitted better than the noise
    assert sigma(noisy, 0.2) == pytest.approx(0.2 * 0.05)
    assert sigma(noisy, 0.0) == pytest.approx(0.2 * 0.05)  # no pre-fit
    assert sigma(noisy, 0.001) == pytest.approx(0.003)
