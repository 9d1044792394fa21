r"""Evaluate a trained network on the input grid.

At every grid point inside the grains (c = 1), from the network and the identified parameters:

$$ D_2 = \sqrt{D:D}, \quad \dot\gamma = \sqrt{2}\,D_2, \quad I = d\,\dot\gamma/\sqrt{|p|/\rho},
   \quad \eta = \mu(I)\,p/\dot\gamma \ \text{inside its limits,} $$

the deviatoric stress tau (an output of the network in the mixed form, 2 eta D in the strong form),
and the residual of the strong momentum equation, for both forms.

The points where grains shear show the law, and give it over their I.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple, get_args

import numpy as np
import torch
from torch import Tensor

from granpinn.arrays import Float32, Float64, Floats
from granpinn.data import Flow, TrainingSet, test_grid
from granpinn.data.schema import Units
from granpinn.data.symmetry import axes_of
from granpinn.estimates.confined import undetermined
from granpinn.fit.case import Case, Model
from granpinn.kernels import ops
from granpinn.kernels.network import NetworkSpec
from granpinn.physics.axes import Axes
from granpinn.physics.constants import Physics
from granpinn.physics.laws import FrictionLaw
from granpinn.physics.rheology import inertial_number
from granpinn.physics.scales import Quantity, Scales
from granpinn.results import Fields, Result
from granpinn.results.fields import D2_STAGNANT, VARIABLES, shearing
from granpinn.training.operators import operators_of
from granpinn.uncertainty.determined import applied, determined, percentiles
from granpinn.uncertainty.determined import with_curve as curve_over

CHUNK = 32768  # points per evaluation: bounds the memory and leaves the values as they are
SMOOTHING = 1e-12  # gamma_dot^2 + SMOOTHING, as in the residuals: no division by zero at rest


def predict(flow: Flow, model: Model) -> Fields:
    """The fields of a model at all points inside the grains, in the units of `flow`.

    Args:
        flow: the file's own flow, without added noise: u, v and p become the reference values.
    """
    scales, (points, cells) = model.scales, test_grid(flow, model.scales)
    values = values_at(points, axes_of(flow), model)
    if flow.source is not None:
        _subtract_source(values, flow, points, scales)
    for name, known in (("u", flow.u), ("v", flow.v), ("p", flow.p)):
        if known is not None:
            values[f"{name}_reference"] = known[cells].astype(np.float32)
    return Fields(
        t=flow.t,
        y=flow.y,
        x=flow.x,
        c=np.minimum(flow.c, np.float32(1.0)),
        values=values,
        units=Units(flow.length_unit, flow.time_unit, flow.density_unit),
        length=scales.length,
        time=scales.time,
        pressure=scales.pressure,
        steady=flow.steady,
    )


def values_at(points: Tensor, axes: Axes, model: Model) -> dict[str, Float32]:
    """The predicted `fields.VARIABLES` [N] in the units and axes of a flow.

    Args:
        points: (x, y, t) [N, 3] in the axes of the flow, dimensionless.
        axes: of the training.
    """
    values: dict[str, Float32] = {}
    for start in range(0, len(points), CHUNK):
        part = _turned(points[start : start + CHUNK], axes).to(model.params)
        found = evaluate(part, model.spec, model.params, model.law, model.theta, model.physics)
        for name, value in _turned_back(found, axes).items():
            if name not in values:
                values[name] = np.empty(len(points), np.float32)
            kind = VARIABLES[name][0]
            if kind in get_args(Quantity):
                value = model.scales.to_physical(value, kind)  # type: ignore[arg-type]
            values[name][start : start + CHUNK] = value.cpu().numpy()
    return values


def _subtract_source(
    values: dict[str, Float32], flow: Flow, points: Tensor, scales: Scales
) -> None:
    """Take the source term of a flow off the residuals of momentum at its own points [N, 3]."""
    assert flow.source is not None
    for axis, force in zip("xy", flow.source(*scales.points_to_physical(points).T), strict=True):
        dimensionless = scales.to_dimensionless(force, "acceleration")
        values[f"momentum_residual_{axis}"] -= dimensionless.astype(np.float32)


@torch.no_grad()
def velocity_at_particles(flow: Flow, model: Model) -> Float64 | None:
    """Predicted (u, v) at the scattered vectors of a flow, [2, n] in its units; None on a grid."""
    p = flow.particles
    if p is None:
        return None
    axes, points = axes_of(flow), model.scales.points_to_dimensionless(p.x, p.y, p.t)
    turned_points = _turned(torch.as_tensor(points), axes)
    spec, params = model.spec, model.params
    network = (list(spec.widths), list(spec.input_shift), list(spec.input_scale))
    parts = [
        ops.network_value(part.to(params), params, *network)[:, :2].cpu()
        for part in torch.split(turned_points, CHUNK)
    ]
    scales = np.array(model.physics.velocity_scales)[:, None]
    turned = scales * torch.cat(parts).double().numpy().T
    predicted = np.stack(axes.undo(turned[0], turned[1]))
    return np.asarray(model.scales.to_physical(predicted, "velocity"))


def _turned(points: Tensor, axes: Axes) -> Tensor:
    """Points [N, 3] = (x, y, t) in the axes of the training."""
    x, y, t = points.unbind(1)
    return torch.stack([*axes.turn(x, y), t], 1)


def _turned_back(values: dict[str, Tensor], axes: Axes) -> dict[str, Tensor]:
    """The values of `evaluate` in the axes of the file."""
    found = dict(values)
    for x, y in (("u", "v"), ("momentum_residual_x", "momentum_residual_y")):
        found[x], found[y] = axes.undo(values[x], values[y])
    stress = values["tau_xx"], values["tau_xy"]
    found["tau_xx"], found["tau_xy"] = axes.undo_stress(*stress)
    return found


@torch.no_grad()
def evaluate(
    points: Tensor,
    spec: NetworkSpec,
    params: Tensor,
    law: FrictionLaw,
    theta: Tensor,
    physics: Physics,
) -> dict[str, Tensor]:
    """The predicted `fields.VARIABLES` at points [N, 3] = (x, y, t), each [N], dimensionless.

    All in the axes of the training.
    """
    (U, V), P = physics.velocity_scales, physics.pressure_scale
    network = (list(spec.widths), list(spec.input_shift), list(spec.input_scale))
    z, z_x, z_y, _ = ops.network_jet(points, params, *network, 1)
    u, v = U * z[:, 0], V * z[:, 1]
    D_xx, D_yy = U * z_x[:, 0], V * z_y[:, 1]
    D_xy = (U * z_y[:, 0] + V * z_x[:, 1]) / 2
    p = P * (torch.nn.functional.softplus(z[:, 2]) if spec.form == "mixed" else z[:, 2])
    D_squared = D_xx**2 + 2 * D_xy**2 + D_yy**2
    gamma_dot = torch.sqrt(2 * D_squared + SMOOTHING)
    d, floor = physics.grain_diameter, physics.pressure_floor
    limits = physics.eta_min, physics.eta_max
    operators = operators_of([law])
    eta = operators.viscosity(gamma_dot, p, theta, d, *limits, floor, law.name)
    if spec.form == "mixed":
        tau_xx, tau_xy = p * z[:, 3], p * z[:, 4]
    else:
        tau_xx, tau_xy = eta * (D_xx - D_yy), 2 * eta * D_xy
    residual = operators.strong_residual(points, params, theta, *network, list(physics), law.name)
    e_u, e_v, divergence = residual.unbind(1)
    return {
        "u": u,
        "v": v,
        "p": p,
        "tau_xx": tau_xx,
        "tau_xy": tau_xy,
        "D2": torch.sqrt(D_squared),
        "I": inertial_number(gamma_dot, p, d, floor),
        "eta": eta,
        "momentum_residual_x": e_u,
        "momentum_residual_y": e_v,
        "divergence": divergence,
    }


POINTS = 16384  # at most, of those that give the range of I


class Shear(NamedTuple):
    """The points of the fit where grains shear, n of them.

    Attributes:
        I: inertial number [n].
        ratio: |tau|/p [n], or (|tau| - c)/p with a cohesion c; NaN where p <= 0.
    """

    I: Floats
    ratio: Floats


def shear_of(fields: Fields, cohesion: float = 0.0) -> Shear:
    """The points of the fields where grains shear.

    Args:
        cohesion: of the law, in the units of the fields.
    """
    points = shearing(fields)
    number, p, tau_xx, tau_xy = (
        fields.values[name][points].astype(np.float64) for name in ("I", "p", "tau_xx", "tau_xy")
    )
    return Shear(number, (np.hypot(tau_xx, tau_xy) - cohesion) / np.where(p > 0, p, np.nan))


def inertial_range(data: TrainingSet, model: Model) -> tuple[float, float] | None:
    """The 5th and the 95th percentile of I at the vectors that shear; None without shear.

    The velocity and the pressure are those of the network, at every k-th vector.
    """
    own = data.points[data.point_weights[:, 0] > 0]  # not of another variant
    points = own[:: max(1, len(own) // POINTS)].to(model.params)
    found = evaluate(points, model.spec, model.params, model.law, model.theta, model.physics)
    number = found["I"][found["D2"] >= D2_STAGNANT].cpu().double().numpy()
    return percentiles(number)


def with_curve(result: Result, case: Case, shear: Shear) -> Result:
    """The result with its law over the I of the points that shear, and without the parameters that
    this range, or the walls, do not determine.
    """
    reason = undetermined(case.seen, case.config.level)
    if reason is not None:
        lost = dict.fromkeys(result.friction_law.free, reason)
        result = dataclasses.replace(result, no_law=reason)
    else:
        lost = determined(result, shear.I)
    result = applied(result, lost)
    return curve_over(result, shear.I, shear.ratio)
