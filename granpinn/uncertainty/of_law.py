"""Do the data follow the friction law? The equation residuals after a training decide."""

from __future__ import annotations

import math

from granpinn.results import Residuals
from granpinn.results.records import Verdict
from granpinn.uncertainty.calibration import Calibration

NOISE_ERROR = 1.02  # mean square of noise in the data over the known one, at most


def velocity_error(residuals: Residuals, calibration: Calibration) -> float:
    """Relative error of the fitted velocity: misfit beyond the noise, and the effect of noise."""
    beyond = max(0.0, residuals.velocity**2 - NOISE_ERROR * residuals.noise**2)
    return math.hypot(math.sqrt(beyond), calibration.noise_part * residuals.noise)


def residual_ratios(residuals: Residuals, calibration: Calibration) -> dict[str, float]:
    """Residuals relative to residuals of simulated flows of the law, by terms of the table."""
    error = max(velocity_error(residuals, calibration), 1e-12)
    return {
        name: usual.ratio(residuals[name], error) for name, usual in calibration.residuals.items()
    }


def excess(residuals: Residuals, calibration: Calibration) -> float:
    """The largest residual relative to its limit, at least 1."""
    ratios = residual_ratios(residuals, calibration)
    return max([1.0, *(r / calibration.residuals[name].limit for name, r in ratios.items())])


def verdict(mu: tuple[float, ...], residuals: Residuals, calibration: Calibration) -> Verdict:
    """Whether the residuals fit data that follow mu(I), in words.

    Data of another law can leave small residuals, because the stress is an unknown of the fit.
    They then give parameters outside of the materials of the calibration.
    """
    ratios: dict[str, float | None] = {**residual_ratios(residuals, calibration)}
    error = velocity_error(residuals, calibration)
    if error > calibration.largest_misfit:
        why = f"the velocity is resolved to {100 * error:.2g} % only"
        return Verdict(None, f"no answer whether these data follow mu(I): {why}", ratios)
    broken = [
        f"the {name} residual is {ratio:.1f} times that of simulated mu(I) flows (limit "
        f"{calibration.residuals[name].limit:.1f})"
        for name, ratio in residual_ratios(residuals, calibration).items()
        if ratio > calibration.residuals[name].limit
    ]
    if broken:
        return Verdict(False, f"these data do not follow mu(I): {' and '.join(broken)}", ratios)
    for name, value, (low, high) in (
        ("mu_s", mu[0], calibration.valid_mu_s),
        ("mu_2/mu_s", mu[1] / mu[0], calibration.valid_ratio),
    ):
        if not low <= value <= high:
            words = (
                f"these data may follow another law: {name} = {value:.3g} lies outside of "
                f"{low:g} to {high:g}, where residuals and error bars were calibrated"
            )
            return Verdict(None, words, ratios)
    parts = [f"the {name} residual is {ratio:.1f} times" for name, ratio in ratios.items()]
    words = f"nothing contradicts mu(I): {', '.join(parts)} that of simulated mu(I) flows"
    return Verdict(True, words, ratios)
