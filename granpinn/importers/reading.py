"""Measurement files as a flow, in one call."""

from __future__ import annotations

from typing import Any

from granpinn.data.flow import Flow
from granpinn.importers.conversion import convert
from granpinn.importers.settings import Settings
from granpinn.importers.source import Source
from granpinn.importers.vectors import DataFileError


def read(source: Source, **settings: Any) -> Flow:
    """A flow from files of a PIV, PTV or simulation program, or from arrays.

        flow = granpinn.importers.read(
            "run/PIVlab_*.txt",
            scale="0.12 mm/px",
            frame_rate="500 Hz",
            grain_diameter="0.8 mm",
            grain_density="2500 kg/m^3",
            solid_fraction=0.6,
        )

    Args:
        source: files, folders or patterns; or a mapping of arrays t, y, x, u, v (see
            granpinn.importers.arrays).
        settings: as of `python -m granpinn.convert`, with _ for - (see
            granpinn.importers.settings).

    Raises:
        granpinn.importers.DataFileError: files or settings cannot be used; one sentence.
    """
    try:
        chosen = Settings(**settings)
    except TypeError as error:
        raise DataFileError(f"{error}: granpinn.importers.Settings has them all") from None
    return convert(source, chosen)
