"""Checks of a flow: likely mistakes in its file, its quality, and the precision that it allows.

A check is one file of this folder: a record (results/record.py), a function that makes it from an
`Inspection`, and `CHECK`. To add a check, add its file; to remove it, delete the file. `inspect`
makes them all, `convert` and `train` the quick ones. All of them compare the flow with itself and
with what physics fixes, without a network.
"""

from __future__ import annotations

import textwrap
from functools import cached_property
from typing import Any

import numpy as np

from granpinn.arrays import Float64, Index
from granpinn.config import SideWalls
from granpinn.data import Flow, FlowFileError
from granpinn.data.large import slabs, thinned
from granpinn.data.scaling import initial_height, scales_of
from granpinn.data.symmetry import steady_mean, with_layer, words
from granpinn.errors import warn
from granpinn.estimates import confined
from granpinn.estimates.body import Body, body_of
from granpinn.estimates.facts import Facts, InertialNumbers, inertial_numbers
from granpinn.physics.law_values import CompleteLaw
from granpinn.physics.scales import Scales
from granpinn.results.decoding import plain
from granpinn.results.record import (
    FLOW,
    GRADES,
    IMPOSSIBLE,
    IMPROBABLE,
    SLIPS,
    Check,
    Reason,
    Record,
    every,
    why_not_done,
)

# Some frames are taken evenly from the whole flow: so many at most, and fewer of a large grid.
MOST_FRAMES, FEWEST_FRAMES, MOST_CELLS = 48, 16, 1_000_000
LINE_WIDTH, MOST_LINES = 100, 28  # of the text; the command adds one or two lines
NEGLIGIBLE_NOISE = 1e-4  # of the largest speed


