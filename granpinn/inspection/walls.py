"""The walls of the file, as the vectors beside them show them (data/wall_points.py)."""

from __future__ import annotations

from dataclasses import dataclass

from granpinn.data import with_partial_cells
from granpinn.data.wall_points import WallFacts, contradictions, walls_of
from granpinn.inspection import Inspection
from granpinn.results.record import ADVICE, Check, Reason, Record


@dataclass(frozen=True)
class WallContacts(Record):
    """All walls, in the order of the file."""

    title = "walls"

    walls: tuple[WallFacts, ...]

    @property
    def words(self) -> str:
        return "\n".join(map(str, self.walls))

    def reasons(self, of: Inspection) -> list[Reason]:
        return [Reason(ADVICE, f"{t[0].upper()}{t[1:]}.") for t in contradictions(self.walls)]


def make(inspection: Inspection) -> WallContacts | None:
    flow = with_partial_cells(inspection.flow)
    return None if flow.walls is None else WallContacts(tuple(walls_of(flow, flow.walls)[1]))


CHECK = Check("walls", WallContacts, make, seconds=0.09, quick=False)
