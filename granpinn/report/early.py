"""The part of the page that is made while the pressure is simulated: most figures, and the film.

Nothing that follows the law, such as the simulated pressure, changes them.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from granpinn.output import make_folder
from granpinn.report.painters import Painters

if TYPE_CHECKING:  # slow to import
    from granpinn.figures.album import Picture
    from granpinn.report.film import Film
    from granpinn.results import Fields


class Early(NamedTuple):
    """What `build` of granpinn/report/page.py need not make again.

    Attributes:
        pictures: figures that were drawn.
        film: with all its pixels; None if it could not be made.
        fields: of fields.h5, as it was then.
    """

    pictures: Sequence[Picture] = ()
    film: Film | None = None
    fields: Fields | None = None


def draw(run_dir: str | Path, painters: Painters | None = None) -> Early:
    """Draw the figures and the film of a run folder as it is now; `build` makes the others.

    Args:
        painters: the processes that draw the figures, if there are any. Meanwhile this one loads
            the libraries of the page, and makes the film.

    Raises:
        ResultsFileError: there is no valid results.json.
    """
    folder = Path(run_dir)
    figures = make_folder(folder / "figures")
    with ThreadPoolExecutor(1) as pool:
        painted = None if painters is None else pool.submit(painters.draw)
        from granpinn.figures import album
        from granpinn.report import page

        source, _ = page.read(folder)
        if painted is None:
            pictures, _ = album.draw_all(source, figures)
        film = page.largest_film(source)
        if painted is not None:
            found = painted.result().items()
            pictures = [album.Picture(figures / f"{name}.png", *one) for name, one in found]
    return Early(pictures, film, source.fields)
