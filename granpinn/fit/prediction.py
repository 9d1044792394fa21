"""The fields of a trained network on the grid of its flow, at all points inside the grains.

The points where grains shear show the law, and give it over their I.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np
from torch import Tensor, from_numpy

from granpinn.arrays import Float32, Floats
from granpinn.data import Flow
from granpinn.estimates.confined import undetermined
from granpinn.fit.case import Case
from granpinn.fit.network import TrainedNetwork
from granpinn.physics.scales import Scales
from granpinn.results import Fields, Result
from granpinn.results.fields import D2_STAGNANT, shearing
from granpinn.training.points import TrainingSet
from granpinn.uncertainty.determined import (
    applied,
    determined,
    percentiles,
    stress_points,
    with_curve,
)


def predict(flow: Flow, network: TrainedNetwork) -> Fields:
    """The fields of a network at all points inside the grains, in the units of `flow`.

    Args:
        flow: the file's own flow, without added noise: u, v and p become the reference values.
    """
    scales, (frame, row, column) = network.scales, np.nonzero(flow.material)
    points = from_numpy(scales.points_to_dimensionless(flow.x[column], flow.y[row], flow.t[frame]))
    values = network.at(points)
    if flow.source is not None:
        _subtract_source(values, flow, points, scales)
    for name, known in (("u", flow.u), ("v", flow.v), ("p", flow.p)):
        if known is not None:
            values[f"{name}_reference"] = known[frame, row, column].astype(np.float32)
    return Fields(
        t=flow.t,
        y=flow.y,
        x=flow.x,
        c=np.minimum(flow.c, np.float32(1.0)),
        values=values,
        units=network.units,
        length=scales.length,
        time=scales.time,
        pressure=scales.pressure,
        steady=flow.steady,
    )


def _subtract_source(
    values: dict[str, Float32], flow: Flow, points: Tensor, scales: Scales
) -> None:
    """Take the source term of a flow off the residuals of momentum at its own points [N, 3]."""
    assert flow.source is not None
    for axis, force in zip("xy", flow.source(*scales.points_to_physical(points).T), strict=True):
        dimensionless = scales.to_dimensionless(force, "acceleration")
        values[f"momentum_residual_{axis}"] -= dimensionless.astype(np.float32)


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


def inertial_range(data: TrainingSet, network: TrainedNetwork) -> tuple[float, float] | None:
    """The 5th and the 95th percentile of I at the vectors that shear; None without shear.

    The velocity and the pressure are those of the network, at every k-th vector.
    """
    own = data.points[data.point_weights[:, 0] > 0]  # not of another variant
    points = own[:: max(1, len(own) // POINTS)].to(network.params)
    found = network.evaluate(points)
    number = found["I"][found["D2"] >= D2_STAGNANT].cpu().double().numpy()
    return percentiles(number)


def with_law(result: Result, case: Case, shear: Shear) -> Result:
    """The result with its law over the I of the points that shear, and without the parameters that
    this range, or the walls, do not determine.
    """
    reason, I_range = undetermined(case.seen, case.config.level), percentiles(shear.I)
    if reason is not None:
        lost = dict.fromkeys(result.friction_law.free, reason)
        result = dataclasses.replace(result, no_law=reason)
    else:
        lost = {} if I_range is None else determined(result, [I_range])
    points = None if I_range is None else stress_points(shear.I, shear.ratio, I_range)
    return with_curve(applied(result, lost), I_range, points)
