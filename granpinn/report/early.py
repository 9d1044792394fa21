"""The part of the page that is made while the pressure is simulated: most figures, and the film.

Nothing that follows the law, such as the simulated pressure, changes them.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from granpinn.output import make_folder
from granpinn.report.painters import Painters
from granpinn.report.prepared import Prepared


def draw(run_dir: str | Path, painters: Painters | None = None) -> Prepared:
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
    return Prepared(pictures, film, source.fields)
