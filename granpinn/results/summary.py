"""The numbers behind the words of a report, derived from a result and its history.

What data can say about mu(I) ends where the inertial numbers of the flow end.  Hence the law is
summed up over the band of I that the middle 90 % of the grains cover, beside mu_s and mu_2, which
are its limits outside of the band.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch

from granpinn.physics.rheology import mu_of_I
from granpinn.results.result import Covariance, Parameters, Result

LAST_PART = 0.1  # of the steps: how much the parameters still changed
BAND_POINTS = 200
NORMAL_90 = 1.645  # half-width of the central 90 % of a normal distribution, in sd


class Band(NamedTuple):
    """mu(I) over the inertial numbers that the data cover.

    `largest_difference` is that between the identified and the true law, None without a truth;
    `half_width` is half of the 90 % band where that is widest, None without error bars.
    """

    I_low: float
    I_high: float
    mu_low: float
    mu_high: float
    largest_difference: float | None
    half_width: float | None = None


class Summary(NamedTuple):
    """
    Attributes:
        slope: (mu_2 - mu_s) / I0, the slope of mu(I) at I = 0.
        reaches: I_high / I0; mu_2 is an extrapolation where it is far below 1.
        stagnant: share of the scored points in stagnant zones.
        drift: relative change of (mu_s, mu_2) over the last tenth of the steps.
    """

    slope: float
    band: Band | None
    reaches: float | None
    stagnant: float | None
    drift: tuple[float, float] | None


def summarize(
    result: Result, history: Mapping[str, npt.NDArray[np.floating]] | None = None
) -> Summary:
    """What the page says in words; None for what is not known."""
    p = result.parameters
    band = _band(result)
    zones = result.zones
    scored = zones.n_flowing + zones.n_stagnant if zones else 0
    return Summary(
        slope=(p.mu_2.value - p.mu_s.value) / p.I0.value,
        band=band,
        reaches=band.I_high / p.I0.value if band else None,
        stagnant=zones.n_stagnant / scored if zones and scored else None,
        drift=_drift(history) if history else None,
    )


def _band(result: Result) -> Band | None:
    if result.inertial_number is None:
        return None
    low, high = result.inertial_number.q05, result.inertial_number.q95
    p, truth = result.parameters, result.truth
    I = np.linspace(low, high, BAND_POINTS)  # noqa: E741
    mu = friction(I, p.mu_s.value, p.mu_2.value, p.I0.value)
    largest = None
    if truth is not None and truth.mu_s is not None and truth.mu_2 is not None:
        true = friction(I, truth.mu_s, truth.mu_2, truth.I0 or p.I0.value)
        largest = float(np.max(np.abs(mu - true)))
    known = result.covariance
    half = None if known is None else float(np.max(half_width(I, result, known)))
    return Band(low, high, float(mu[0]), float(mu[-1]), largest, half)


def friction(
    I: npt.NDArray[np.floating],  # noqa: E741
    mu_s: float,
    mu_2: float,
    I_0: float,
) -> npt.NDArray[np.float64]:
    """mu(I) [n] in float64."""
    return mu_of_I(torch.from_numpy(np.asarray(I, np.float64)), mu_s, mu_2, I_0).numpy()


def half_width(
    I: npt.NDArray[np.floating],  # noqa: E741
    result: Result,
    covariance: Covariance,
) -> npt.NDArray[np.floating]:
    """Half of the 90 % band of mu(I) [n].

    mu(I) is a mixture of mu_s and mu_2, so the wider of their intervals counts.
    """
    bars = result.error_bars
    width = max(bars.half_width) if bars else NORMAL_90
    return width * friction_sd(I, result.parameters, covariance)


def friction_sd(
    I: npt.NDArray[np.floating],  # noqa: E741
    parameters: Parameters,
    covariance: Covariance,
) -> npt.NDArray[np.floating]:
    r"""Standard deviation of mu(I) [n] from the covariance C of the parameters, to first order:

    $$ \sigma_\mu^2 = J\,C\,J^T, \quad \phi = \frac{I}{I_0 + I}, \quad
       J = \Big(1 - \phi,\ \phi,\ -\frac{(\mu_2 - \mu_s)\,\phi}{I_0 + I}\Big). $$
    """
    mu_s, mu_2, I_0 = parameters.mu_s.value, parameters.mu_2.value, parameters.I0.value
    phi = I / (I_0 + I)
    derivative = {"mu_s": 1 - phi, "mu_2": phi, "I0": -(mu_2 - mu_s) * phi / (I_0 + I)}
    J = np.stack([derivative[name] for name in covariance.names])
    variance = np.einsum("in,ij,jn->n", J, np.array(covariance.matrix), J)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def _drift(history: Mapping[str, npt.NDArray[np.floating]]) -> tuple[float, float] | None:
    """|last - value at 0.9 of the steps| / |last|, of mu_s and mu_2."""
    step = history["step"]
    if step.size < 2:
        return None
    before = int(np.argmin(np.abs(step - (1 - LAST_PART) * step[-1])))
    changes = []
    for name in ("mu_s", "mu_2"):
        last, then = history[name][-1], history[name][before]
        if before == step.size - 1 or not (np.isfinite(last + then) and last):
            return None
        changes.append(float(abs(last - then) / abs(last)))
    return changes[0], changes[1]
