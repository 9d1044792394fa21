r"""The error of mu(I) by kinds of flows, from scored scenes of grains, for the calibration table.

python -m bench.studies.grains.run --all SCENES --out OUT --seeds 0 1
python -m bench.studies.grains.model_error OUT/grains.json --write

The relative error of mu(I) of a scene is fitted by $a + b \xi$ over its range of I, with
$\xi = (2 x - x_l - x_h) / (x_h - x_l)$ and x = I/(I + I0). The table holds the root mean squares
of a (level) and b (tilt) over all scenes and seeds of a kind (granpinn/uncertainty/of_kind.py). A
scene that holds one I has a level alone; a kind of such scenes gets a tilt as large as its level.
--write changes the shipped table of level V1, or the table that it names.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies.coverage.calibrate import text_of
from bench.studies.grains.materials import I0
from granpinn.uncertainty import calibration
from granpinn.uncertainty.calibration import ModelError


def level_and_tilt(score: Mapping[str, Any]) -> tuple[float, float | None]:
    """a and b of one score, as parts of mu; b is None where fewer than two errors are known.

    Raises:
        ValueError: the score has no error.
    """
    errors = {float(i): e / 100 for i, e in score.get("error_percent_own", {}).items()}
    if len(errors) < 2:
        single = [*errors.values()]
        if not single and "mean" in score:
            single = [score["mean"]["error_percent"] / 100]
        if not single:
            raise ValueError(f"{score['scene']} has no error of mu(I): score it again")
        return single[0], None
    number, ends = np.array([*errors]), np.array(score["I_range"])
    x, (low, high) = number / (number + I0), ends / (ends + I0)
    xi = (2 * x - low - high) / (high - low)
    a, b = np.polynomial.polynomial.polyfit(xi, np.array([*errors.values()]), 1)
    return float(a), float(b)


def entries(scores: Sequence[Mapping[str, Any]], provenance: str) -> dict[str, ModelError]:
    """The model error of every kind among the scores of level V1 that did not fail.

    Flows that walls carry have none: their law is not trusted (granpinn/identification/balance.py).
    """
    found = {}
    sound = [s for s in scores if s["failure"] is None and s["level"] == "V1"]
    sound = [score for score in sound if score["kind"] != "carried"]
    for kind in dict.fromkeys(score["kind"] for score in sound):
        own = [score for score in sound if score["kind"] == kind]
        pairs = [level_and_tilt(score) for score in own]
        level = _rms([a for a, _ in pairs])
        tilts = [b for _, b in pairs if b is not None]
        scenes = {(score["scene"], score["material"]) for score in own}
        names = ", ".join(sorted(f"{scene} {material:g}" for scene, material in scenes))
        tilt = _rms(tilts) if tilts else level
        found[kind] = ModelError(level, tilt, len(scenes), f"{provenance}: {names}")
    return found


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("scores", type=Path, help="grains.json of bench.studies.grains.run")
    parser.add_argument(
        "--write",
        type=Path,
        nargs="?",
        const=calibration.PATH,
        metavar="FILE",
        help="put the entries into this table; without a name: the shipped one",
    )
    own = parser.parse_args()
    try:
        study = json.loads(own.scores.read_text())
        provenance = f"bench.studies.grains.run of {study['date']}"
        found = entries(study["scores"], provenance)
        for kind, entry in found.items():
            print(f"{kind:14s} level {entry.level:.3f} tilt {entry.tilt:.3f} of {entry.flows:g}")
        if own.write is not None:
            table = calibration.load(own.write)
            merged = {**table.model_error, **found}
            own.write.write_text(text_of(dataclasses.replace(table, model_error=merged)) + "\n")
    except (OSError, ValueError, KeyError) as error:
        print(f"bench.studies.grains.model_error: {own.scores}: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
