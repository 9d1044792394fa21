"""All figures of a run in their order, with the data that each needs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import NamedTuple

from granpinn.arrays import Floats
from granpinn.figures import curves, maps
from granpinn.figures.style import Drawing, NothingToDraw, save
from granpinn.output import make_folder
from granpinn.results import Fields, Result
from granpinn.results.attempt import NotDone, attempt
from granpinn.results.fields import VARIABLES, after_start

History = Mapping[str, Floats]


class Source(NamedTuple):
    """The contents of a run folder; `frame` is the index of the time of maps."""

    result: Result
    fields: Fields | None
    history: History | None
    frame: int


class Picture(NamedTuple):
    """A figure that was drawn: its file, title and caption."""

    path: Path
    title: str
    caption: str

    @property
    def words(self) -> str:
        """The caption after the title, which it does not repeat."""
        rest = self.caption.removeprefix(self.title)
        return rest if rest != self.caption else f". {self.caption}"


class Missing(NamedTuple):
    """A figure that could not be drawn, and the reason."""

    title: str
    reason: str


def fields_of(source: Source) -> Fields:
    """The fields of a run with grains; the message of NothingToDraw names a missing part."""
    if source.fields is None:
        raise NothingToDraw("there is no fields.h5 that can be read")
    absent = set(VARIABLES) - {"p_reference"} - set(source.fields.values)
    if absent:
        raise NothingToDraw(f"fields.h5 lacks {', '.join(sorted(absent))}")
    if not after_start(source.fields).any():
        raise NothingToDraw("fields.h5 has no grid point inside the grains after the start")
    return source.fields


def _history(source: Source) -> History:
    if source.history is None:
        raise NothingToDraw("there is no history.csv that can be read")
    return source.history


# file name -> (title, drawing function)
FIGURES: dict[str, tuple[str, Callable[[Source], Drawing]]] = {
    "friction_law": ("Friction law", lambda s: curves.friction_law(s.result, fields_of(s))),
    "pressure": ("Pressure", lambda s: maps.pressure_fields(fields_of(s), s.frame)),
    "velocity": ("Speed", lambda s: maps.velocity_fields(fields_of(s), s.frame)),
    "evolution": ("Course of the training", lambda s: curves.evolution(s.result, _history(s))),
}

# Of a result of several flows with one law; the figures of a flow are in its folder.
FLOWS: dict[str, tuple[str, Callable[[Source], Drawing]]] = {
    "friction_law": ("Friction law", lambda s: curves.law_of_flows(s.result)),
}


def figures_of(result: Result) -> dict[str, tuple[str, Callable[[Source], Drawing]]]:
    """All figures of a run, those of its checks included."""
    found = dict(FLOWS if result.flows else FIGURES)
    for record in result.checks.values():
        found |= record.figures()
    return found


def draw_all(source: Source, folder: Path) -> tuple[list[Picture], list[Missing]]:
    """Write every possible figure to `folder`; remove old files of figures that are missing."""
    make_folder(folder)
    pictures, missing = [], []
    for name, (title, draw) in figures_of(source.result).items():
        path = folder / f"{name}.png"
        picture = attempt(partial(_write, draw, source, path, title))
        if isinstance(picture, NotDone):
            path.unlink(missing_ok=True)
            missing.append(Missing(title, picture.why))
        else:
            pictures.append(picture)
    return pictures, missing


def _write(draw: Callable[[Source], Drawing], source: Source, path: Path, title: str) -> Picture:
    drawing = draw(source)
    save(drawing.figure, path)
    return Picture(path, title, drawing.caption)
