r"""Which I0 of mu(I) the data allow: the loss over a grid of I0, each value trained on its own.

Where I << I0 the law is mu_s + (mu_2 - mu_s) I/I0. The data then determine only the slope
(mu_2 - mu_s)/I0: mu_2 and I0 can grow together, and neither has a value of its own. So
every value of the grid is held fixed in several trainings (seeds), all as one batch, and a value is
**excluded** only if both hold:

1. the loss is higher than at the best value by more than three standard errors of the mean over
   the seeds. Differences are taken within a seed. So an effect that a seed has on all its losses
   (batches, draw of synthetic noise) drops out. The standard deviation s of the rest is pooled,

   $$ \Delta L > 3 s \sqrt{2/n}, \quad
      s^2 = \sum_{v,k} (L_{vk} - \bar L_v - \bar L_k + \bar L)^2 / ((V - 1)(n - 1)); $$

2. the law differs, max |mu(I) - mu_best(I)| > 0.005 (--profile.law_accuracy) for some I between the
   5 % and 95 % quantiles of the grains. Laws that agree there to the accuracy of an identification
   (bench/studies/inertial_number) count as equal, however small the scatter of the losses.

Both ends of the grid excluded: I0 is separable, and its estimate is the vertex of the parabola
through the three values around the least loss, in log I0. One end: a bound. None: not separable.
All losses are of averaged parameters, over the same points and with the same weights.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from granpinn.arrays import Bool, Float64
from granpinn.config import Config, ConfigError
from granpinn.fit.context import Context
from granpinn.physics.laws import mu_of_i
from granpinn.results import Parameters, Result
from granpinn.results.record import NONE, Check, Record, Table
from granpinn.results.result import BAND_POINTS
from granpinn.training.guard import NonFiniteError
from granpinn.uncertainty.unknown_I0 import ProfilePoint, unknown_I0

STANDARD_ERRORS = 3.0
LEAST_AVERAGE = 0.2  # part of the run whose parameters are averaged, where the settings have less


@dataclass(frozen=True)
class Profile(Record):
    """The profile of the loss over I0 of mu(I) and its meaning.

    Attributes:
        points: in increasing I0.
        n_seeds: number of finished trainings at each value.
        smallest_rise: a rise of the loss up to this is scatter of the training.
        best: I0 of the least loss where the data separate it, else None.
        allowed: lower and upper bound of I0; None where the grid excludes no value at that side.
        answer: the same in a sentence.
        unknown: mu_s, slope and I0 where I0 is not known, each with a 90 % interval or not
            determined (uncertainty/unknown_I0.py); None: the run has no error bars.
    """

    title = "Profile of I0"
    notes = (
        "I0 was held at every value in several trainings. A value is excluded where the loss rises "
        "by more than three standard errors over the seeds, and the law differs from the best one "
        "over the inertial numbers of the data by more than --profile.law_accuracy. Where I0 is "
        "unknown, every value that is not excluded counts alike."
    )

    points: tuple[ProfilePoint, ...]
    n_seeds: int
    smallest_rise: float
    best: float | None
    allowed: tuple[float | None, float | None]
    answer: str
    unknown: Parameters | None = None

    def __post_init__(self) -> None:
        if not self.points:
            raise ValueError("points must hold at least one value of I0, got none")

    @property
    def words(self) -> str:
        if self.unknown is None:
            return f"{self.answer}\nwith I0 unknown: no error bars, as the run has none"
        found = [f"{name} {p.words}" for name, p in self.unknown.items()]
        return f"{self.answer}\nwith I0 unknown (90 % intervals): {', '.join(found)}"

    @property
    def table(self) -> Table:
        rows = [
            (
                f"{p.I0:.4f}",
                f"{p.mu_s:.4f}",
                f"{p.mu_2:.4f}",
                f"{p.slope:.3f}",
                f"{p.loss_rise:+.2e}",
                f"{p.law_difference:.4f}",
                "excluded" if p.excluded else "",
            )
            for p in self.points
        ]
        return Table(("I0", "mu_s", "mu_2", "slope", "loss rise", "law differs by", ""), rows)

    def figures(self) -> dict[str, tuple[str, Callable[[Any], Any]]]:
        from granpinn.figures.checks import profile_of_I0  # matplotlib is loaded when it is used

        def draw(source: Any) -> Any:
            known = self.points, self.smallest_rise, self.answer
            return profile_of_I0(*known, source.result.parameters.I0.value)

        return {"profile_of_I0": (self.title, draw)}


def grid_of(config: Config) -> list[float]:
    """The values of I0, in increasing order."""
    reach = math.log(config.profile.reach)
    exponents = np.linspace(-reach, reach, config.profile.values)
    return [config.I0 * math.exp(x) for x in exponents.tolist()]


def require_mu_of_i(config: Config) -> None:
    """Raise ConfigError if the law has no profile of I0."""
    if config.law != mu_of_i.LAW.name:
        raise ConfigError(
            f"--free-I0 is for {mu_of_i.LAW.title} alone, got --law {config.law}: leave out one of "
            "the two"
        )


def settings_of(config: Config, steps: int) -> Config:
    """The settings of every training of a profile."""
    average = max(LEAST_AVERAGE, config.optimizer.average)
    return dataclasses.replace(
        config,
        checks=NONE,
        compare_laws=False,
        free_I0=False,
        resimulate=False,
        steps=steps,
        max_time=None,
        members=1,  # the seeds of the profile are its ensemble
        optimizer=dataclasses.replace(config.optimizer, average=average),
    )


def make(context: Context) -> Profile:
    """Train the grid of I0 as one batch, and make the profile.

    Raises:
        As `identify_many`; NonFiniteError if too many trainings diverged.
    """
    assert context.again is not None
    config = context.case.config
    grid, seeds = grid_of(config), range(config.seed, config.seed + config.profile.seeds)
    found = context.again(
        settings_of(config, context.result.timing.steps),
        [seed for _ in grid for seed in seeds],
        I0=[I0 for I0 in grid for _ in seeds],
        run_dir=None if context.runs is None else context.runs / "profile",
        keep_fields=False,
        progress=context.run.progress,
    )
    profile = profile_from(found, config.profile.law_accuracy)
    unknown = unknown_I0(profile.points, profile.best, profile.allowed, context.result)
    return dataclasses.replace(profile, unknown=unknown)


def profile_from(results: Sequence[Result], law_accuracy: float) -> Profile:
    """The profile of trainings at every pair of an I0 and a seed.

    Args:
        law_accuracy: laws that differ by no more than this count as equal.

    Raises:
        NonFiniteError: fewer than two seeds finished their training at every I0.
    """
    grid = sorted({r.parameters.I0.value for r in results})
    ended = {(r.parameters.I0.value, r.seed): r for r in results if r.failure is None and r.loss}
    seeds = sorted({r.seed for r in results})
    seeds = [seed for seed in seeds if all((I0, seed) in ended for I0 in grid)]
    if len(seeds) < 2:
        raise NonFiniteError(
            f"the profile of I0 needs two seeds that end at every value, got {len(seeds)}: lower "
            f"--optimizer.learning_rate or --profile.reach, or give more --profile.seeds"
        )
    table = [[ended[I0, seed] for seed in seeds] for I0 in grid]
    loss = fair_losses(table)
    best = int(np.argmin(loss.mean(axis=1)))
    rises = (loss - loss[best]).mean(axis=1)
    smallest = STANDARD_ERRORS * _pooled_sd(loss) * math.sqrt(2 / len(seeds))
    mu_s = np.array([[r.parameters.mu_s.value for r in row] for row in table])
    mu_2 = np.array([[r.parameters.mu_2.value for r in row] for row in table])
    low, high = _covered(results)
    I = np.linspace(low, high, BAND_POINTS)
    means = zip(mu_s.mean(1), mu_2.mean(1), grid, strict=True)
    laws = np.stack([mu_of_i.friction(I, *theta) for theta in means])
    difference = np.abs(laws - laws[best]).max(axis=1)
    excluded = (rises > smallest) & (difference > law_accuracy)
    points = tuple(
        ProfilePoint(
            I0=grid[v],
            mu_s=float(mu_s[v].mean()),
            mu_2=float(mu_2[v].mean()),
            slope=float((mu_2 - mu_s)[v].mean() / grid[v]),
            loss_rise=float(rises[v]),
            law_difference=float(difference[v]),
            excluded=bool(excluded[v]),
        )
        for v in range(len(grid))
    )
    found = _answer(np.array(grid), rises, excluded, best)
    covers = f"I covers {low:.2f}..{high:.2f}"
    answer = found[2] + (f" ({covers})" if found[0] else f": {covers}")
    return Profile(points, len(seeds), smallest, *found[:2], answer)


def fair_losses(table: Sequence[Sequence[Result]]) -> Float64:
    """Losses [V, n] with the same weights for all: the medians over the trainings."""
    losses = [[r.loss for r in row] for row in table]
    known = [loss for row in losses for loss in row if loss is not None]
    weights = {
        name: float(np.median([loss.weights[name] for loss in known])) for name in known[0].weights
    }
    return np.array([[loss.total(weights) for loss in row if loss is not None] for row in losses])


def _pooled_sd(loss: Float64) -> float:
    """Standard deviation of a loss [V, n] when means over values and over seeds are taken off."""
    left = loss - loss.mean(1, keepdims=True) - loss.mean(0, keepdims=True) + loss.mean()
    freedom = (loss.shape[0] - 1) * (loss.shape[1] - 1)
    return math.sqrt(float((left**2).sum()) / freedom)


def _covered(results: Sequence[Result]) -> tuple[float, float]:
    bands = [r.inertial_number for r in results if r.inertial_number is not None]
    low = float(np.median([band.q05 for band in bands]))
    return low, max(float(np.median([band.q95 for band in bands])), low)


def _answer(
    grid: Float64, rises: Float64, excluded: Bool, best: int
) -> tuple[float | None, tuple[float | None, float | None], str]:
    """An estimate of I0 where there is one, the values that are allowed, and both in words."""
    kept = np.flatnonzero(~excluded)
    # The bound lies between the last value that is allowed and the first that is not.
    low = float(np.sqrt(grid[kept[0] - 1] * grid[kept[0]])) if excluded[0] else None
    high = float(np.sqrt(grid[kept[-1]] * grid[kept[-1] + 1])) if excluded[-1] else None
    if low is not None and high is not None:
        I0 = vertex(np.log(grid), rises, best)
        return I0, (low, high), f"I0 = {I0:.3g}, between {low:.3g} and {high:.3g}"
    words = "I0 is not separable in these data"
    if low is not None:
        words = f"I0 is above {low:.3g}, and these data show no upper end"
    elif high is not None:
        words = f"I0 is below {high:.3g}, and these data show no lower end"
    return None, (low, high), words


def vertex(x: Float64, rises: Float64, best: int) -> float:
    """exp of the vertex of the parabola through the least value, which is not at an end."""
    around = slice(best - 1, best + 2)
    a, b, _ = np.polyfit(x[around] - x[best], rises[around], 2)
    shift = 0.0 if a <= 0 else -b / (2 * a)
    return math.exp(float(x[best] + np.clip(shift, x[best - 1] - x[best], x[best + 1] - x[best])))


CHECK = Check(
    "profile_of_I0",
    Profile,
    make,
    seconds=600.0,
    flag="free_I0",
    quick=False,
    trains=True,
    refuse=require_mu_of_i,
)
