"""Do the data follow the friction law? The equation residuals after a training decide."""

from __future__ import annotations

import math

from granpinn.results import Residuals
from granpinn.results.records import Verdict
from granpinn.uncertainty.calibration import Calibration

NOISE_ERROR = 1.02  # mean square of noise in the data over the known one, at most


def velocity_error(residuals: Residuals, calibration: Calibration) -> float:
    """Relative error of the fitted velocity: misfit beyond the noise, and the effect of noise.

    Where noise hides the misfit, it counts as at least that of the table's flows.
    """
    beyond = beyond_noise(residuals)
    if residuals.noise > 0:
        beyond = max(beyond, calibration.misfit)
    return math.hypot(beyond, calibration.noise_part * residuals.noise)


def beyond_noise(residuals: Residuals) -> float:
    """Relative misfit of the velocity beyond its known noise."""
    return math.sqrt(max(0.0, residuals.velocity**2 - NOISE_ERROR * residuals.noise**2))


def explained_error(residuals: Residuals, calibration: Calibration) -> float:
    """The error of the velocity that fits of flows of the law have with this noise, at most."""
    usual = math.hypot(calibration.misfit, calibration.noise_part * residuals.noise)
    return min(velocity_error(residuals, calibration), usual)


def residual_ratios(
    residuals: Residuals, calibration: Calibration, error: float | None = None
) -> dict[str, float]:
    """Residuals relative to residuals of simulated flows of the law, by terms of the table.

    Args:
        error: of the velocity, relative; by default `velocity_error`.
    """
    error = max(velocity_error(residuals, calibration) if error is None else error, 1e-12)
    return {
        name: usual.ratio(residuals[name], error) for name, usual in calibration.residuals.items()
    }


def excess(residuals: Residuals, calibration: Calibration) -> float:
    """The largest residual relative to its limit, at least 1."""
    ratios = residual_ratios(residuals, calibration)
    return max([1.0, *(r / calibration.residuals[name].limit for name, r in ratios.items())])


def verdict(
    mu: tuple[float, ...],
    residuals: Residuals,
    calibration: Calibration,
    noise: float | None = None,
) -> Verdict:
    """Whether the residuals fit data that follow mu(I), in words.

    Data of another law can leave small residuals, because the stress is an unknown of the fit.
    They then give parameters outside of the materials of the calibration, and the fit misses the
    velocity by more than the noise. Residuals that are too large for the misfit that the noise
    explains then contradict the law.

    Args:
        noise: measured in the vectors, in the unit of `residuals.noise`; it counts where none is
            known. None: not measured, or the training was shorter than those of the calibration.
    """
    outside = _outside(mu, calibration)
    if outside is not None and noise is not None:
        seen = Residuals(residuals, noise=residuals.noise or noise)
        ratios_seen = residual_ratios(seen, calibration, explained_error(seen, calibration))
        if broken := _broken(ratios_seen, calibration):
            words = (
                f"these data do not follow mu(I): {outside}, and with the misfit of the velocity "
                f"that their noise explains {broken}"
            )
            return Verdict(False, words, {**ratios_seen})
    ratios: dict[str, float | None] = {**residual_ratios(residuals, calibration)}
    error = velocity_error(residuals, calibration)
    if error > calibration.largest_misfit:
        why = f"the velocity is resolved to {100 * error:.2g} % only"
        return Verdict(None, f"no answer whether these data follow mu(I): {why}", ratios)
    if broken := _broken(residual_ratios(residuals, calibration), calibration):
        return Verdict(False, f"these data do not follow mu(I): {broken}", ratios)
    if outside is not None:
        return Verdict(None, f"these data may follow another law: {outside}", ratios)
    parts = [f"the {name} residual is {ratio:.1f} times" for name, ratio in ratios.items()]
    words = f"nothing contradicts mu(I): {', '.join(parts)} that of simulated mu(I) flows"
    return Verdict(True, words, ratios)


def _broken(ratios: dict[str, float], calibration: Calibration) -> str:
    """The residuals beyond their limits, in words; empty without any."""
    return " and ".join(
        f"the {name} residual is {ratio:.1f} times that of simulated mu(I) flows (limit "
        f"{calibration.residuals[name].limit:.1f})"
        for name, ratio in ratios.items()
        if ratio > calibration.residuals[name].limit
    )


def _outside(mu: tuple[float, ...], calibration: Calibration) -> str | None:
    """How the parameters lie outside of the materials of the calibration; None inside."""
    for name, value, (low, high) in (
        ("mu_s", mu[0], calibration.valid_mu_s),
        ("mu_2/mu_s", mu[1] / mu[0], calibration.valid_ratio),
    ):
        if not low <= value <= high:
            return (
                f"{name} = {value:.3g} lies outside of {low:g} to {high:g}, where residuals and "
                "error bars were calibrated"
            )
    return None
