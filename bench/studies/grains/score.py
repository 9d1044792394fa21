"""Scores a run of granpinn on a scene of grains.

The run is a folder of granpinn.train (results.json, fields.h5), the scene one of
bench.studies.grains.make. The error of mu(I) is in % of the scene's own law (along D) and of the
shear cell's law, at the inertial numbers of `law.SCORED` within the scene's 5..95 % range of I, and
of the scene's mean mu at its mean I. Where that range is narrow (a steady chute) the scene has no
law, and the mean is all.
Pressure is compared on block means where grains flow: in one cell it is noisy by tens of per cent.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies.experiment.commands import ExperimentError
from bench.studies.grains.law import SLOWEST, errors_percent, friction
from bench.studies.grains.make import REFERENCE, SUMMARY
from bench.studies.records import records_of
from granpinn.arrays import Float64
from granpinn.results import (
    FieldsFileError,
    Result,
    ResultsFileError,
    read_fields,
    read_results,
)

BLOCK = (8, 3, 3)  # frames and cells of a block; all frames of a steady flow
FILLED = 0.5  # share of the cells of a block that must flow


def score(run: Path, scene: Path) -> dict[str, Any]:
    """Errors of the law and of the pressure.

    Raises:
        ExperimentError: a file is missing or cannot be read.
    """
    try:
        summary = json.loads((scene / SUMMARY).read_text())
        result = read_results(run / "results.json")
    except (OSError, ValueError, ResultsFileError) as error:
        raise ExperimentError(str(error)) from None
    found = law_score(result, summary)
    if (run / "fields.h5").exists():
        found["pressure"] = pressure_score(run / "fields.h5", scene / REFERENCE)
    return found


def law_score(result: Result, summary: dict[str, Any]) -> dict[str, Any]:
    """The part of the score that needs results.json alone."""
    law = {name: p.value for name, p in result.parameters.items()}
    curve = friction(result.law.name, law)
    own = summary["own"]["along_D"]
    low, high = own["I_range"]
    found: dict[str, Any] = {
        "scene": summary["scene"],
        "material": summary["material"],
        "seed": result.seed,
        "level": result.level,
        "name": result.law.name,
        "law": law,
        "misfit_percent": result.error_percent.velocity,
        "own_law": own["law"],
        "I_range": [low, high],
        "result_I_range": result.law.I_range,
        **{name: value for name, value in records_of(result).items() if name != "I_range"},
    }
    if own["mean"] is not None:
        mu = float(curve(own["mean"]["I"]))
        found["mean"] = own["mean"] | {"error_percent": 100 * (mu / own["mean"]["mu"] - 1)}
    for name, truth in (("own", own["law"]), ("shear_cell", summary["truth"])):
        if truth is not None:
            found[f"error_percent_{name}"] = errors_percent(curve, truth, low, high)
    return found


def pressure_score(fields: Path, reference: Path) -> dict[str, float | None]:
    """Error of the pressure on block means, and the noise of the reference there, both in %.

    The noise is half the difference between the means over even and odd frames.
    """
    try:
        predicted = read_fields(fields)
        with np.load(reference) as file:
            known = {name: file[name] for name in ("p", "I", "used")}
    except (OSError, FieldsFileError) as error:
        raise ExperimentError(str(error)) from None
    p = np.stack([predicted.frame("p", k) for k in range(len(predicted.t))]).astype(float)
    if predicted.steady:  # one frame, the mean
        p = np.broadcast_to(p, known["p"].shape)
    flowing = known["used"] & (known["I"] > SLOWEST) & np.isfinite(p)
    size = (len(p) if predicted.steady else BLOCK[0], *BLOCK[1:])
    mean_p, mean_known = (_block_means(a, flowing, size) for a in (p, known["p"]))
    frame = np.arange(len(p))[:, None, None]
    even, odd = (
        _block_means(known["p"], flowing & (frame % 2 == k), size, FILLED / 2) for k in (0, 1)
    )
    return {
        "error_percent": _relative(mean_p - mean_known, mean_known),
        "noise_percent": _relative((even - odd) / 2, mean_known),
        "ratio": float(np.nansum(mean_p) / np.nansum(mean_known)),
        "blocks": float(np.isfinite(mean_known).sum()),
    }


def _relative(difference: Float64, scale: Float64) -> float | None:
    there = np.isfinite(difference) & np.isfinite(scale)
    if not there.any():
        return None
    return float(100 * np.sqrt(np.mean(difference[there] ** 2) / np.mean(scale[there] ** 2)))


def _block_means(
    values: Float64, there: Float64, size: tuple[int, ...], filled: float = FILLED
) -> Float64:
    """Means over blocks of cells; NaN where fewer than `filled` of the cells are there."""
    shape = tuple(-(-n // s) for n, s in zip(values.shape, size, strict=True))
    pad = [(0, s * m - n) for n, s, m in zip(values.shape, size, shape, strict=True)]
    split = [k for m, s in zip(shape, size, strict=True) for k in (m, s)]

    def total(array: Float64) -> Float64:
        blocks = np.pad(array, pad).reshape(split)
        return np.asarray(blocks.sum(axis=(1, 3, 5)))

    count = total(there.astype(float))
    summed = total(np.where(there, values, 0.0))
    enough = count >= filled * np.prod(size)
    return np.asarray(np.where(enough, summed / np.maximum(count, 1), np.nan))


def line(found: dict[str, Any]) -> str:
    """A score in one line."""
    errors = " ".join(f"{e:+.1f}@{i}" for i, e in found.get("error_percent_own", {}).items())
    if not errors and "mean" in found:
        errors = f"{found['mean']['error_percent']:+.1f}@{found['mean']['I']:.3f} (mean)"
    p = found.get("pressure", {}).get("error_percent")
    noise = found.get("pressure", {}).get("noise_percent")
    pressure = "" if p is None else f"  p {p:.0f} % (noise {noise:.0f} %)"
    return f"{found['scene']:<18} {found['material']:g}  seed {found['seed']}  {errors}{pressure}"
