"""From the frames of a film to a flow: measurement.py has the stages in their order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from granpinn.config import setting, settings_of
from granpinn.data.flow import Flow
from granpinn.importers import DataFileError, Settings
from granpinn.importers.conversion import settings_from

# Settings of a conversion that have no meaning for pictures.
WITHOUT = (
    *("format", "zeros", "keep_interpolated"),
    *("track_window", "pulse_delay", "times", "length_unit", "time_unit", "velocity_unit"),
    *("dimensionless", "flip_y", "window"),
)


@dataclass(frozen=True)
class FilmSettings(Settings):
    """The settings of a conversion, and the part of the pictures to use."""

    roi: str | None = setting(
        None,
        "region of interest in px from the upper left corner, LEFT:RIGHT,TOP:BOTTOM",
        group="files",
    )


SETTINGS = {name: s for name, s in settings_of(FilmSettings).items() if name not in WITHOUT}


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
    own = settings_from(settings, FilmSettings, SETTINGS, "film")
    if find_spec("cv2") is None:
        raise DataFileError("films need OpenCV: pip install 'granpinn[film]'")
    from granpinn.filming.measurement import measure  # imports OpenCV

    found = measure(sources, own, report)
    if page is not None:
        from granpinn.filming.page import write  # matplotlib is slow to import

        write(found, Path(page))
    return found.flow
