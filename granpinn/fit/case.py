"""A flow with its settings as a training problem."""

from __future__ import annotations

import dataclasses
import hashlib
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import torch

from granpinn.config import Config, ConfigError
from granpinn.data import Flow, add_noise, check_flow, known_sd, read_flow, with_partial_cells
from granpinn.data.collocation import LARGEST_PART
from granpinn.data.flow import Surface
from granpinn.data.large import available
from granpinn.data.scaling import scales_of
from granpinn.data.surface import surface_sd
from granpinn.data.symmetry import said
from granpinn.data.walls import segments_of
from granpinn.estimates.facts import Facts, inertial_numbers
from granpinn.inspection import refuse_slips
from granpinn.inspection.momentum_balance import Baseline, baseline
from granpinn.kernels.builds import choose_device
from granpinn.physics.laws import LAWS
from granpinn.physics.scales import Scales
from granpinn.results.record import Reason
from granpinn.training import problem, room
from granpinn.training.objective import Member
from granpinn.training.points import training_set, training_sets, vector_count

COPIES = 4  # of a network, for the assumptions of one flow (assumptions.py)


@dataclass(frozen=True)
class Case:
    """A flow, the settings to identify it with, and the part of it that training uses.

    Attributes:
        flow: as in its file; of a large flow, every n-th frame (granpinn/data/large.py).
        slips: likely mistakes of the flow, which were warned of.
        config: with the seed and the I0 of this case.
        seen: the flow that training uses: with added noise and its partly filled cells under the
            surface, without the true values.
        known_sd: rms standard deviation of its velocity, in the units of the file; 0: not known.
        facts: what the vectors of `seen` show; members of one flow share it.
        made: further values, which are made once for all members of one flow.
    """

    flow: Flow
    slips: tuple[Reason, ...]
    config: Config
    scales: Scales
    member: Member
    seen: Flow
    known_sd: float
    facts: Facts
    made: dict[Any, Any] = field(default_factory=dict)

    @property
    def sampled(self) -> str | None:
        """Which frames of a large flow are used, or that a flow is a mean, in words."""
        return said(self.flow)

    @property
    def surface_sd(self) -> float:
        """Standard deviation of the offset of the surface line (granpinn/data/surface.py)."""
        return float(self._once("sd", lambda: surface_sd(self.flow, self.config.level)))

    def balance(self, scale: float) -> Baseline:
        """The momentum balance with a law of an inertial scale."""
        found: Baseline = self._once(
            scale, lambda: baseline(self.seen, scale, self.config.side_walls)
        )
        return found

    def _once(self, name: Any, make: Callable[[], Any]) -> Any:
        if name not in self.made:
            self.made[name] = make()
        return self.made[name]


def pose(flow: Flow | str | os.PathLike[str], config: Config) -> Case:
    """Read and check a flow, and make the problem that the training solves.

    Raises:
        FlowFileError: the flow breaks a rule, or contradicts the conservation of mass or energy.
    """
    choose_device(config.device)
    return posed(*sound(flow), config)


def sound(flow: Flow | str | os.PathLike[str]) -> tuple[Flow, tuple[Reason, ...]]:
    """A flow that was read and checked (a steady one as its mean), and its likely slips.

    Raises:
        FlowFileError: as `pose`.
    """
    if isinstance(flow, Flow):
        check_flow(flow)
    else:
        flow = read_flow(flow)
    checked = refuse_slips(flow)
    return checked.flow, checked.slips


def posed(flow: Flow, slips: tuple[Reason, ...], config: Config) -> Case:
    """The problem of a sound flow with its likely slips."""
    # Training gets neither the true parameters nor the reference pressure.
    bare = dataclasses.replace(flow, truth=None, p=None)
    room.require(need_of_case(bare, config), available(), "memory")
    seen = add_noise(bare, config.noise, config.seed)
    scales = scales_of(seen)
    seen = with_partial_cells(seen)
    data = training_set(seen, scales, *of_points(config))
    facts = Facts(seen, scales)
    built = problem.build(facts, data, config)
    law = LAWS[config.law]
    if not law.compiled and config.form != "mixed":
        raise ConfigError(
            f"--form {config.form} needs a law of granpinn, got your own law {law.name}: take the "
            "mixed form"
        )
    member = Member(built, data, config.seed, law, fixed_values(config, facts), flow)
    return Case(
        flow=flow,
        slips=slips,
        config=config,
        scales=scales,
        member=member,
        seen=seen,
        known_sd=known_sd(seen),
        facts=facts.without_arrays(),
    )


def need_of_case(flow: Flow, config: Config) -> dict[str, int]:
    """Bytes of the parts of the training of a flow: its members, copies for two assumptions."""
    count = most_points(flow, config.batch.collocation)
    device = choose_device(config.device).type
    need = room.need_of(config, config.members, [count], device, copies=COPIES)
    if device == "cuda":  # the GPU has the networks
        need = {}
    points = room.POINT * getattr(torch, config.dtype).itemsize * count
    return need | {"points": points, "flow": room.CELL * flow.c.size}


def most_points(flow: Flow, share: float) -> int:
    """Points of a training set at most: vectors, points between them, in the strip, on walls."""
    vectors = vector_count(flow)
    between = round(share * vectors) if flow.particles is None else 0
    walls = 0
    if flow.walls is not None:
        walls = int(segments_of(flow.walls).length.sum() / max(flow.spacing)) * flow.t.size
    return round((1 + LARGEST_PART) * (vectors + between)) + walls


def fixed_values(config: Config, facts: Facts) -> dict[str, float]:
    """Values of the fixed parameters of the friction law, by name: given, of the flow, or usual.

    Raises:
        ConfigError: the range of I of the flow contradicts a given value.
    """
    law = LAWS[config.law]
    usual = {p.name: p.start for p in law.parameters if p.fixed}
    given = config.rheology.fixed | ({"I0": config.I0} if "I0" in usual else {})
    levels = {name: level for name, level in law.quantiles.items() if name not in given}
    found = inertial_numbers(facts).quantiles(*levels.values()) if levels else None
    own = dict(zip(levels, found, strict=True)) if found else {}
    values = usual | own | given
    try:
        law.check_range(values)
    except ValueError as error:
        raise ConfigError(f"--rheology.fix: {error}") from None
    return values


def with_variants(case: Case, variants: Sequence[tuple[Flow, Surface]]) -> list[Member]:
    """The member of a case with the data of variants of its flow (`training_sets`)."""
    settings = of_points(case.config)
    sets = training_sets(variants, case.seen, case.scales, *settings, case.member.data)
    return [dataclasses.replace(case.member, data=data) for data in sets]


def of_points(config: Config) -> tuple[str, torch.dtype, float]:
    """The settings of a training set: level, dtype, and share of points between vectors."""
    return config.level, getattr(torch, config.dtype), config.batch.collocation


def members(case: Case) -> list[Case]:
    """The ensemble of a case: its first member, and others that differ in their seeds."""
    config, made = case.config, [case]
    for k in range(1, config.members):
        member = dataclasses.replace(case.member, seed=member_seed(config.seed, k))
        made.append(dataclasses.replace(case, member=member))
    return made


def member_seed(seed: int, k: int) -> int:
    """The seed of member k of an ensemble, in [0, 2^63); member 0 has the given seed.

    The others are hashed, so that ensembles of neighboring seeds have no member in common.
    """
    if k == 0:
        return seed
    digest = hashlib.sha256(f"{seed} {k}".encode()).digest()
    return int.from_bytes(digest[:8], "big") >> 1
