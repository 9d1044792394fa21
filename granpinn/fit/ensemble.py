"""From trained networks to a result: the center of the ensemble and its error bars."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import torch

from granpinn import results
from granpinn.data.symmetry import axes_of
from granpinn.fit.case import Case
from granpinn.fit.network import TrainedNetwork
from granpinn.fit.prediction import inertial_range
from granpinn.physics.laws import DEFAULT
from granpinn.physics.terms import NAMES
from granpinn.results import Parameter, Parameters, Residuals, Result
from granpinn.results.records import Assumed, IdentifiedLaw, Members
from granpinn.training.loop import TrainingLoop
from granpinn.training.trainer import Trainer
from granpinn.uncertainty import error_bars
from granpinn.uncertainty.error_bars import center, most_central
from granpinn.uncertainty.error_model import ends_of


def members_of(cases: Sequence[Case], run: TrainingLoop, first: int) -> tuple[Members, int]:
    """The values of the members from `first` on, and the place of the member that is shown.

    Members that diverged are left out. If all did, the first is kept in its last good state.
    """
    law = cases[0].member.law
    places = range(len(cases))
    sound = [k for k in places if first + k not in run.trainer.diverged] or [0]
    theta = [
        run.trainer.in_units(first + k, run.trainer.solution(first + k)[1].tolist()) for k in sound
    ]
    members = Members(
        seed=tuple(cases[k].member.seed for k in sound),
        values={name: tuple(t[law.names.index(name)] for t in theta) for name in law.free},
        diverged=sum(first + k in run.trainer.diverged for k in places),
    )
    shown = most_central(members, law)
    return dataclasses.replace(members, shown=shown), sound[shown]


def network_of(case: Case, trainer: Trainer, e: int) -> TrainedNetwork:
    """The trained network and law of a case, member e of the run."""
    problem, law, flow = case.member.problem, case.member.law, case.flow
    solution = trainer.solution(e)
    own = problem.spec, problem.physics, *solution, case.scales, law, axes_of(flow), flow.units
    return TrainedNetwork(*own)


def residuals_of(case: Case, trainer: Trainer, e: int) -> Residuals | None:
    """The residuals of a trained member; None if one of them is not finite."""
    terms = final_terms(trainer, e)
    if not all(map(math.isfinite, terms)):
        return None
    rms = {name: math.sqrt(2 * term) for name, term in zip(NAMES, terms, strict=True)}  # halves
    noise = case.scales.to_dimensionless(case.known_sd, "velocity") * math.sqrt(2)
    speed = _rms_speed(case)
    return Residuals(rms, velocity=rms["velocity"] / speed, noise=noise / speed)


def measured_noise(case: Case) -> float | None:
    """Noise that the vectors show, relative to their rms; None if they are too few."""
    sigma = case.facts.noise.sigma
    return None if sigma is None else sigma * math.sqrt(2) / _rms_speed(case)


def _rms_speed(case: Case) -> float:
    """Root mean square of the fitted velocity, dimensionless; 1 for grains at rest."""
    return math.sqrt(2 * float(case.member.data.velocity.square().mean())) or 1.0


def data_of(case: Case) -> results.DataSummary:
    """What the data of a case are, and what they show."""
    flow, data = case.flow, case.member.data
    return results.DataSummary(
        n_points=len(data.points),
        n_surface=len(data.surface_points),
        noise=case.config.noise,
        n_frames=int(flow.t.size),
        sampled=case.sampled,
        symmetries=case.member.problem.symmetries,
        slips=case.slips,
        measured_noise=measured_noise(case),
        independent=case.facts.independent,
        grain_diameter=flow.grain_diameter,
        density=flow.density,
        grain_density=flow.grain_density,
        length_unit=flow.length_unit,
        density_unit=flow.density_unit,
    )


def result(
    case: Case,
    run: TrainingLoop,
    e: int,
    members: Members,
    network: TrainedNetwork,
    assumed: tuple[Assumed, ...] = (),
) -> Result:
    """The result of an ensemble before its fields are known.

    Args:
        case, e: the member that is shown, and its place in the run.
        network: its network.
        assumed: assumptions and their effect on the law.
    """
    flow, config, law = case.flow, case.config, case.member.law
    failure = run.trainer.diverged.get(e)
    values = {**case.member.fixed, **dict(zip(law.free, center(members, law), strict=True))}
    bare = Result(
        parameters=Parameters(
            (name, Parameter(values[name], fixed=name not in law.free)) for name in law.names
        ),
        level=config.level,
        form=config.form,
        recipe=config.recipe,
        seed=config.seed,
        data=data_of(case),
        timing=results.Timing(run.wall_s, run.trainer.step),
        device=str(run.trainer.params.device),
        versions=results.versions(),
        input=results.Input(flow.path.name if flow.path else "in memory", flow.sha256),
        law=IdentifiedLaw(law.name, inertial_range(case.member.data, network)),
        settings=dataclasses.asdict(config),
        stopped=run.stopped if failure is None else "diverged",
        failure=failure,
        truth=flow.truth,
        members=members,
        residuals=residuals_of(case, run.trainer, e),
    )
    return with_assumptions(bare, case, assumed)


def with_assumptions(result: Result, case: Case, assumed: tuple[Assumed, ...]) -> Result:
    """The result with the effects of its assumptions: its error bars, or why it has none."""
    values, I_range, known = result.parameters, result.law.I_range, None
    if result.law.name == DEFAULT.name and result.residuals and I_range is not None:
        mu_s, mu_2, I0 = result.theta
        real = not case.flow.of_solver
        known = error_bars.known_of(result, ends_of(I_range, I0), (mu_s, mu_2), real)
    judged = error_bars.judge(result, known, case.config, assumed)
    reason = judged if isinstance(judged, str) else None
    found = None if isinstance(judged, str) else judged
    free = {} if found is None else found.parameters
    return dataclasses.replace(
        result,
        parameters=Parameters(
            (name, free.get(name) or Parameter(p.value, p.fixed)) for name, p in values.items()
        ),
        covariance=None if found is None else found.covariance,
        error_bars=None if found is None else found.bars,
        law=IdentifiedLaw(result.law.name, I_range, reason=reason),
        assumptions=assumed,
    )


MOST_POINTS = 131072
CHUNK = 16384  # points per evaluation


@torch.no_grad()
def final_terms(trainer: Trainer, e: int) -> list[float]:
    """Mean terms of the loss of member e after the steps of the training (`Trainer.trained`).

    The loss of a step is over a small batch, whose scatter hides the differences between two laws.
    Points of the equations above the highest vectors are left out: no vector holds the velocity
    there, so their residuals say nothing about the law.

    The mean is over every k-th point, at most `MOST_POINTS`, without those of the strip, which are
    pooled behind the vectors and the points between them.
    """
    objective = trainer.objective
    params, theta = trainer.trained(e)
    data = objective.data(e)
    own = objective.members[e].data
    first, strip = len(own.points) + len(own.between), len(own.strip)
    inside = _every_kth(len(data.points) - strip)
    inside[inside >= first] += strip
    surface = _every_kth(len(data.surface_points))
    sums = [0.0] * len(NAMES)
    weights = data.point_weights[inside.to(data.points.device)].double().mean(0).tolist()
    for start in range(0, max(len(inside), len(surface)), CHUNK):
        i, j = (k[start : start + CHUNK].to(data.points.device) for k in (inside, surface))
        terms = objective.terms(e, params, theta, data.loss_points.at(i, j))
        for k, (name, term) in enumerate(zip(NAMES, terms.tolist(), strict=True)):
            sums[k] += term * len(j if name == "surface" else i)
    velocity, equations = (len(inside) * weight for weight in weights)
    counts = dict.fromkeys(NAMES, equations)
    counts |= {"velocity": velocity, "surface": max(1, len(surface))}
    return [total / counts[name] for total, name in zip(sums, NAMES, strict=True)]


def _every_kth(count: int) -> torch.Tensor:
    """At most `MOST_POINTS` of the numbers below `count`, spread evenly."""
    return torch.arange(0, count, max(1, -(-count // MOST_POINTS)))
