"""Tables of a comparison of laws: which law is chosen, and how far the free curve is known.

python -m bench.studies.laws.choice.table choice.json ...
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.physics.laws import cohesive

Row = dict[str, Any]
COHESIVE = cohesive.LAW.name


def right(row: Row) -> bool:
    """Whether the true law is chosen, or not told apart from the chosen one."""
    first = next((c for c in row["comparison"] if c["law"] == row["chosen"]), None)
    return first is not None and row["law"] in (first["law"], *first["not_told_apart_from"])


def constant_kept(row: Row) -> bool | None:
    """Whether constant friction is left for a law whose curve rises by more than 0.04, so that it
    is 0.02 away from any constant; None for flatter curves."""
    if "true" not in row or np.ptp(row["true"]) <= 0.04 or not row["comparison"]:
        return None
    first = next(c for c in row["comparison"] if c["law"] == row["chosen"])
    return "coulomb" in (first["law"], *first["not_told_apart_from"])


def in_band(row: Row) -> bool | None:
    """Whether the band holds all of the true curve; None without a band."""
    if row.get("low") is None:
        return None
    low, true, high = (np.array(row[name]) for name in ("low", "true", "high"))
    return bool(((low <= true) & (true <= high)).all())


def table(rows: Sequence[Row]) -> str:
    """Counts by noise and law, as lines of text."""
    lines = [
        f"{'noise':>6s} {'law':12s}{'flows':>6s}{'right':>6s}{'constant left':>14s}"
        f"{'in band':>8s}{'half':>8s}{'rms':>8s}{'worst':>8s}  chosen"
    ]
    keys = dict.fromkeys((row["noise"], row["law"]) for row in rows)
    for noise, law in keys:
        lines.append(_line([r for r in rows if (r["noise"], r["law"]) == (noise, law)], noise, law))
    for noise in dict.fromkeys(row["noise"] for row in rows):
        some = [r for r in rows if r["noise"] == noise]
        lines.append(_line(some, noise, "all"))
        uncohesive = [r for r in some if r["law"] != "cohesive"]
        lines.append(_line(uncohesive, noise, "no cohesion"))
    return "\n".join(lines)


def numbers(rows: Sequence[Row]) -> str:
    """What the rows say of the numbers of a free curve and of cohesion in the error model.

    The factor on the bands with which they hold 90 % of whole curves is one on `free_curve`, as
    these errors are most of the band.
    """
    plain = [row for row in rows if row["law"] != COHESIVE and row.get("low")]
    needed = [_needed(row) for row in plain]
    without = [_cohesion(row) / row["pressure"] for row in plain if row["comparison"]]
    wet = [row for row in rows if row["law"] == COHESIVE and row["comparison"]]
    part = [_cohesion(row) / float(row["truth"]["c"]) - 1 for row in wet]
    return (
        f"bands hold 90 % of {len(plain)} curves at {np.quantile(needed, 0.9):.2f} times their "
        f"width; cohesion {_mean(np.square(without)) ** 0.5:.2g} without any, relative error "
        f"{_mean(np.square(part)) ** 0.5:.2g} of cohesive grains"
    )


def _needed(row: Row) -> float:
    """The largest error of a curve over the half-width of its band."""
    half = np.subtract(row["high"], row["low"]) / 2
    return float(np.max(np.abs(np.subtract(row["mu"], row["true"])) / half))


def _cohesion(row: Row) -> float:
    own = next(c for c in row["comparison"] if c["law"] == COHESIVE)
    return float(own["parameters"]["c"]["value"])


def _line(some: Sequence[Row], noise: float, law: str) -> str:
    held = [held for row in some if (held := in_band(row)) is not None]
    kept = [kept for row in some if (kept := constant_kept(row)) is not None]
    half = [np.mean(np.subtract(r["high"], r["low"])) / 2 for r in some if r.get("low")]
    rms = [r["rms"] for r in some if "rms" in r]
    worst = [r["worst"] for r in some if "worst" in r]
    chosen = ", ".join(f"{name} {n}" for name, n in Counter(r["chosen"] for r in some).items())
    return (
        f"{100 * noise:4g} % {law:12s}{len(some):6d}{sum(map(right, some)):6d}"
        f"{f'{sum(kept)} of {len(kept)}':>14s}{f'{sum(held)}/{len(held)}':>8s}"
        f"{_mean(half):8.4f}{_mean(np.square(rms)) ** 0.5:8.4f}{_median(worst):8.4f}  {chosen}"
    )


def _mean(values: Any) -> float:
    return float(np.mean(values)) if len(values) else float("nan")


def _median(values: Any) -> float:
    return float(np.median(values)) if len(values) else float("nan")


def main() -> int:
    for name in sys.argv[1:]:
        rows = json.loads(Path(name).read_text(encoding="utf-8"))["rows"]
        print(table(rows), numbers(rows), sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
