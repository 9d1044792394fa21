"""K-1: how far an implementation is from the truth, and how far plain float32 autograd is.

The rule of the project for a fast kernel: its error against the float64 oracle is at most twice
that of nested autograd in float32 (three times for gradients), each output as one vector.

Rounding errors are random, and so is the ratio of two of them. Three rules make the test stable:

- few numbers carry few rounding errors, which can be zero by luck. So points go through the kernel
  in many calls of the configured size, and through several networks of the configured widths. Each
  network's outputs at points are one vector, each call's loss, terms and gradients another, and the
  median of their ratios counts: with one vector, float32 autograd fails against itself with its
  hidden units in another order in one configuration of ten. All vectors together must still be
  within `GROSS_FACTOR` of autograd: a wrong call cannot hide behind the median.
- an error may be small by cancellation between points or terms. So the yardstick is never below
  the answer of the exact result to weights that are wrong by one epsilon (at random; on average
  that is as much as float32 autograd errs), nor below one epsilon of the result.
- where a limit of the viscosity or p_floor switches, derivatives jump, and the precisions may
  fall on different sides; and a lone point that amplifies rounding far more than the others would
  decide alone. Both are known from the exact problem and left out (weight 0 in the loss). Problems
  in which every point is that hard (p -> 0, gamma_dot -> 0) are regimes of the table.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import torch
from torch import Tensor

from granpinn import reference
from granpinn.reference.equations import SMOOTHING, pressure

from .configurations import SWITCHES, Configuration, Problem, problem

# By number of points in a call: networks, and calls for each network.
NETWORKS = {1: 4, 31: 4, 33: 4, 65_537: 3}
CALLS_AT_POINTS = {1: 64, 31: 3, 33: 3, 65_537: 1}
CALLS_OF_LOSS = {1: 8, 31: 3, 33: 3, 65_537: 1}
EPSILON = torch.finfo(torch.float32).eps
OUTPUT_FACTOR, GRADIENT_FACTOR, GROSS_FACTOR = 2.0, 3.0, 100.0
OUTPUTS_OF_LOSS = ("loss and terms", "grad params", "grad theta")
CHANNELS = ("z", "z_x", "z_y", "z_t", "z_xx", "z_xy", "z_yy")
AMPLIFICATION = 10  # times the median point's: beyond it a point is left out
NEAR = 1e-3  # relative distance to a switch at which a point is left out


@dataclass(frozen=True)
class Comparison:
    """One output as a vector. Errors are relative L2 distances to the float64 oracle."""

    name: str
    kernel_error: float
    autograd_error: float
    ratio: float  # median over vectors of the kernel's error over the yardstick
    cosine: float
    bias: float  # signed: relative error of the kernel's length along the exact vector
    norm: float  # of the exact vector: an operand that is zero proves nothing

    @property
    def factor(self) -> float:
        return GRADIENT_FACTOR if "grad" in self.name else OUTPUT_FACTOR

    @property
    def passed(self) -> bool:
        gross = self.kernel_error / max(self.autograd_error, EPSILON)
        return self.ratio <= self.factor and gross <= GROSS_FACTOR


def is_void(comparison: Comparison) -> bool:
    """Whether the exact result is zero, so that the comparison says nothing, where it may not be.

    The gradient of theta vanishes where a limit of the viscosity holds at every point.
    """
    return comparison.norm == 0 and comparison.name != "grad theta"


def compare(
    row: Configuration, ops: Any, rival: Any = reference, most: int = 4
) -> list[Comparison]:
    """Every output and every derivative of `ops` for one row of the table, in float32.

    Args:
        rival: the module that gives the truth in float64 and the error to stay close to in float32.
        most: networks at most; fewer than three let the luck of one decide.
    """
    networks = []
    for network in range(min(most, NETWORKS[row.points])):
        torch.set_num_threads(1)
        pool = pooled(row, network, rival)
        pool_32 = pool.to(torch.float32)
        truth = _oracle(row, pool, rival)
        rounded = _oracle(row, pool._replace(params=_rounded(pool.params)), rival)
        autograd = _oracle(row, pool_32, rival)
        torch.set_num_threads(row.threads)
        networks.append((_kernel(row, pool_32, ops), autograd, rounded, truth))
    return [
        _comparison(
            name, *(torch.stack([x[name] for x in xs]) for xs in zip(*networks, strict=True))
        )
        for name in truth
    ]


def _oracle(row: Configuration, pool: Problem, module: Any) -> dict[str, Tensor]:
    """Outputs at all points in one call, the losses in one call for each draw of points."""
    at_points = pool.part(0, CALLS_AT_POINTS[row.points] * row.points)
    return outputs_at_points(module, at_points, _cotangent(at_points)) | _losses(module, row, pool)


def _kernel(row: Configuration, pool: Problem, ops: Any) -> dict[str, Tensor]:
    """The same, in calls of the configured number of points."""
    cotangent = _cotangent(pool.part(0, CALLS_AT_POINTS[row.points] * row.points))
    calls: dict[str, list[Tensor]] = {}
    for call in range(CALLS_AT_POINTS[row.points]):
        span = (call * row.points, (call + 1) * row.points)
        part = outputs_at_points(ops, pool.part(*span), cotangent[..., slice(*span), :])
        for name, tensor in part.items():
            calls.setdefault(name, []).append(tensor)
    joined = {
        name: torch.stack(tensors).double().sum(0) if "grad" in name else torch.cat(tensors, -2)
        for name, tensors in calls.items()
    }
    return joined | _losses(ops, row, pool)


def _cotangent(case: Problem) -> Tensor:
    """Fixed random weights of all outputs, [7, N, K] (or [E, 7, N, K])."""
    rng = torch.Generator().manual_seed(0)
    E = case.params.shape[:-1]
    shape = (*E, 7, case.batch.points.shape[-2], case.spec.widths[-1])
    return torch.randn(shape, generator=rng).to(case.params.dtype)


def outputs_at_points(module: Any, case: Problem, cotangent: Tensor) -> dict[str, Tensor]:
    """Network, jets and residuals [..., N, K], and the gradients of the first two ("grad")."""
    out: dict[str, Tensor] = {}
    params = case.params.clone().requires_grad_()
    network = (case.batch.points, params, *case.network[2:])

    value = module.network_value(*network)
    out["value"] = value
    out["grad value"] = torch.autograd.grad(value, params, cotangent[..., 0, :, :])[0]
    for order, channels in ((1, CHANNELS[:4]), (2, CHANNELS)):
        jet = module.network_jet(*network, order)
        for name, z in zip(channels, jet.unbind(-3), strict=True):
            out[f"jet {order} {name}"] = z
        weights = cotangent[..., : len(channels), :, :]
        out[f"grad jet {order}"] = torch.autograd.grad(jet, params, weights)[0]

    kept = case.batch.point_weights[..., 1:] > 0
    strong = strong_residual(module, case) * kept
    for name, e in zip(("e_u", "e_v", "div"), strong.unsqueeze(-1).unbind(-2), strict=True):
        out[f"strong {name}"] = e
    return {name: tensor.detach() for name, tensor in out.items()}


def _losses(module: Any, row: Configuration, pool: Problem) -> dict[str, Tensor]:
    calls = []
    for call in range(CALLS_OF_LOSS[row.points]):
        part = pool.part(
            call * row.points,
            (call + 1) * row.points,
            call * row.surface_points,
            (call + 1) * row.surface_points,
        )
        loss, terms, grad_params, grad_theta = module.residual_loss(*part)
        calls.append((torch.cat([loss.unsqueeze(-1), terms], -1), grad_params, grad_theta))
    return {
        name: torch.stack(x)
        for name, x in zip(OUTPUTS_OF_LOSS, zip(*calls, strict=True), strict=True)
    }


def pooled(row: Configuration, network: int, module: Any = reference) -> Problem:
    """The pool of points of a row, with weight 0 for the equations where the module says so."""
    calls = max(CALLS_AT_POINTS[row.points], CALLS_OF_LOSS[row.points])
    enlarged = replace(row, points=calls * row.points, surface_points=calls * row.surface_points)
    pool = problem(enlarged, network)
    left_out = near_a_switch(pool, module) | amplifies_rounding(pool, module)
    if pool.batch.point_weights.ndim == left_out.ndim:  # members that share their points
        left_out = left_out.any(0)
    pool.batch.point_weights[..., 1] *= ~left_out
    return pool


def near_a_switch(case: Problem, module: Any) -> Tensor:
    """Points [N] (or [E, N]) within `NEAR` of a limit of the viscosity, of p_floor, or of an I at
    which the slope of the law jumps."""
    d, _, _, eta_min, eta_max, U, P, p_floor, *_ = case.physics
    jet = module.network_jet(*case.network, 1).movedim(-3, 0)
    p = pressure(jet[0], P)
    u_x, u_y, v_x, v_y = (U * jet[channel, ..., k] for k in (0, 1) for channel in (1, 2))
    gamma_dot = torch.sqrt(2 * u_x**2 + 2 * v_y**2 + (u_y + v_x) ** 2 + SMOOTHING)
    inertia = reference.inertial_number(gamma_dot, p, d, p_floor)
    mu = reference.friction(case.law, inertia, case.theta.unsqueeze(-2))
    strength = mu * p
    near = (p.abs() / p_floor - 1).abs() < NEAR
    for eta in (eta_min, eta_max):
        near |= (strength / (eta * gamma_dot) - 1).abs() < NEAR
    for k in SWITCHES.get(case.law, ()):
        near |= (inertia / case.theta[..., k : k + 1] - 1).abs() < NEAR
    return near


def amplifies_rounding(case: Problem, module: Any) -> Tensor:
    """Points [N] (or [E, N]) whose residuals answer a rounding of the weights far too strongly.

    The answer is measured in float64, by moving the weights by about one float32 epsilon. Too
    strongly is by the measure of the same network's other points: those of a network that is steep
    everywhere would all be left out beside a member that is flat.
    """

    def residuals(params: Tensor) -> Tensor:
        moved = case._replace(params=params)
        strong = strong_residual(module, moved)
        if case.spec.form == "strong":
            return strong
        return torch.cat([strong, mixed_residuals(module, moved)], -1)

    exact = residuals(case.params)
    moved = [residuals(_rounded(case.params, seed)) for seed in (1, 2)]
    answer = torch.stack([(e - exact) ** 2 for e in moved]).sum(0)
    typical = answer.median(dim=-2, keepdim=True).values
    return (answer > AMPLIFICATION**2 * typical).any(-1)


def strong_residual(module: Any, case: Problem) -> Tensor:
    """strong_residual [N, 3] (or [E, N, 3]); the op takes one network at a time."""
    if case.params.ndim == 1:
        residual: Tensor = module.strong_residual(*case.strong)
        return residual
    return torch.stack([strong_residual(module, case.member(e)) for e in range(len(case.params))])


def mixed_residuals(module: Any, case: Problem) -> Tensor:
    """The five residuals [N, 5] (or [E, N, 5]) of the mixed form."""
    if case.params.ndim == 1:
        jets = module.network_jet(*case.network, 1).detach()
        constants = (case.theta, case.physics, "mixed", case.law)
        residuals: Tensor = module.pointwise_residuals(jets, *constants)
        return residuals
    return torch.stack([mixed_residuals(module, case.member(e)) for e in range(len(case.params))])


def _rounded(params: Tensor, seed: int = 0) -> Tensor:
    """Weights with random relative errors of one float32 epsilon."""
    rng = torch.Generator().manual_seed(seed)
    return params * (1 + EPSILON * torch.randn(params.shape, generator=rng, dtype=params.dtype))


def _comparison(name: str, *outputs: Tensor) -> Comparison:
    """From the outputs of the kernel, of float32 autograd, with rounded weights, and the truth.

    Each leads with the networks, those of the loss also with the calls (and ensemble members).
    """
    kernel, autograd, rounded, truth = (x.double() for x in outputs)
    if name in ("loss and terms", "grad theta"):
        # columns of unlike size (parameters of the law): each in units of its root mean square
        size = truth.flatten(0, -2).norm(dim=0).clamp_min(1e-300)
        kernel, autograd, rounded, truth = (x / size for x in (kernel, autograd, rounded, truth))
    vectors = truth.flatten(0, -2) if name in OUTPUTS_OF_LOSS else truth.flatten(1)
    kernel_error, autograd_error, rounding = (
        (x - truth).reshape(vectors.shape).norm(dim=1) for x in (kernel, autograd, rounded)
    )
    yardstick = torch.stack([autograd_error, rounding, EPSILON * vectors.norm(dim=1)]).amax(0)
    ratio = torch.where(kernel_error == 0, 0, kernel_error / yardstick)  # 0 / 0: both exact
    norm = float(truth.norm())
    scale = norm or 1.0  # of a zero vector, the absolute error
    along = float((kernel * truth).sum())
    return Comparison(
        name=name,
        kernel_error=float(kernel_error.norm()) / scale,
        autograd_error=float(autograd_error.norm()) / scale,
        ratio=float(ratio.quantile(0.5)),
        cosine=along / (scale * (float(kernel.norm()) or 1.0)),
        bias=along / scale**2 - 1,
        norm=norm,
    )
