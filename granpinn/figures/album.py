"""All figures of a run in their order."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from granpinn.figures import curves, maps
from granpinn.figures.style import Drawing, NothingToDraw, png
from granpinn.output import make_folder, write_bytes
from granpinn.results import Fields
from granpinn.results.fields import VARIABLES, after_start
from granpinn.results.record import why_not_done

if TYPE_CHECKING:
    from granpinn.identification.identified import Identification

Figures = dict[str, tuple[str, Callable[["Identification", float | None], Drawing]]]


class Picture(NamedTuple):
    """A figure that was drawn: the name of its file, its content, title and caption."""

    name: str
    png: bytes
    title: str
    caption: str


def fields_of(run: Identification) -> Fields:
    """The fields of a run with grains; the message of NothingToDraw names a missing part."""
    absent = set(VARIABLES) - {"p_reference"} - set(run.grid.values)
    if absent:
        raise NothingToDraw(f"fields.h5 lacks {', '.join(sorted(absent))}")
    if not after_start(run.grid).any():
        raise NothingToDraw("fields.h5 has no grid point inside the grains after the start")
    return run.grid


# File name -> title, and the drawing of a run whose maps are at a time.
FIGURES: Figures = {
    "friction_law": ("Friction law", lambda run, _: curves.friction_law(run, fields_of(run))),
    "pressure": ("Pressure", lambda run, time: maps.pressure_fields(fields_of(run), time)),
    "velocity": ("Speed", lambda run, time: maps.velocity_fields(fields_of(run), time)),
    "evolution": ("Course of the training", lambda run, _: curves.evolution(run, run.history)),
}

# Of a result of several flows with one law; the figures of a flow are in its folder.
FLOWS: Figures = {"friction_law": ("Friction law", lambda run, _: curves.friction_law(run, None))}


def draw_all(
    run: Identification, folder: Path, time: float | None
) -> tuple[list[Picture], dict[str, str]]:
    """Write every possible figure to `folder`; remove old files of figures that are missing.

    Returns:
        The figures, and why others are missing, by their titles.
    """
    make_folder(folder)
    figures = {
        name: (title, partial(draw, run, time))
        for name, (title, draw) in (FLOWS if run.flows else FIGURES).items()
    }
    for record in run.checks.values():
        for name, (title, draw) in record.figures().items():
            figures[name] = title, partial(draw, run)
    pictures, missing = [], {}
    for name, (title, draw) in figures.items():
        path = folder / f"{name}.png"
        try:
            figure, caption = draw()
            picture = Picture(name, png(figure), title, caption)
            write_bytes(path, picture.png)
            pictures.append(picture)
        except Exception as error:
            missing[title] = why_not_done(error)
            path.unlink(missing_ok=True)
    return pictures, missing
