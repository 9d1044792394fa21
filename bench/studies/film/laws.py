"""The laws of the films of run.py: python -m bench.studies.film.laws FOLDER --device cuda

Every film is identified twice, all side by side: from its own vectors and from the true ones at
the same places and times. The words are settings. FOLDER/rows.csv gets further columns.

Defends: mu(I) from a film is within 1 % rms of mu(I) from the true vectors, and intervals hold.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np
import pandas as pd

from bench.studies import raw
from bench.studies.grains.law import mu_of_i
from granpinn import Result, identify_many, read_flow
from granpinn.data import Flow
from granpinn.inspection import Inspection

KEYS = ("film", "true")
I_0 = 0.3  # of the simulated and of the identified law


def columns(true: Flow, results: dict[str, Result]) -> dict[str, float]:
    """Laws from the film, from true vectors at its places and times, and of the simulation.

    Differences of mu(I) are relative and rms over log I between its 5 % and 95 % quantiles.
    """
    low, high = Inspection(true).inertia.quantiles(0.05, 0.95) or (math.nan, math.nan)
    I = np.geomspace(low, high, 30)
    assert true.truth is not None
    laws = {"simulation": (true.truth.mu_s, true.truth.mu_2)}
    row: dict[str, float] = {"I_low": low, "I_high": high}
    for key, result in results.items():
        mu_s, mu_2 = (float(result.parameters[n].value) for n in ("mu_s", "mu_2"))
        row |= held(result, *laws["simulation"], key)
        laws[key] = mu_s, mu_2
    curves = {}
    for key, (mu_s, mu_2) in laws.items():
        row |= {f"mu_s_{key}": mu_s, f"mu_2_{key}": mu_2}
        curves[key] = mu_of_i({"mu_s": mu_s, "mu_2": mu_2, "I0": I_0}, I)
    for a, b in (("film", "true"), ("film", "simulation"), ("true", "simulation")):
        row[f"{a}_to_{b}"] = float(np.sqrt(np.mean((curves[a] / curves[b] - 1) ** 2)))
    return {name: round(value, 4) for name, value in row.items()}


def held(result: Result, mu_s: float, mu_2: float, key: str) -> dict[str, float]:
    """Whether the 90 % interval of mu_s holds, and for which share of the I that of mu(I) does."""
    found = result.parameters["mu_s"]
    ends = found.interval_90 if found.determined else None
    row = {f"mu_s_held_{key}": math.nan if ends is None else ends[0] <= mu_s <= ends[1]}
    curve = result.law.curve
    if curve is not None and curve.low is not None and curve.high is not None:
        mu = mu_of_i({"mu_s": mu_s, "mu_2": mu_2, "I0": I_0}, np.array(curve.I))
        inside = (np.array(curve.low) <= mu) & (mu <= np.array(curve.high))
        width = np.log(np.array(curve.high) / np.array(curve.low)) / 2
        row |= {f"band_held_{key}": float(inside.mean()), f"band_{key}": float(width.mean())}
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    own, words = parser.parse_known_args()
    table = own.folder / "rows.csv"
    rows = pd.read_csv(table)
    flows = [[read_flow(own.folder / f"{n}_{k}.h5") for k in KEYS] for n in rows["scene"]]
    config = raw.config_of(["--checks", "quick", *words])
    results = iter(identify_many([flow for pair in flows for flow in pair], config))
    found = [columns(true, {key: next(results) for key in KEYS}) for _, true in flows]
    pd.concat([rows, pd.DataFrame(found)], axis=1).to_csv(table, index=False)


if __name__ == "__main__":
    main()
