"""Records of results.json beside the values: data, ensemble, error bars, verdict and zones."""

from __future__ import annotations

from dataclasses import dataclass, field

from granpinn.results.decoding import OTHERS
from granpinn.results.slip import Slip


@dataclass(frozen=True)
class DataSummary:
    """The data of the training.

    Attributes:
        noise: the added sd, relative to the maximum speed.
        symmetries: in which directions the flow does not change, in words.
        slips: likely mistakes of unit, sign, size or order in the flow file.
        sampled: which parts of a large flow were used for what; None: all of it for all.
        measured_noise: of the vectors, over their rms velocity; None: they are too few to show it.
        independent: number of independent vectors.
        height, spacing: of the grains, and between vectors, in grain diameters.
        solver_cell: of the solver that made the data, likewise; None: of real grains.
    """

    n_points: int
    n_surface: int
    noise: float
    n_frames: int
    symmetries: tuple[str, ...] = ()
    slips: tuple[Slip, ...] = ()
    sampled: str | None = None
    measured_noise: float | None = None
    independent: float | None = None
    height: float | None = None
    spacing: float | None = None
    solver_cell: float | None = None


@dataclass(frozen=True)
class Members:
    """The members of an ensemble that ended well, in their order.

    Attributes:
        seed: of each.
        values: of each, by the names of the identified parameters; in JSON beside the seed.
        redrawn: whether its data have a second draw of the known noise (bench/studies/coverage).
        shown: index of the member nearest to the center; the result has the fields of this member.
        diverged: number of members that diverged.
    """

    seed: tuple[int, ...]
    values: dict[str, tuple[float, ...]] = field(metadata=OTHERS)
    redrawn: tuple[bool, ...]
    shown: int = 0
    diverged: int = 0

    def __post_init__(self) -> None:
        lengths = {len(self.seed), len(self.redrawn), *map(len, self.values.values())}
        if lengths != {len(self.seed)} or not self.seed:
            raise ValueError(f"members must have one value each, got {sorted(lengths)}")
        if not 0 <= self.shown < len(self.seed):
            raise ValueError(f"shown must be one of {len(self.seed)} members, got {self.shown}")


@dataclass(frozen=True)
class Verdict:
    """Whether the data follow the law at all.

    Attributes:
        follows: None if no answer is possible.
        words: the answer in a sentence.
        ratios: residuals relative to residuals of simulated flows of the law, by terms of the loss;
            in JSON beside the words.
    """

    follows: bool | None
    words: str
    ratios: dict[str, float | None] = field(default_factory=dict, metadata=OTHERS)


@dataclass(frozen=True)
class ErrorBars:
    """The parts of the standard deviations of (mu_s, mu_2); for mu(I) alone.

    Attributes:
        scatter: sd that comes from seeds and measurement noise.
        discrepancy: sd of the further error of simulated collapses, scaled by misfit and steps; in
            flows of another kind the error of the model (uncertainty/of_kind.py).
        assumptions: sd that comes from uncertain assumptions; None without any.
        freedom: degrees of freedom behind the intervals.
        half_width: of the 90 % intervals, in standard deviations.
        provenance: the trainings behind the calibration.
        provisional: whether a coverage study has still to confirm the calibration.
    """

    scatter: tuple[float, float]
    discrepancy: tuple[float, float]
    freedom: tuple[float, float]
    half_width: tuple[float, float]
    provenance: str
    provisional: bool
    assumptions: tuple[float, float] | None = None


@dataclass(frozen=True)
class NotDone:
    """A part of a run that failed after the identification (granpinn/results/attempt.py).

    Attributes:
        what: name of the part.
        why: the reason in a sentence.
    """

    what: str
    why: str

    def __str__(self) -> str:
        """The line for the terminal."""
        return f"no {self.what}: {self.why}"


@dataclass(frozen=True)
class Zones:
    """How the test points were split into flowing and stagnant (zones.py)."""

    d2_threshold: float
    source: str
    n_flowing: int
    n_stagnant: int
