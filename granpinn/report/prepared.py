"""What early.py hands to the page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:  # slow to import
    from granpinn.figures.album import Picture
    from granpinn.report.film import Film
    from granpinn.results import Fields


class Prepared(NamedTuple):
    """Parts of the page of a run that `build` of page.py need not make again.

    Attributes:
        pictures: figures that were drawn.
        film: with all its pixels; None if it could not be made.
        fields: of fields.h5, as it was then.
    """

    pictures: Sequence[Picture] = ()
    film: Film | None = None
    fields: Fields | None = None
