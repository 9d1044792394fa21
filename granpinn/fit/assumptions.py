"""The assumptions of a case that its data do not contain, and their effect on its law.

`TABLE` has one entry for each: a function that gives the assumption of a case, or None where it is
certain. A certain assumption costs nothing.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence

from granpinn.data.flow import WALL_GAP
from granpinn.data.outline import surface_of, with_partial_cells
from granpinn.data.surface import moved
from granpinn.fit.case import Case, with_variants
from granpinn.results.records import Assumed
from granpinn.training.loop import TrainingLoop
from granpinn.training.objective import Member
from granpinn.training.problem import with_wall_friction
from granpinn.uncertainty.sensitivity import Assumption, effects

TIME_SHARE = 0.25  # of the time of a training with a time limit, for the trainings after it


def surface(case: Case) -> Assumption | None:
    """The offset of the surface line along its outward normal; at level V0 of the outline."""
    level = case.config.level
    sd = case.surface_sd
    if sd == 0:
        return None
    given = surface_of(case.seen, level)
    if given.t.size == 0:  # walls all around
        return None
    line = "outline" if level == "V0" else "surface line"

    def pair() -> tuple[Member, Member]:
        seen = case.seen
        flows = [seen, seen]
        if level != "V0" and seen.surface:  # the line decides which partly filled cells count
            stated = dataclasses.replace(seen, c=case.flow.c)
            for k, higher in enumerate(moved(stated, seen.surface, -sd, sd)):
                filled = with_partial_cells(dataclasses.replace(stated, surface=higher))
                flows[k] = dataclasses.replace(seen, c=filled.c)
        surfaces = moved(seen, given, -sd, sd)
        lower, upper = with_variants(case, list(zip(flows, surfaces, strict=True)))
        return lower, upper

    unit, grain = case.flow.length_unit, case.flow.grain_diameter
    return Assumption(Assumed(line, unit, sd, f"{line} one grain higher"), pair, grain)


def side_walls(case: Case) -> Assumption | None:
    """The friction mu_w of the side walls, where the flow states their distance."""
    walls, flow = case.config.side_walls, case.flow
    if flow.stated(WALL_GAP) is None or walls.friction == 0 or walls.friction_sd == 0:
        return None

    def pair() -> tuple[Member, Member]:
        lower = max(0.0, walls.friction - walls.friction_sd)  # friction is not negative
        made = []
        for friction in (lower, lower + 2 * walls.friction_sd):
            problem = with_wall_friction(case.member.problem, flow, case.scales, friction)
            made.append(dataclasses.replace(case.member, problem=problem))
        return made[0], made[1]

    name = "friction of the side walls"
    return Assumption(Assumed(name, "1", walls.friction_sd, f"{name} higher by 0.01"), pair, 0.01)


TABLE: tuple[Callable[[Case], Assumption | None], ...] = (surface, side_walls)


def assumptions_of(case: Case) -> tuple[Assumption, ...]:
    """The uncertain assumptions of a case."""
    return tuple(found for entry in TABLE if (found := entry(case)) is not None)


def share(cases: Sequence[Case]) -> float:
    """What the trainings of assumptions take at most under a time limit, relative to that before.

    Without a limit they take about as long for one assumption.
    """
    different = {id(case.flow): case for case in cases}.values()
    uncertain = any(entry(case) is not None for case in different for entry in TABLE)
    return TIME_SHARE if uncertain else 0.0


def trained(
    asked: Mapping[int, Sequence[Assumption]], run: TrainingLoop
) -> dict[int, tuple[Assumed, ...]]:
    """The effects of assumptions on the laws of members of a run, by their place in it."""
    every = [assumption for uncertain in asked.values() for assumption in uncertain]
    names = " and ".join(dict.fromkeys(a.record.name for a in every))
    run.progress.message(f"training on with another {names}, {2 * len(every)} copies")
    return effects(run.trainer, asked, TIME_SHARE if run.limit is not None else None)
