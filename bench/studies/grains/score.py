"""Scores a run of granpinn on a scene of grains.

The run is a folder of granpinn.train, the scene one of bench.studies.grains.make. The error of
mu(I) is in % of the scene's own law (along D) and of the shear cell's law, at the inertial numbers
of `law.SCORED` within the scene's 5..95 % range of I, and of the scene's mean mu at its mean I.
Where that range is narrow (a steady chute) the scene has no law, and the mean is all.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from bench.studies.experiment.commands import ExperimentError
from bench.studies.grains.law import errors_percent, friction
from bench.studies.grains.make import SUMMARY
from bench.studies.records import records_of
from granpinn.results import Result, ResultsFileError, read_results


def score(run: Path, scene: Path) -> dict[str, Any]:
    """Errors of the law.

    Raises:
        ExperimentError: a file is missing or cannot be read.
    """
    try:
        summary = json.loads((scene / SUMMARY).read_text())
        result = read_results(run / "results.json")
    except (OSError, ValueError, ResultsFileError) as error:
        raise ExperimentError(str(error)) from None
    return law_score(result, summary)


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


def line(found: dict[str, Any]) -> str:
    """A score in one line."""
    errors = " ".join(f"{e:+.1f}@{i}" for i, e in found.get("error_percent_own", {}).items())
    if not errors and "mean" in found:
        errors = f"{found['mean']['error_percent']:+.1f}@{found['mean']['I']:.3f} (mean)"
    return f"{found['scene']:<18} {found['material']:g}  seed {found['seed']}  {errors}"
