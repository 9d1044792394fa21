"""The law that a scene obeys itself: its own coarse-grained stress against its own strain rate.

Where this departs from the shear cell, no method can find the law of the shear cell from the flow.
Stress and pressure of a cell are noisy by tens of per cent (force chains), so they are averaged in
bins of I before they are divided:

    along D:   mu = <tau : n> / <p>,   n = D / |D|   (noise of tau cancels)
    |tau|:     mu = <|tau|> / <p>                    (noise of tau adds)

where p is the mean normal stress of the plane, tau the deviator, |A| = sqrt(A:A/2) and
gdot = 2 |D|. The velocity is smoothed by local quadratic fits before it is differentiated, and so
is the pressure in I = gdot d sqrt(rho_bulk/p).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from bench.studies.grains.coarse import XX, XY, YY, Fields
from bench.studies.grains.law import SLOWEST, binned_law, mu_of_i
from bench.studies.grains.materials import BULK_DENSITY
from granpinn.arrays import Bool, Float64
from granpinn.estimates.local_fits import local_fits

WINDOW = (2, 2, 2)  # cells on each side in the local fits


@dataclass(frozen=True)
class Reference:
    """Stress and strain rate on the cells, for scoring only; [T, Y, X] each.

    Attributes:
        p, tau_n, tau: pressure, deviator along D, norm of the deviator; of each cell.
        p_smooth: pressure of the local fit.
        gdot, inertial_number: shear rate, and I with the smoothed pressure.
        used: full cells away from walls with a valid strain rate.
        noise: of the velocity, in %: rms distance from the local fit over the largest speed; rms
            of div v over the rms of gdot.
    """

    p: Float64
    tau_n: Float64
    tau: Float64
    p_smooth: Float64
    gdot: Float64
    inertial_number: Float64
    used: Bool
    noise: dict[str, float]


def reference(
    fields: Fields, c: Float64, steady: bool, periodic: bool, density: float = BULK_DENSITY
) -> Reference:
    """The reference of a scene from its fields and the c of its flow file.

    Args:
        density: of a dense flow of these grains, for I.
    """
    xx, yy, xy = (fields.stress[..., k] for k in (XX, YY, XY))
    p = (xx + yy) / 2
    near = (c > 0.5) & np.isfinite(fields.u)
    cell = fields.y[1] - fields.y[0]
    step = float(fields.t[1] - fields.t[0])
    half = (0, *WINDOW[1:]) if steady else WINDOW
    there = near.astype(float)
    fit = local_fits(
        [np.where(near, a, 0.0) for a in (fields.u, fields.v, p)],
        there,
        (step, cell, cell),
        half,
        2,
        periodic=periodic,
    )
    on_grid = partial(fit.on_grid, shape=near.shape)
    u, v, p_smooth = map(on_grid, fit.value.T)
    _, (u_y, v_y, _), (u_x, v_x, _) = (
        tuple(map(on_grid, slopes.T)) for slopes in fit.slopes.transpose(1, 0, 2)
    )
    d_xx, d_xy = (u_x - v_y) / 2, (u_y + v_x) / 2
    gdot = 2 * np.hypot(d_xx, d_xy)
    # Stress counts pressure as positive, so the deviator has the opposite sign.
    tau_xx, tau_xy = -(xx - yy) / 2, -xy
    with np.errstate(divide="ignore", invalid="ignore"):
        tau_n = 2 * (tau_xx * d_xx + tau_xy * d_xy) / gdot
        number = gdot * np.sqrt(density / p_smooth)
    used = (c == 1) & (fields.coverage > 0.999) & np.isfinite(number) & (p_smooth > 0)
    rest = np.hypot(fields.u - u, fields.v - v)[used]
    speed = np.hypot(fields.u, fields.v)[used]
    noise = {
        "velocity_percent": 100 * float(np.sqrt(np.mean(rest**2) / 2) / speed.max()),
        "divergence_percent": 100
        * float(np.sqrt(np.mean((u_x + v_y)[used] ** 2) / np.mean(gdot[used] ** 2))),
    }
    return Reference(p, tau_n, np.hypot(tau_xx, tau_xy), p_smooth, gdot, number, used, noise)


def own_law(found: Reference, truth: Mapping[str, float] | None) -> dict[str, Any]:
    """The law of a scene along D and by |tau|, and its dissipation over that of the shear cell's
    law; the noise of p is what the local fit leaves, in % of the mean."""
    used = found.used & (found.inertial_number > SLOWEST)
    i, p = found.inertial_number[used], found.p[used]
    along = found.tau_n[used]
    smooth_p, gdot = found.p_smooth[used], found.gdot[used]
    ratio = None
    if truth is not None:
        ratio = float((along * gdot).sum() / (mu_of_i(truth, i) * smooth_p * gdot).sum())
    return {
        "along_D": binned_law(i, along, p),
        "norm": binned_law(i, found.tau[used], p),
        "dissipation_ratio": ratio,
        "p_noise_percent": 100 * float(np.std(p - smooth_p) / p.mean()),
    }
