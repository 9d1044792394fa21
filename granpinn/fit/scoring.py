r"""Errors of the identified parameters and of the reconstructed fields, in %.

Fields are scored by the paper's relative L2 error, eq. (errorL2), over all grid points inside the
grains after the start,

$$ \epsilon = 100 \sqrt{\sum |f_{predicted} - f_{reference}|^2 / \sum |f_{reference}|^2}. $$

Flowing and stagnant points (results/fields.py) have errors of their own.
"""

from __future__ import annotations

import math

import numpy as np

from granpinn.arrays import Bool, Floats
from granpinn.data import Flow
from granpinn.results import ErrorPercent, Fields, Parameter, Parameters
from granpinn.results.fields import after_start, flowing


def relative_l2(predicted: Floats, reference: Floats) -> float | None:
    """eq. (errorL2) in %, over everything in the arrays (a vector field: all components).

    None without points, or if the reference is zero everywhere.
    """
    predicted, reference = (np.asarray(f, np.float64) for f in (predicted, reference))
    size = float(np.sum(reference**2))
    if size == 0.0:
        return None
    return 100.0 * float(np.sqrt(np.sum((predicted - reference) ** 2) / size))


def scalar_error(parameter: Parameter, true: float | None) -> float | None:
    """|value - true| / |true| in %; None for a fixed parameter or an unknown true value."""
    if parameter.fixed or not true:
        return None
    return 100.0 * abs(parameter.value - true) / abs(true)


def strain_rate(u: Floats, v: Floats, y: Floats, x: Floats) -> Floats:
    """D2 = sqrt(D:D) of one frame [Y, X] by differences, one-sided at the edges.

    Second order inside a uniform grid, first order elsewhere; exact for a linear velocity.

    NaN in u, v marks points without a value. D2 is NaN at a point without neighbors along an axis.
    """
    dx, dy = np.diff(x)[:, None], np.diff(y)[:, None]
    u_x, v_x = difference(u, dx, 1), difference(v, dx, 1)
    u_y, v_y = difference(u, dy, 0), difference(v, dy, 0)
    return np.asarray(np.sqrt(u_x**2 + v_y**2 + 0.5 * (u_y + v_x) ** 2))


def difference(f: Floats, step: Floats, axis: int) -> Floats:
    """df/dx along an axis: the mean of the forward and backward differences that exist.

    NaN in f marks points without a value. `step` is the step of the coordinate, an array that
    broadcasts against the differences of f with this axis first.
    """
    f = np.moveaxis(np.asarray(f, np.float64), axis, 0)
    slope = np.diff(f, axis=0) / step
    missing = np.full_like(f[:1], np.nan)
    forward, backward = np.concatenate([slope, missing]), np.concatenate([missing, slope])
    forward, backward = (
        np.where(np.isnan(forward), backward, forward),
        np.where(np.isnan(backward), forward, backward),
    )
    return np.moveaxis((forward + backward) / 2, 0, axis)


def score(
    flow: Flow,
    fields: Fields,
    parameters: Parameters,
    at_particles: Floats | None = None,
) -> ErrorPercent:
    """All errors of one identification against the reference values of the flow file.

    Args:
        flow: the file's own data, without added noise.
        fields: the prediction on its grid.
        at_particles: predicted (u, v) at its scattered vectors [2, n]; None on a grid.
    """
    counted, values = after_start(fields), fields.values
    truth = flow.truth
    if truth is not None and any(
        name in parameters
        and not math.isclose(parameters[name].value, getattr(truth, name), rel_tol=1e-6)
        for name in truth.friction_law.quantiles
    ):
        truth = None  # coefficients over another range of I cannot be compared one by one
    errors = {
        name: scalar_error(parameter, getattr(truth, name, None))
        for name, parameter in parameters.items()
        if not parameter.fixed
    }
    errors["velocity"] = relative_l2(*_velocities(flow, fields, at_particles))
    if "p_reference" in values:
        known = np.isfinite(values["p_reference"]) & counted
        flows, rests = zones_of(flow, fields)
        masks = {"": known, "_flowing": known & flows, "_stagnant": known & rests}
        for zone, mask in masks.items():
            reference = values["p_reference"]
            errors[f"pressure{zone}"] = relative_l2(values["p"][mask], reference[mask])
    return ErrorPercent(**errors)


def zones_of(flow: Flow, fields: Fields) -> tuple[Bool, Bool]:
    """Flowing and stagnant points [K]; a point with an unknown strain rate is in neither."""
    sigmas = [sigma for sigma in (flow.sigma_u, flow.sigma_v) if sigma is not None]
    noisy = any(np.any(np.asarray(sigma) > 0) for sigma in sigmas)
    d2 = fields.values["D2"] if noisy else strain_rate_of(flow)
    flows = flowing(fields, d2)
    return flows, np.isfinite(d2) & ~flows


def _velocities(flow: Flow, fields: Fields, at_particles: Floats | None) -> tuple[Floats, Floats]:
    """Predicted and measured (u, v) [2, n] of the valid vectors after the start."""
    if flow.particles is not None and at_particles is not None:
        p = flow.particles
        after = flow.after_start(p.t)
        return at_particles[:, after], np.stack([p.u, p.v])[:, after]
    values = fields.values
    known = np.stack([values["u_reference"], values["v_reference"]])
    moving = np.isfinite(known.sum(axis=0)) & after_start(fields)
    return np.stack([values["u"], values["v"]])[:, moving], known[:, moving]


def strain_rate_of(flow: Flow) -> Floats:
    """D2 of the velocity in a flow file at all points inside the grains, as in `Fields` [K]."""
    frames = []
    for u, v, inside in zip(flow.u, flow.v, flow.material, strict=True):
        u, v = (np.where(inside, f, np.nan).astype(np.float32) for f in (u, v))
        frames.append(strain_rate(u, v, flow.y, flow.x)[inside])
    return np.concatenate(frames)
