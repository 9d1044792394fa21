"""All scenes of a folder in one table: their own laws, noise and the plain momentum balance.

    python -m bench.studies.grains.table SCENES --md scenes.md

Laws stand as mu_s/mu_2 at I0 = 0.3, or as mu at a mean I where I hardly varies.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from bench.studies.experiment.commands import ExperimentError
from bench.studies.grains.law import SCORED, errors_percent, mu_of_i
from bench.studies.grains.make import SUMMARY, line
from bench.studies.grains.run import scenes_in

MOST = 0.10  # the largest inertial number of the table


HEAD = (
    *("scene, friction", "vectors", "I, 5..95 %", "own law along D", "its % of the shear cell"),
    *("by norm", "tau:D", "balance", "its % of the own law", "noise u, p %"),
)


def markdown(summaries: Sequence[dict[str, Any]]) -> str:
    """The table, with errors in % at the inertial numbers of `law.SCORED` up to 0.10."""
    rows = [HEAD, ("---",) * len(HEAD), *map(_row, summaries)]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def _row(s: dict[str, Any]) -> tuple[str, ...]:
    own, balance = s["own"], s["balance"]
    law, ratio = own["along_D"], own["dissipation_ratio"]
    return (
        f"{s['scene']}, {s['material']:g}",
        f"{s['vectors']}",
        "..".join(f"{i:.3f}" for i in law["I_range"]),
        _law(law),
        _departure(law, s["truth"]),
        _law(own["norm"]),
        "-" if ratio is None else f"{ratio:.3f}",
        _law(balance),
        _percent(balance.get("error_percent") or {"mean": balance.get("mean_error_percent")}),
        f"{s['noise']['velocity_percent']:.2f}, {own['p_noise_percent']:.0f}",
    )


def _law(found: dict[str, Any]) -> str:
    if found["law"] is not None:
        return f"{found['law']['mu_s']:.3f}/{found['law']['mu_2']:.3f}"
    mean = found["mean"]
    return "-" if mean is None else f"mu {mean['mu']:.3f} at {mean['I']:.3f}"


def _departure(own: dict[str, Any], truth: Mapping[str, float] | None) -> str:
    """Of the own law from that of the shear cell, in %."""
    if truth is None or own["mean"] is None:
        return "-"
    if own["law"] is not None:
        return _percent(errors_percent(partial(mu_of_i, own["law"]), truth, *own["I_range"]))
    return _percent({"mean": 100 * (own["mean"]["mu"] / mu_of_i(truth, own["mean"]["I"]) - 1)})


def _percent(errors: Mapping[str, float | None]) -> str:
    """Errors at the inertial numbers of the table, or the one at the mean I."""
    if "mean" in errors:
        return "-" if errors["mean"] is None else f"{errors['mean']:+.1f} at the mean"
    numbers = [f"{i:g}" for i in SCORED if i <= MOST]
    return " ".join(f"{errors[i]:+.1f}" if i in errors else "." for i in numbers)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("scenes", type=Path, help="folder of the scenes")
    parser.add_argument("--md", type=Path, help="file for the table in Markdown")
    chosen = parser.parse_args()
    try:
        found = [json.loads((s / SUMMARY).read_text()) for s in scenes_in(chosen.scenes)]
    except (ExperimentError, OSError, ValueError) as error:
        print(f"bench.studies.grains.table: {error}", file=sys.stderr)
        return 1
    for summary in found:
        print(line(summary))
    if chosen.md is not None:
        chosen.md.write_text(markdown(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
