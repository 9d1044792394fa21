"""The friction law from the momentum balance alone: the baseline that needs no network.

mu = <q n_xy/p> / <n_xy> in bins of I, over the cells of momentum_balance, with the sign of n_xy.
Averages are taken before the division by n_xy. Points of a large standard error are left out. The
standard error of a bin has six parts:

- scatter: jackknife over blocks of time and space, as neighbors share their errors;
- window: the change with windows of the local fits that are a cell wider on each side;
- noise: the change with the noise of the vectors added once more, where noise widens the windows.
  The bias by noise grows with its variance, so it changes by as much as it is;
- depth: half the difference between the upper and the lower half of the cells;
- model: 2 %, as the normal stresses of grains differ by some per cent, which no law with its
  deviator along the strain rate has (bench/studies/grains);
- side_walls: the change with one standard deviation of their friction, if there are any.

Window, depth and side walls are taken from laws through the cells, so that they do not count the
scatter again. Where more than the base carries the grains, the shear stress points against the
shear in many cells, by more than the noise of a cell explains. The added noise shows that as well.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from granpinn.arrays import Bool, Float64, Index
from granpinn.config import SideWalls
from granpinn.data import Flow, add_noise
from granpinn.data.flow import WALL_GAP
from granpinn.data.noise import max_speed
from granpinn.estimates.confined import hanging
from granpinn.estimates.noise import robust_sd
from granpinn.estimates.stress import Stress, momentum_balance, upright
from granpinn.inspection import Inspection
from granpinn.results.record import GOOD, Check, Reason, Record

I0 = 0.3
BINS = 8
FEWEST_CELLS = 20  # of a bin
FEWEST_ROWS = 3  # of a bin where each is the mean over all columns and there are few
NARROW = 2.0  # a range of I over less than this factor holds one friction and no law
# Smallest windows first, with the largest error of the shear rate over its median.
WINDOWS = ((1, 0.02), (2, 0.05), (3, 0.1), (4, np.inf))
WRONG_SIGN = 0.25  # largest share of cells whose shear stress points against the shear,
SURE = 2.0  # by so many standard deviations of the noise of a cell
MODEL = 0.02  # of mu, relative
LARGEST_ERROR = 0.25  # of mu, relative
SEED = 0  # of the noise that is added
TIMES, PLACES = 4, 2  # blocks of the jackknife; with fewer frames, more in space


@dataclass(frozen=True)
class Point:
    """Friction mu in a bin of I, with its standard error, from so many cells."""

    I: float
    mu: float
    se: float
    cells: int


@dataclass(frozen=True)
class Baseline(Record):
    """What the momentum balance alone says about the friction.

    Attributes:
        reason: why the balance does not apply, in words; None if it applies.
        carried: whether that is because more than the base carries the grains.
        points: in bins of I between its 5th and 95th percentile.
        mean: of all cells in this range.
        window: cells on each side of the local fits.
        parts: relative standard errors of `mean` by their sources.
        wall_friction: friction of the side walls that it counts; None without `wall_gap`.
    """

    reason: str | None = None
    points: tuple[Point, ...] = ()
    mean: Point | None = None
    window: int | None = None
    parts: dict[str, float] | None = None
    carried: bool = False
    wall_friction: float | None = None

    @property
    def I_range(self) -> tuple[float, float] | None:
        """I of the first and the last point."""
        return (self.points[0].I, self.points[-1].I) if self.points else None

    @property
    def shown(self) -> tuple[Point, ...]:
        """The first point, the mean and the last point; the mean alone in a narrow range."""
        if self.reason is not None or self.mean is None:
            return ()
        if len(self.points) < 3:
            return (self.mean,)
        return (self.points[0], self.mean, self.points[-1])

    def reasons(self, of: Inspection) -> list[Reason]:
        return [Reason(GOOD, self.sentence)]

    @property
    def sentence(self) -> str:
        """The friction in a sentence, without the network."""
        verb = "gives" if self.shown else "does"
        return f"The momentum balance alone, without a network, {verb} {self._found}."

    @property
    def _found(self) -> str:
        """The friction, or why there is none."""
        if not self.shown:
            return f"not apply: {self.reason}"
        friction = self.wall_friction
        walls = "" if friction is None else f", with the friction {friction:g} of the side walls"
        values = ", ".join(f"{p.mu:.3f} +- {p.se:.3f} at I = {p.I:.2g}" for p in self.shown)
        return f"mu = {values}{walls}"

    def __str__(self) -> str:
        """The line for the terminal."""
        start = "" if self.shown else "it does "
        return f"momentum balance, no network: {start}{self._found}"


def baseline(flow: Flow, I0: float = I0, side_walls: SideWalls | None = None) -> Baseline:
    """The friction of a flow from the momentum balance.

    Args:
        I0: inertial scale of the law through the points.
        side_walls: their friction, for a flow that states their distance.
    """
    if flow.source is not None:
        return Baseline("the flow has a source of momentum, and the balance has gravity alone")
    side_walls = side_walls or SideWalls()
    pose = upright(flow, 0)
    held = None if isinstance(pose, str) else hanging(flow, pose)
    if held is not None:
        return Baseline(held, carried=True)
    window = 0
    stress: Stress | str = ""
    for window, largest in WINDOWS:
        stress = momentum_balance(flow, window, I0, side_walls.friction)
        if isinstance(stress, Stress) and stress.rate_error < largest:
            break
    if isinstance(stress, str):
        return Baseline(stress)
    cells = _Cells(stress, I0)
    if len(cells.I) < cells.fewest:
        return Baseline(
            f"friction shows in {len(cells.I)} cells below the surface, and it needs {cells.fewest}"
        )
    noisier = _noisier(flow, stress, window, I0, side_walls.friction)
    wrong = float(np.mean(cells.shear / cells.normal < -SURE * _noise_of_friction(stress, noisier)))
    bins = list(cells.bins())
    points = [cells.point(k) for k in bins]
    mean = cells.point(np.flatnonzero(cells.within))
    if wrong > WRONG_SIGN or mean.mu < -SURE * mean.se:
        return Baseline(
            f"the shear stress points the wrong way in {wrong:.0%} of the cells, so more than the "
            "base carries the grains: side walls in the plane, or an obstacle",
            window=window,
            carried=True,
        )
    wider = momentum_balance(flow, window + 1, I0, side_walls.friction)
    gap = flow.stated(WALL_GAP)
    rougher: Stress | str = "without side walls"
    if gap is not None and side_walls.friction_sd > 0:
        rougher = momentum_balance(flow, window, I0, side_walls.friction + side_walls.friction_sd)
    upper, lower = cells.halves()
    at = np.array([*(p.I for p in points), mean.I])
    of_window, of_walls = (cells.change(other, at) for other in (wider, rougher))
    of_noise = cells.changes(noisier)
    of_depth = np.abs(cells.curve(at, upper) - cells.curve(at, lower)) / 2
    scatter = np.array([*(p.se for p in points), mean.se])
    of_model = MODEL * np.array([*(p.mu for p in points), mean.mu])
    parts = {"scatter": scatter, "window": of_window, "depth": of_depth, "model": of_model}
    parts |= {} if isinstance(noisier, str) else {"noise": of_noise}
    parts |= {} if gap is None else {"side_walls": of_walls}
    total = np.sqrt(sum(part**2 for part in parts.values()))
    points = [replace(p, se=float(se)) for p, se in zip(points, total[:-1], strict=True)]
    points = [p for p in points if p.se < LARGEST_ERROR * p.mu]
    mean = replace(mean, se=float(total[-1]))
    relative = {name: float(part[-1] / abs(mean.mu)) for name, part in parts.items()}
    reason = None
    if not mean.se < LARGEST_ERROR * mean.mu:
        worst = max(relative, key=lambda name: relative[name])
        reason = f"{_DISAGREEMENT[worst]} by {relative[worst]:.0%}"
    friction = None if gap is None else side_walls.friction
    return Baseline(reason, tuple(points), mean, window, relative, wall_friction=friction)


_DISAGREEMENT = {
    "scatter": "its results in blocks of time and space differ",
    "window": "its result changes with the smoothing of the velocity",
    "noise": "its result changes with the noise of the velocity",
    "depth": "the upper and the lower half of the cells differ",
    "side_walls": "its result changes with the friction of the side walls",
}


def _noisier(flow: Flow, stress: Stress, window: int, I0: float, friction: float) -> Stress | str:
    """The balance of a flow with the noise of its vectors added; no balance for little noise."""
    if stress.rate_error < WINDOWS[0][1]:
        return "the noise changes nothing"
    again = add_noise(flow, stress.sigma / max_speed(flow), SEED)
    return momentum_balance(again, window, I0, friction)


def _noise_of_friction(stress: Stress, noisier: Stress | str) -> float:
    """Robust standard deviation of the friction of a cell by noise; 0 for little noise."""
    if isinstance(noisier, str):
        return 0.0
    both = stress.used & noisier.used
    change = noisier.shear[both] / noisier.normal[both] - stress.shear[both] / stress.normal[both]
    return robust_sd(change) or np.inf


class _Cells:
    """The used cells of a stress, [n] each, with the inertial scale of the law through them."""

    def __init__(self, stress: Stress, I0: float) -> None:
        self.I0 = I0
        k = np.nonzero(stress.used)
        self.I, self.shear, self.normal = (
            a[k] for a in (stress.inertial_number, stress.shear, stress.normal)
        )
        # Errors add up on the way down, in proportion to p at most: cells weigh 1/p.
        p = np.where(self.normal < 0, -1.0, 1.0) * stress.p[k]
        self.shear, self.normal = self.shear / p, self.normal / p
        self.depth = stress.depth[k]
        few = FEWEST_ROWS if stress.used.shape[2] == 1 else FEWEST_CELLS
        self.fewest = min(FEWEST_CELLS, max(few, len(self.I) // 4))
        place = k[2] if stress.used.shape[2] > 1 else self.depth
        times = min(TIMES, len(stress.frames))
        places = TIMES * PLACES // times
        self.block = _parts(k[0], times) * places + _parts(place, places)
        low, high = np.percentile(self.I, (5, 95)) if len(self.I) else (0.0, 0.0)
        self.range = float(low), float(high)
        self.within = (low <= self.I) & (self.I <= high)  # noqa: SIM300

    def bins(self) -> Iterator[Index]:
        """Indices of the cells of every filled bin of log I."""
        low, high = self.range
        count = min(BINS, len(self.I) // self.fewest) if high > NARROW * low else 1
        edges = np.geomspace(low, high, count + 1)
        for a, b in pairwise(edges):
            here = self.within if count == 1 else (a <= self.I) & (self.I < b)  # noqa: SIM300
            if here.sum() >= self.fewest or count == 1:
                yield np.flatnonzero(here)

    def point(self, k: Index) -> Point:
        """Friction of the cells k, with the jackknife's standard error over their blocks.

        The jackknife takes the distance from the law of all cells, as I differs between blocks.
        """
        shear, normal, block = self.shear[k], self.normal[k], self.block[k]
        rest = shear - self.curve(self.I[k]) * normal
        kept = [block != name for name in np.unique(block)]
        left = np.array([rest[b].sum() / normal[b].sum() for b in kept if b.any()])
        n = len(left)
        scatter = (n - 1) / n * np.sum((left - left.mean()) ** 2) if n > 1 else np.inf
        i, mu = np.average(self.I[k], weights=normal), shear.sum() / normal.sum()
        return Point(float(i), float(mu), float(np.sqrt(scatter)), len(k))

    def halves(self) -> tuple[Bool, Bool]:
        """The upper and the lower half of the cells of every bin."""
        upper: Bool = np.zeros(len(self.I), bool)
        for k in self.bins():
            upper[k] = self.depth[k] < np.median(self.depth[k])
        return upper & self.within, ~upper & self.within

    def curve(self, at: Float64, some: Bool | None = None) -> Float64:
        """mu at inertial numbers, of the law that some cells, or all in the range, fit best."""
        k = self.within if some is None else some
        x, p, s = (a[k] for a in (self.I / (self.I + self.I0), self.normal, self.shear))
        low, high = self.range
        y = at / (at + self.I0)
        if high <= NARROW * low:
            return np.full_like(at, s.sum() / p.sum())
        values = np.linalg.lstsq(np.stack([(1 - x) * p, x * p], axis=1), s, rcond=None)[0]
        return np.asarray(values[0] * (1 - y) + values[1] * y)

    def changes(self, other: Stress | str) -> Float64:
        """Change of mu in every bin and over the range with the stress of another balance, where
        both have cells in the same range of I; 0 elsewhere."""
        bins = [*self.bins(), np.flatnonzero(self.within)]
        found = np.zeros(len(bins))
        if isinstance(other, str):
            return found
        cells = _Cells(other, self.I0)
        for n, k in enumerate(bins):
            low, high = self.I[k].min(), self.I[k].max()
            here = (low <= cells.I) & (cells.I <= high)  # noqa: SIM300
            if here.any():
                mu, changed = (
                    a.shear[i].sum() / a.normal[i].sum() for a, i in ((self, k), (cells, here))
                )
                found[n] = abs(changed - mu)
        return found

    def change(self, other: Stress | str, at: Float64) -> Float64:
        """Change of the curve with the stress of another balance; 0 without one."""
        if isinstance(other, str):
            return np.zeros_like(at)
        return np.asarray(np.abs(_Cells(other, self.I0).curve(at) - self.curve(at)))


def _parts(values: Float64 | Index, count: int) -> Index:
    """The number of the part, 0 to count - 1, of equally many values each."""
    if len(values) == 0 or count < 2:
        return np.zeros(len(values), np.intp)
    edges = np.quantile(values, np.arange(1, count) / count)
    return np.asarray(np.searchsorted(edges, values, side="right"))


def make(inspection: Inspection) -> Baseline:
    scale = inspection.law.inertial_scale or I0
    return baseline(inspection.flow, scale, inspection.side_walls)


CHECK = Check("momentum_balance", Baseline, make, seconds=2.0, quick=False)