class AssumedLaw(CompleteLaw):
    """The friction law for which the precision is estimated.

    Raises:
        ValueError: as `CompleteLaw`, or a value is at the end of its range; one sentence.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        own = self.friction_law.parameters
        for p, value, before in zip(own, self.theta, (0.0, *self.theta), strict=False):
            least = before if p.variable == "log_above" else 0.0
            if value <= least:
                raise ValueError(f"{p.name} must be larger than {least:g}, got {value:g}")

    @property
    def inertial_scale(self) -> float | None:
        """The inertial number at which the law bends, None if it has none."""
        name = self.friction_law.inertial_scale
        return None if name is None else float(getattr(self, name))


class Inspection:
    """A flow, the records of its checks, and what several checks need, which is measured once.

    Attributes:
        filmed: the flow with all its frames.
        given: the assumed friction law, in its own units.
        side_walls: their friction, for a flow that states their distance.
        records: by the names of the checks.
        not_done: the checks that failed, with the reason.
    """

    def __init__(
        self, flow: Flow, law: AssumedLaw | None = None, side_walls: SideWalls | None = None
    ) -> None:
        self.filmed = with_layer(flow)
        self.given = law or AssumedLaw()
        self.side_walls = side_walls
        self.records: dict[str, Record] = {}
        self.not_done: dict[str, str] = {}

    def __getitem__(self, name: str) -> Any:
        """The record of a check; KeyError if it was not made."""
        return self.records[name]

    def take(self, check: Check) -> None:
        """Make a check and keep its record, or the reason why it failed.

        Raises:
            FlowFileError: the file cannot be read.
        """
        try:
            with np.errstate(all="ignore"):  # what is not finite decides nothing
                record = check.make(self)
        except Exception as error:
            self.not_done[check.name] = why_not_done(error, FlowFileError)
        else:
            self.records |= {} if record is None else {check.name: record}

    @cached_property
    def flow(self) -> Flow:
        """The flow as it trains: a steady one is its mean over time (data/symmetry.py), and a large
        one has fewer frames."""
        return thinned(steady_mean(self.filmed))

    @cached_property
    def scales(self) -> Scales:
        """Of the flow."""
        return scales_of(self.flow)

    @cached_property
    def facts(self) -> Facts:
        """What the vectors of the measured flow show."""
        return Facts(self.flow, self.scales)

    @cached_property
    def inertia(self) -> InertialNumbers:
        """I at the cells with a velocity gradient."""
        return inertial_numbers(self.facts)

    @cached_property
    def law(self) -> AssumedLaw:
        """The assumed law in the units and over the range of I of the flow."""
        return self.given.of_flow(self.scales.pressure, self.inertia.quantiles)

    @cached_property
    def undetermined(self) -> str | None:
        """Why the flow gives no friction coefficient (estimates/confined.py)."""
        return confined.undetermined(self.flow, "V0" if self.flow.surface is None else "V1")

    @cached_property
    def height(self) -> float:
        """Extent along gravity of all places that held grains, in the unit of the file."""
        flow = self.filmed
        if flow.particles is not None:
            places = flow.height(flow.particles.x, flow.particles.y)
        else:
            grains = np.any([(flow.c[k] >= 1).any(axis=0) for k in slabs(flow)], 0)
            rows, columns = np.nonzero(grains)
            places = flow.height(flow.x[columns], flow.y[rows])
        return max(float(np.ptp(places)), initial_height(flow))

    @cached_property
    def vectors(self) -> tuple[Index, Float64, Float64]:
        """Some frames, and their u and v [K, Y, X], NaN where there is no vector."""
        flow = self.filmed
        size = int(np.clip(MOST_CELLS // flow.c[0].size, FEWEST_FRAMES, MOST_FRAMES))
        frames = np.unique(np.linspace(0, flow.t.size - 1, size).round().astype(int))
        valid = flow.valid_in(frames)
        u, v = (np.where(valid, a[frames], np.nan).astype(np.float64) for a in (flow.u, flow.v))
        return frames, u, v

    @cached_property
    def speeds(self) -> Float64:
        """Speeds of the vectors of some frames, or of all scattered ones [n]."""
        if self.filmed.particles is not None:
            return np.hypot(self.filmed.particles.u, self.filmed.particles.v, dtype=np.float64)
        _, u, v = self.vectors
        speeds = np.hypot(u, v)
        return np.asarray(speeds[np.isfinite(speeds)])

    @cached_property
    def body(self) -> Body:
        """The grains as one body."""
        return body_of(self.filmed)

    @property
    def time_unit(self) -> str:
        """Behind a number, with a space."""
        return "" if self.filmed.time_unit == "1" else f" {self.filmed.time_unit}"

    @property
    def velocity_unit(self) -> str:
        """In words; "1" for a flow without units."""
        return self.filmed.units.of("velocity") or "1"

    @property
    def reasons(self) -> list[Reason]:
        """What the records say: slips with the most certain first, then facts, then advice."""
        found, explained = [], False
        for check in every(FLOW):
            record = self.records.get(check.name)
            own = [] if record is None else record.reasons(self)
            if check.explains:
                own = [r for r in own if not (explained and r.grade in SLIPS)]
                explained |= any(r.grade in SLIPS for r in own)
            found += own
        order = (*SLIPS, *GRADES)
        return sorted(found, key=lambda reason: order.index(reason.grade))

    @property
    def slips(self) -> tuple[Reason, ...]:
        """Likely mistakes of unit, sign, size or order, the most certain first."""
        return tuple(reason for reason in self.reasons if reason.grade in SLIPS)

    @property
    def answer(self) -> str:
        """What these data tell of a law, in a sentence."""
        grades = {slip.grade for slip in self.slips}
        balance = self.records.get("momentum_balance")
        if IMPOSSIBLE in grades:
            return "Training refuses these data, which are impossible: mend the flow file first."
        if IMPROBABLE in grades:
            return (
                "A law from these data is not to be used, as they are improbable: explain what "
                "stands above, or mend the flow file."
            )
        if self.undetermined is not None:
            return f"No friction coefficient can be given: {self.undetermined}."
        if getattr(balance, "carried", False):
            return "A law from these data is not to be used: walls carry the grains."
        precision = self.records.get("precision")
        return getattr(precision, "sentence", "The precision was not estimated.")

    @property
    def sentences(self) -> list[str]:
        """The answer, facts and advice, the most important one first; without the slips."""
        return [self.answer, *(r.sentence for r in self.reasons if r.grade not in SLIPS)]

    def lines(self) -> list[str]:
        """At most `MOST_LINES` lines: slips, numbers, sentences."""
        rows = [("symmetry", "; ".join(words(self.facts.invariant)))]
        for record in self.records.values():
            names = [record.title, *[""] * record.words.count("\n")]
            rows += zip(names, record.words.split("\n"), strict=True)
        rows += [(name, f"not done: {why}") for name, why in self.not_done.items()]
        lines = []
        for slip in self.slips:
            lines += textwrap.wrap(str(slip), LINE_WIDTH, subsequent_indent="  ")
        lines += [*(f"{name:<16} {text}" for name, text in rows if text), ""]
        for sentence in self.sentences:
            wrapped = textwrap.wrap(
                sentence, LINE_WIDTH, initial_indent="- ", subsequent_indent="  "
            )
            lines += wrapped
        if len(lines) > MOST_LINES:
            lines = [*lines[: MOST_LINES - 1], "- ... more in inspect.json"]
        return lines

    def numbers(self) -> dict[str, Any]:
        """All numbers as JSON values, for inspect.json; in the units of the file."""
        law, flow = self.law.friction_law, self.filmed
        found: dict[str, Any] = plain(
            {
                "law": {"name": law.name, **dict(zip(law.names, self.law.theta, strict=True))},
                "symmetries": words(self.facts.invariant),
                "length_unit": flow.length_unit,
                "time_unit": flow.time_unit,
                "initial_height": self.scales.length,
                "velocity_scale": self.scales.velocity,
                "friction_refused_because": self.undetermined,
                "slips": self.slips,
                "facts": self.sentences,
                "checks": self.records,
                "not_done": self.not_done,
            }
        )
        return found


def inspect(
    flow: Flow, law: AssumedLaw | None = None, side_walls: SideWalls | None = None
) -> Inspection:
    """Make all checks of a flow, without training; the precision is that of `law`."""
    found = Inspection(flow, law, side_walls)
    for check in every(FLOW):
        found.take(check)
    return found


def quick(flow: Flow) -> Inspection:
    """Make the quick checks of a flow, which find slips."""
    found = Inspection(flow)
    for check in every(FLOW):
        if check.quick:
            found.take(check)
    return found


def digits(value: float) -> str:
    """Two significant digits, such as "0.12", "3.2" or "4,000"."""
    return f"{float(f'{value:.2g}'):,g}" if abs(value) < 1e6 else f"{value:.1e}"


def about(ratio: float) -> str:
    """A factor with two digits, such as "980 times" or "1/980 of"."""
    text = digits(max(ratio, 1 / ratio))
    return f"{text} times" if ratio >= 1 else f"1/{text} of"


def refuse_slips(flow: Flow) -> Inspection:
    """Make the quick checks of a flow; warn of slips, and of checks that fail.

    Raises:
        FlowFileError: for the first impossible slip.
    """
    found, name = quick(flow), "" if flow.path is None else f"{flow.path}: "
    for slip in found.slips:
        if slip.grade == IMPOSSIBLE:
            raise FlowFileError(f"{name}{slip.sentence}")
        warn(f"{name}{slip.sentence}")
    for check, why in found.not_done.items():
        warn(f"{name}the check {check} of the flow was not done: {why}")
    return found
