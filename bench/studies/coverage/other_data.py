"""How the errors of the shipped table carry over to other data: other I, and noise.

python -m bench.studies.coverage.other_data --usual usual.json --varied varied.json \
    --noisy varied_0.02.json varied_0.05.json varied_0.2.json --measured films.json \
    --test noisy.json cells_512.json --write

The table of the level must have been made from collapses of the usual shape (calibrate.py).
`--usual` gives the range of I of these, `--varied` flows of every shape without noise
(`coverage.run --varied`), `--noisy` the same with noise. The law of each growth is fitted by
maximum likelihood to the relative errors of mu at the ends of the range of I, each end by itself.
Then the sizes are raised until the 90 % intervals hold 90 % of these flows. The limits of the
residuals are raised to those of the flows of every shape. `--measured` gives films, which a PIV
program measured: errors grow with the least power of their misfit with which 90 % of them hold.
The coverage of `--test` is that of flows the fit has not seen. A level without `--measured` takes
this entry of the usual level. Of the effect of noise, a level that is not the usual one takes the
powers of the usual level; `--noisy` raises only its sizes.

Defends: intervals of collapses of any shape, with and without noise, hold 85 to 95 % of the truths.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq, minimize

from bench.studies.coverage.calibrate import ALARM, missed, reach, text_of, upper_quantile
from bench.studies.coverage.judge import Case, cases_of, report
from bench.studies.coverage.materials import LAW
from granpinn.config import Config
from granpinn.uncertainty import calibration, error_bars, held, of_law
from granpinn.uncertainty.calibration import Calibration
from granpinn.uncertainty.held import Held, NoiseError, ReachError
from granpinn.uncertainty.misfit_growth import MisfitGrowth

Array = npt.NDArray[np.float64]
Pair = tuple[float, float]

VECTORS = 60_000.0  # the number to which the size of the effect of noise refers
ROUNDS = 8  # of raising it
FILES: dict[str, int | str] = {
    "usual": 1,
    "varied": "+",
    "noisy": "*",
    "measured": "*",
    "test": "*",
}  # and how many
LOWER = 0.0  # power at the lower end: its errors do not grow as the range shrinks


def fit(
    usual: Sequence[Case],
    varied: Sequence[Case],
    noisy: Sequence[Case],
    measured: Sequence[Case],
    base: Calibration,
    provenance: str,
    noise: NoiseError | None = None,
) -> Calibration:
    """The table with the entries on other I, noise and misfit; all cases obey mu(I).

    Args:
        noise: its effect at another level, whose powers are taken; None: those of these flows.
    """
    base = _with_limits(base, varied)
    ends = np.median([_held(case).x for case in usual], axis=0)
    x = float(ends[0]), float(ends[1])

    def at(power: float, size: Pair = (1.0, 1.0)) -> Calibration:
        entry = ReachError(x, size, (LOWER, power), len(varied), provenance)
        return dataclasses.replace(base, reach=entry, noise=None)

    errors = np.array([_errors(case) for case in varied])

    def unlikely(p: Array) -> float:
        table = at(p[0])
        return _unlikely(errors, [_moment(case, table) for case in varied], 1, p[1])

    grows = float(_least(unlikely, [1.0, 0.0])[0])
    size_of_reach = _raised((1.0, 1.0), lambda size: at(grows, size), varied)
    table = at(grows, size_of_reach)
    if noise and noisy:
        noise = dataclasses.replace(noise, provenance=f"{noise.provenance}; sizes: {provenance}")
    entry = noise or _effect(noisy, table, provenance)
    table = dataclasses.replace(table, noise=entry and _raised_noise(entry, table, noisy))
    growth = growth_with_misfit(measured, table, provenance)
    if growth is None:
        return dataclasses.replace(table, growth=_usual_level().growth)
    return dataclasses.replace(table, growth=growth)


def _usual_level() -> Calibration:
    table = calibration.of_level(Config().level)
    assert table is not None
    return table


def _effect(noisy: Sequence[Case], table: Calibration, provenance: str) -> NoiseError | None:
    """The effect of noise on these flows, beside the errors of the table; None without any."""
    if not noisy:
        return None
    size, power = np.transpose([_growth(noisy, table, end) for end in (0, 1)])
    f = np.array([_errors(case) for case in noisy])
    return NoiseError(
        (float(size[0]), float(size[1])),
        (float(power[0]), float(power[1])),
        float(np.mean(f[:, 0] * f[:, 1]) / np.sqrt(np.prod(np.mean(f**2, axis=0)))),
        VECTORS,
        len({(case.mu[0], case.mu[1]) for case in noisy}),
        provenance,
    )


def _raised_noise(entry: NoiseError, table: Calibration, noisy: Sequence[Case]) -> NoiseError:
    """The entry with sizes with which the 90 % intervals of the table hold 90 % of these flows."""
    if not noisy:
        return entry

    def with_size(size: Pair) -> Calibration:
        return dataclasses.replace(table, noise=dataclasses.replace(entry, size=size))

    return dataclasses.replace(entry, size=_raised(entry.size, with_size, noisy))


def growth_with_misfit(
    measured: Sequence[Case], table: Calibration, provenance: str
) -> MisfitGrowth | None:
    """The growth of errors up to the largest misfit of these flows; None without any.

    Its power is the least with which the 90 % intervals hold 90 % of them.
    """
    if not measured:
        return None
    misfits = [error_bars.resolution(case.residuals, table) for case in measured]
    largest = max(1.0, max(misfits) / table.misfit)
    implied = max(error_bars.implied(case.residuals, table) for case in measured)

    def of(power: float) -> MisfitGrowth:
        return MisfitGrowth(power, largest, implied, len(measured), provenance)

    return of(_least_power(lambda power: dataclasses.replace(table, growth=of(power)), measured))


def _least_power(table: Callable[[float], Calibration], cases: Sequence[Case]) -> float:
    """The least power from 0 to 1 with which the 90 % intervals hold 90 % of these flows."""

    def short(power: float) -> float:
        found = np.array([missed(case) / reach(case, table(power)) for case in cases])
        return float(max(upper_quantile(found))) - 1

    if short(0.0) <= 0 or short(1.0) >= 0:
        return float(short(0.0) > 0)
    return float(brentq(short, 0.0, 1.0, xtol=1e-3))


def _with_limits(table: Calibration, cases: Sequence[Case]) -> Calibration:
    """The table with limits of the residuals that no flow of these comes near."""
    rows = [of_law.residual_ratios(case.residuals, table) for case in cases]
    found = {
        name: dataclasses.replace(
            usual, limit=max(usual.limit, ALARM * max(row[name] for row in rows))
        )
        for name, usual in table.residuals.items()
    }
    return dataclasses.replace(table, residuals=found)


def _raised(size: Pair, table: Callable[[Pair], Calibration], cases: Sequence[Case]) -> Pair:
    """Sizes with which the 90 % intervals of a table hold 90 % of the flows."""
    for _ in range(ROUNDS):
        short = upper_quantile(np.array([missed(c) / reach(c, table(size)) for c in cases]))
        size = size[0] * max(1.0, float(short[0])), size[1] * max(1.0, float(short[1]))
    return size


def _growth(noisy: Sequence[Case], table: Calibration, end: int) -> tuple[float, float]:
    """Size and power of the effect of noise at one end, beside the errors of the intervals without
    it.
    """
    share = np.array([_held(c).noise * math.sqrt(VECTORS / _held(c).vectors) for c in noisy])
    clean = np.array([_moment(case, table)[end, end] for case in noisy])
    f = np.array([_errors(case)[end] for case in noisy])

    def unlikely(p: Array) -> float:
        variance = clean + math.exp(2 * p[0]) * share ** (2 * p[1])
        return float(np.sum(np.log(variance) + f**2 / variance))

    found = _least(unlikely, [math.log(0.05), 1.0])
    return math.exp(found[0]), float(found[1])


def _unlikely(errors: Array, moments: Sequence[Array], end: int, scale: float) -> float:
    """Minus twice the log likelihood of the errors [n, 2] at one end, a factor exp(scale) on their
    sd.
    """
    variance = np.array([m[end, end] for m in moments]) * math.exp(2 * scale)
    f = errors[:, end]
    return float(np.sum(np.log(variance) + f**2 / variance))


def _moment(case: Case, table: Calibration) -> Array:
    """What the table says of the relative errors of mu at the ends of the range, without noise."""
    ((D, _),) = error_bars.further(case.members, case.residuals, case.steps, table, case.held)
    T = held.relative(_held(case).x, error_bars.middle(case.members))
    return np.asarray(T @ D @ T.T)


def _errors(case: Case) -> Array:
    """Relative errors of mu at the ends of the range of I [2]."""
    mu = error_bars.middle(case.members)
    return np.asarray(held.relative(_held(case).x, mu) @ (np.array(mu) - case.mu) / mu[0])


def _held(case: Case) -> Held:
    if case.held is None:
        raise ValueError("every flow must have a range of I: run coverage.run again")
    return case.held


def _least(unlikely: Callable[[Array], float], start: Sequence[float]) -> Array:
    return np.asarray(minimize(unlikely, start, method="Nelder-Mead").x)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--level", default=Config().level, help="of the trainings and the table")
    for name, many in FILES.items():
        parser.add_argument(
            f"--{name}", nargs=many, type=Path, default=[], help="files of coverage.run"
        )
    parser.add_argument("--write", action="store_true", help="write the shipped table")
    own = parser.parse_args()
    base = calibration.of_level(own.level)
    if base is None:
        parser.error(f"level {own.level} has no table: make it with coverage.calibrate")
    dates = sorted({_read(path)["date"] for path in _used(own)})
    note = f"bench.studies.coverage on simulated collapses of every shape: {', '.join(dates)}"
    usual, varied, noisy, measured = (
        [case for path in paths for case in _cases(path)]
        for paths in (own.usual, own.varied, own.noisy, own.measured)
    )
    try:
        of_noise = None if own.level == Config().level else _usual_level().noise
        table = fit(usual, varied, noisy, measured, base, note, of_noise)
    except ValueError as error:
        parser.error(str(error))
    for path in (*own.usual, *_used(own), *own.test):
        print(f"{path.name}:\n{report([(case, table) for case in _cases(path)])}")
    print(table.reach, table.noise, table.growth, sep="\n")
    if own.write:
        calibration.PATHS[own.level].write_text(text_of(table) + "\n")
    return 0


def _used(own: argparse.Namespace) -> tuple[Path, ...]:
    """The files that make the entries."""
    return (*own.varied, *own.noisy, *own.measured)


def _read(path: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return content


def _cases(path: Path) -> list[Case]:
    return [case for case in cases_of(_read(path)["rows"]) if case.law == LAW]


if __name__ == "__main__":
    sys.exit(main())
