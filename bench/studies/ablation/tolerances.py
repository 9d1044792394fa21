"""Tolerances of the equations that follow from the data, in two ways that the study compares.

`by_noise`: the tolerance of a velocity that noise leaves is also an error of the accelerations and
of the strain rates. `by_evidence`: MacKay's update of each sigma at some steps of the training,
with the hidden layers fixed and n independent values of each residual.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import torch

from granpinn.physics.terms import NAMES, RESIDUALS
from granpinn.training.elimination import RIDGE
from granpinn.training.features import Features, coefficients
from granpinn.training.last_layer_sums import Sums, Unknowns, choose
from granpinn.training.trainer import Trainer

VALUES = 1000.0  # independent values of one residual, as many as a network resolves
UPDATES = (0.25, 0.45, 0.65)  # parts of the training after which sigmas are updated
UPDATED = ("momentum", "continuity", "constitutive")
LARGEST = 8.0  # factor on a sigma, either way, in one update


def by_noise(momentum: float, law: float) -> Callable[..., list[float]]:
    """`sigmas_of` with hypot(sigma, factor sigma_v) for both, sigma_v that of the velocity."""
    from granpinn.training import tolerances

    plain = tolerances.sigmas_of

    def made(config: Any, scales: Any, facts: Any) -> list[float]:
        sigmas = dict(zip(NAMES, plain(config, scales, facts), strict=True))
        noise = tolerances.VelocityNoise.of(facts)
        relative = noise.sigma * noise.share / facts.speed
        columns = min(facts.columns, tolerances.MOST_COLUMNS) ** -0.5
        sigmas["momentum"] = math.hypot(sigmas["momentum"], momentum * relative * columns)
        rate = law * relative * facts.shear_rate
        sigmas["constitutive"] = math.hypot(sigmas["constitutive"], rate)
        return list(sigmas.values())

    return made


def advancing(after: Callable[[Trainer], None]) -> Callable[[Trainer], None]:
    """`Trainer.advance` that calls `after` at the UPDATES of the training."""
    plain = Trainer.advance

    def advance(self: Trainer) -> None:
        before = self.step / self.schedule.total
        plain(self)
        if any(before < part <= self.step / self.schedule.total for part in UPDATES):
            after(self)

    return advance


def by_evidence(trainer: Trainer) -> None:
    """Update the sigmas of the equations of every member, in place."""
    for e in range(len(trainer.objective.members)):
        member = trainer._at_end(e)
        features = Features(member.problem.spec, trainer.params[e])
        data = choose(member.data, features, member.seed, trainer.step, 4)
        sums = Sums(features, member.problem, member.law, data)
        at = Unknowns(
            coefficients(member.problem.spec, trainer.params[e]),
            trainer.trained(e)[1].double(),
        )
        weights = trainer.objective.members[e].problem.term_weights
        for name, sigma in _updated(sums, at, weights).items():
            k = NAMES.index(name)
            weights[k] = sigma**-2
            trainer.objective.term_weights[e, k] = weights[k]


def _updated(sums: Sums, at: Unknowns, weights: list[float]) -> dict[str, float]:
    sums.loss(at)
    F = at.C.shape[1]
    K = 5 * F + len(sums.free)
    parts: dict[str, torch.Tensor] = {}
    squares: dict[str, float] = {}
    names = [*RESIDUALS["mixed"], "surface"]
    every = torch.arange(K, device=at.C.device)
    with torch.enable_grad():
        rows = sums.rows(at)
        for number, row in enumerate(rows):
            on_surface = row.used == [2]
            name = "surface" if on_surface else names[number % 5]
            by_C = torch.einsum("cnk,cnf->nkf", row.by_z[..., row.used], row.h).flatten(1)
            J = torch.cat([by_C, row.by_theta], 1)
            i = torch.cat([every[: 5 * F].view(5, F)[row.used].flatten(), every[5 * F :]])
            own = parts.setdefault(name, at.C.new_zeros(K, K))
            own[i[:, None], i] += J.T @ J
            squares[name] = squares.get(name, 0.0) + float(row.residual.square().sum())
    h_h = sums.misfit(at)[2]
    velocity = at.C.new_zeros(K, K)
    for k in (0, 1):
        velocity[k * F : (k + 1) * F, k * F : (k + 1) * F] = sums.velocity_weight * h_h
    A = velocity + sum(parts.values())
    A = A + RIDGE * A.diagonal().mean() * torch.eye(K, device=A.device, dtype=A.dtype)
    found = {}
    for name in UPDATED:
        gamma = float(torch.linalg.solve(A, parts[name]).diagonal().sum())
        count = VALUES * RESIDUALS["mixed"].count(name)
        left = max(count - gamma, 0.1 * count)
        before = weights[NAMES.index(name)] ** -0.5
        sigma = before * math.sqrt(squares[name] * VALUES / left)
        found[name] = min(max(sigma, before / LARGEST), before * LARGEST)
    return found
