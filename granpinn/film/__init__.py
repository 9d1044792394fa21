"""From the frames of a film to a flow: `granpinn.film(...)` and `python -m granpinn.film`."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from granpinn.command.callable_module import call_like
from granpinn.data.flow import Flow
from granpinn.foreign import installed
from granpinn.importers import DataFileError
from granpinn.importers.reading import settings_of


def film(
    sources: str | Path | Sequence[str | Path],
    *,
    page: str | Path | None = None,
    report: Callable[[str], None] | None = None,
    **settings: Any,
) -> Flow:
    """A flow from the frames of a film.

        flow = granpinn.film(
            "frames/*.png", scale="0.12 mm/px", frame_rate="1500 Hz", grain_diameter="0.8 mm",
            grain_density="2500 kg/m^3", solid_fraction=0.6, page="film.html",
        )

    Args:
        sources: images, a folder or pattern of them, or one video.
        page: HTML file with a picture of every stage.
        report: called with every line of a report.
        settings: as of `python -m granpinn.film`, with _ for -.

    Raises:
        DataFileError: the film or a setting cannot be used; one sentence.
    """
    if not installed("cv2"):
        raise DataFileError("films need OpenCV: pip install 'granpinn[film]'")
    from granpinn.film.measurement import WITHOUT, FilmSettings, measure

    for name in settings:
        if name in WITHOUT:
            raise DataFileError(f"{name} is no setting of a film: leave it out")
    roi = settings.pop("roi", None)
    plain = dataclasses.asdict(settings_of(settings))
    measured = measure(sources, FilmSettings(**plain, roi=roi), report)
    if page is not None:
        from granpinn.film.page import write  # matplotlib is slow to import

        write(measured, Path(page))
    return measured.flow


call_like(film, __name__)
