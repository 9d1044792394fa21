"""What each link of the experiment loses: measured against the simulated truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from bench.studies.experiment.particle_images import surface_points
from bench.studies.experiment.velocity_field import VelocityField
from granpinn.data import Flow
from granpinn.data.norms import relative_l2
from granpinn.importers import Validity, VectorFields

if TYPE_CHECKING:
    from bench.studies.experiment.film import Film

Array = npt.NDArray[np.float64]
OUTLIER = 1.0  # px: a larger error of a vector that is called valid


def true_flow(measured: Flow, field: VelocityField) -> Flow:
    """The measured flow with the true velocity in the place of every measured vector."""
    true = on_grid(field.velocity, measured.t, measured.x, measured.y)
    known = np.isfinite(measured.u)
    u, v = (np.where(known, a, np.nan).astype(np.float32) for a in true)
    return replace(measured, u=u, v=v)


def of_piv(fields: VectorFields, film: Film, window: int) -> dict[str, Any]:
    """Loss of pictures and PIV, in px per pair, at the vectors that lie in full cells.

    `window_mean_percent` is what the mean over an interrogation window would lose by itself.
    """
    size, delay = film.camera.pixel, film.delay
    times, x, y = np.asarray(film.times), fields.x * size, fields.y * size
    true = on_grid(film.field.velocity, times, x, y) * delay / size
    inside = _inside(film, x, y)
    valid = fields.usable & inside
    rejected = (fields.validity == Validity.INVALID) & inside
    offsets = (np.arange(4) - 1.5) / 4 * window * size
    parts = [on_grid(film.field.velocity, times, x + a, y + b) for a in offsets for b in offsets]
    mean = np.mean(parts, axis=0) * delay / size
    found = np.stack([fields.u, fields.v])
    # Vectors a window away from the edge of the grains, where no window is cut.
    around = (-window * size, 0.0, window * size)
    deep = valid & np.all([_inside(film, x + a, y + b) for a in around for b in around], axis=0)
    return {
        "vectors_in_grains": int(inside.sum()),
        "valid_percent": 100 * float(valid.sum() / inside.sum()),
        "rejected_percent": 100 * float(rejected.sum() / inside.sum()),
        **errors(found[:, valid], true[:, valid]),
        "away_from_the_edge": errors(found[:, deep], true[:, deep]),
        "window_mean_percent": relative_l2(mean[:, valid], true[:, valid]),
    }


def errors(found: Array, true: Array) -> dict[str, float | None]:
    """Of vectors [2, n] in px: relative L2 in %, root mean square, bias, share of outliers."""
    difference = found - true
    size = np.hypot(*difference)
    good = size <= OUTLIER
    return {
        "relative_l2_percent": relative_l2(found, true),
        "relative_l2_percent_without_outliers": relative_l2(found[:, good], true[:, good]),
        "rms_px": float(np.sqrt(np.mean(size**2))),
        "median_px": float(np.median(size)),
        "bias_u_px": float(difference[0].mean()),
        "bias_v_px": float(difference[1].mean()),
        "outliers_percent": 100 * float(1 - good.mean()),
    }


def of_conversion(measured: Flow, truth: Flow, film: Film, height: float) -> dict[str, Any]:
    """The flow file against the truth: velocity in SI, axes, grains and the line of the surface."""
    valid = measured.valid
    found, true = (np.stack([flow.u, flow.v])[:, valid] for flow in (measured, truth))
    # The slope of found against true is 1 unless a unit slipped.
    slope = float((found * true).sum() / (true * true).sum())
    xx, yy = np.meshgrid(measured.x, measured.y)
    fraction = np.stack(
        [film.field.fraction(t, xx.ravel(), yy.ravel()).reshape(xx.shape) for t in measured.t]
    )
    return {
        "relative_l2_percent": relative_l2(found, true),
        "slope_of_velocity": slope,
        "time_error_s": float(np.abs(measured.t - np.asarray(film.times)).max()),
        "vectors": int(valid.sum()),
        "vectors_outside_the_true_grains_percent": 100 * float((fraction[valid] < 0.5).mean()),
        "surface": surface_errors(measured, film.field, height),
    }


def of_inspection(found: dict[str, Any], measured: Flow, truth: Flow) -> dict[str, Any]:
    """What granpinn.inspect says before training, and the noise that it estimates, in units of
    the true one: of all vectors, and of their better half, which a robust estimate sees."""
    valid = measured.valid
    error = np.stack([measured.u - truth.u, measured.v - truth.v])[:, valid]
    sigma = found["noise"]["sigma"]
    normal = 0.6745  # median of |x| of a standard normal variable
    return {
        "facts": found["facts"],
        "precision": found["precision"],
        "noise": found["noise"],
        "noise_over_rms_error": sigma / float(np.sqrt(np.mean(error**2))),
        "noise_over_median_error": sigma / (float(np.median(np.abs(error))) / normal),
    }


def surface_errors(measured: Flow, field: VelocityField, height: float) -> dict[str, float]:
    """Distance of the observed line from the true one, c = 1/2, in % of the column height."""
    line = measured.surface
    assert line is not None
    h = float(field.x[1] - field.x[0])
    distances = []
    for t in np.unique(line.t):
        now = line.t == t
        x, y = line.x[now], line.y[now]
        k = int(np.argmin(np.abs(field.t - t)))
        true = surface_points(field.c[k][::-1]) * h
        # From points to the pieces between neighboring true points it is hardly nearer.
        nearest = np.hypot(x[:, None] - true[0], y[:, None] - true[1]).min(axis=1)
        distances.append(np.where(field.fraction(t, x, y) > 0.5, -nearest, nearest))
    signed = 100 / height * np.concatenate(distances)
    return {
        "rms_percent_of_height": float(np.sqrt(np.mean(signed**2))),
        "bias_percent_of_height": float(signed.mean()),
        "largest_percent_of_height": float(np.abs(signed).max()),
        "points": int(signed.size),
    }


def table(found: dict[str, Any]) -> str:
    """The chain in a few lines."""
    lines = []
    if "piv" in found:
        piv, conversion = found["piv"], found["conversion"]
        lines += [
            f"{'pictures and PIV':<22}velocity {piv['relative_l2_percent']:.2f} % (rms "
            f"{piv['rms_px']:.3f} px, bias {piv['bias_u_px']:+.3f}, {piv['bias_v_px']:+.3f} px), "
            f"valid {piv['valid_percent']:.1f} %, outliers {piv['outliers_percent']:.2f} %",
            f"{'conversion':<22}velocity {conversion['relative_l2_percent']:.2f} %, surface line "
            f"{conversion['surface']['rms_percent_of_height']:.2f} % of the height",
            f"{'inspection':<22}noise {found['inspection']['noise_over_rms_error']:.2f} of the "
            f"rms error; {found['inspection']['facts'][0]}",
        ]
    for name, row in found.get("identification", {}).items():
        values, error = row["parameters"], row["error_percent"]
        lines.append(
            f"{name.replace('_', ' '):<22}"
            + ", ".join(f"{n} {values[n]['value']:.4f} ({error[n]:+.1f} %)" for n in values)
            + "".join(
                f", truth of {n} outside its interval"
                for n, inside in row["truth_in_interval_90"].items()
                if inside is False
            )
            + f", {row['steps']} steps, {row['command_s']:.0f} s"
        )
    return "\n".join(lines)


def on_grid(sample: Callable[[float, Array, Array], Array], t: Array, x: Array, y: Array) -> Array:
    """Samples [..., T, Y, X] of a field at times and on axes."""
    xx, yy = np.meshgrid(x, y)
    frames = [sample(now, xx.ravel(), yy.ravel()) for now in t]
    stacked = np.stack(frames, axis=-2)
    return stacked.reshape(*stacked.shape[:-2], t.size, y.size, x.size)


def _inside(film: Film, x: Array, y: Array) -> npt.NDArray[np.bool_]:
    xx, yy = np.meshgrid(x, y)
    frames = [film.field.inside(t, xx.ravel(), yy.ravel()) for t in film.times]
    return np.stack(frames).reshape(len(frames), y.size, x.size)
