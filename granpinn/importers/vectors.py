"""Velocity vectors with their validity, in the units of the instrument: the result of every reader.

Instruments mark invalid vectors in different ways, and a vector filled with 0 looks like static
grains. So all readers use one enumeration, and vectors that were not measured are NaN.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from granpinn.arrays import Bool, Int8, plain_array
from granpinn.data.flow import LARGEST
from granpinn.data.particles import closed
from granpinn.data.schema import FRACTION_TOLERANCE
from granpinn.declared import require_fields
from granpinn.errors import BadInput

MAX_UNIT = 60  # characters
MAX_MESSAGE = 600
# The fact of vectors that are differences of positions in their file: their unit is length / time.
TRACK_WINDOW = "track_window"
# The facts of a calibration: meters per pixel; m/s of one pixel per pair, by two names.
CALXY, CALUV, CALU = CALIBRATION = ("calxy", "caluv", "calu")
NUMBERS = ("u", "v", "sigma_u", "sigma_v", "c", "p")  # of every vector
GAPS = "gaps"  # the fact "mask" of files whose gaps show the mask (`split_gaps`)


class DataFileError(BadInput):
    """A measurement file cannot be used; the message is one sentence with the remedy.

    A message may quote a file. So it becomes one printable line of at most 600 characters; what is
    longer loses its middle.
    """

    def __init__(self, message: str) -> None:
        line = " ".join(message.split())
        line = line if line.isprintable() else "".join(c if c.isprintable() else "?" for c in line)
        if len(line) > MAX_MESSAGE:
            line = f"{line[: MAX_MESSAGE // 2]} ... {line[-MAX_MESSAGE // 2 + 5 :]}"
        super().__init__(line)


class Validity(enum.IntEnum):
    """Validity of a vector."""

    MASKED = 0  # outside the grains or the field of view, by a mask
    VALID = 1
    INTERPOLATED = 2  # filled in from its neighbors, not measured
    INVALID = 3  # inside, but the instrument found no vector or rejected it


@dataclass(frozen=True, eq=False)
class VectorFields:
    """Vectors on a grid [T, Y, X], or scattered [n], in the units of their file.

    In standard form: float64, NaN for no vector, and the axes of a grid ascending.

    Attributes:
        t, y, x: times [T] and coordinates [Y], [X]; of scattered vectors [n] each.
        u, v: velocity; NaN where invalid or masked.
        validity: a `Validity` for every vector; by default VALID if u and v are finite.
        sigma_u, sigma_v: standard deviations like u, or None.
        c: volume fraction of grains like u, or None if only a mask is known.
        p: reference pressure like u, or None; simulations have it.
        length_unit, time_unit, velocity_unit: such as "px", "frame" and "px/frame", "1" for
            dimensionless data, None if unknown.
        y_down: whether y and v point down, as in an image; None if unknown.
        facts: further statements of the file, for the record.

    Raises:
        DataFileError: the arrays do not fit together, or hold impossible numbers.
    """

    t: Any
    y: Any
    x: Any
    u: Any
    v: Any
    validity: Any = None
    sigma_u: Any = None
    sigma_v: Any = None
    c: Any = None
    p: Any = None
    length_unit: str | None = None
    time_unit: str | None = None
    velocity_unit: str | None = None
    y_down: bool | None = None
    facts: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require_fields(self, DataFileError)
        for name in ("t", "y", "x", *NUMBERS):
            if (given := getattr(self, name)) is None:
                continue
            values = plain_array(given, name, DataFileError).astype(np.float64, copy=False)
            if name in "tyx" and not np.isfinite(values).all():
                raise DataFileError(
                    f"{name} must be finite, got NaN or infinity: leave these vectors out"
                )
            if (found := largest(values)) > LARGEST:
                raise DataFileError(
                    f"{name} must be at most {LARGEST:g} in magnitude, got {found:g}: the file is "
                    "damaged, or a unit or a scale is wrong"
                )
            self._put(name, values.reshape(-1) if name in "tyx" else values)
        if self.time_unit in ("frames", "fr"):
            self._put("time_unit", "frame")
        shape = (self.t.size,) if self.scattered else (self.t.size, self.y.size, self.x.size)
        for name in (*NUMBERS, "validity"):
            if (values := getattr(self, name)) is not None and np.shape(values) != shape:
                raise DataFileError(
                    f"{name} must have the shape {list(shape)} of t, y, x, got "
                    f"{list(np.shape(values))}: give a value for every vector"
                )
        if 0 in (*shape, self.y.size, self.x.size):
            raise DataFileError(
                f"u and v must hold at least one vector, got the shape {list(shape)}: check which "
                "frames the file holds"
            )
        self._put_gaps()
        if not self.scattered:
            self._put_in_order()
        self._check_fraction()
        for name in ("length_unit", "time_unit", "velocity_unit"):
            unit = getattr(self, name) or ""
            if len(unit) > MAX_UNIT or not unit.isprintable():
                raise DataFileError(
                    f"the {name.replace('_', ' ')} of the file must be a unit such as mm or px, "
                    f"got {unit[:MAX_UNIT]!r}: export the file again"
                )

    def _put(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    def _put_gaps(self) -> None:
        """NaN where nothing was measured, and no measured vector that is NaN."""
        finite = np.isfinite(self.u) & np.isfinite(self.v)
        codes = np.full(self.u.shape, Validity.VALID) if self.validity is None else self.validity
        measured = np.isin(codes, (Validity.VALID, Validity.INTERPOLATED))
        codes = np.where(measured & ~finite, Validity.INVALID, codes)
        self._put("validity", codes.astype(np.int8))
        gaps = ~(measured & finite)
        for name in ("u", "v"):
            if not np.isnan(values := getattr(self, name))[gaps].all():
                self._put(name, np.where(gaps, np.nan, values))

    def _put_in_order(self) -> None:
        """The axes ascending; an error for repeated coordinates."""
        for axis, name in enumerate(("t", "y", "x")):
            values = getattr(self, name)
            order = np.argsort(values, kind="stable")
            again = np.diff(values[order]) <= 0
            if again.any():
                raise DataFileError(
                    f"{name} must have every value once, got {values[order][1:][again][0]:g} "
                    "twice: the file mixes grids or holds a frame twice"
                )
            if (np.diff(order) < 0).any():
                self._put(name, values[order])
                for other, array in self.arrays().items():
                    self._put(other, array.take(order, axis))

    def _check_fraction(self) -> None:
        if self.c is None:
            return
        c = self.c[~np.isnan(self.c) & (self.validity != Validity.MASKED)]
        low, high = float(c.min(initial=0.0)), float(c.max(initial=0.0))
        if low < -FRACTION_TOLERANCE or high > 1 + FRACTION_TOLERANCE:
            raise DataFileError(
                f"c must be a volume fraction from 0 to 1, got {low:g} to {high:g}: divide per "
                "cent by 100, grey levels by 255, and cut off what a solver makes beyond 0 and 1"
            )

    @property
    def scattered(self) -> bool:
        """Whether the vectors are scattered, not on a grid."""
        return bool(self.u.ndim == 1)

    def arrays(self) -> dict[str, Any]:
        """The arrays with one value per vector."""
        parts = {name: getattr(self, name) for name in ("validity", *NUMBERS)}
        return {name: part for name, part in parts.items() if part is not None}

    def at(self, kept: Any) -> VectorFields:
        """The vectors at these places of their first axis: frames of a grid, or scattered ones."""
        names = ("t", *self.arrays(), *(("y", "x") if self.scattered else ()))
        return replace(self, **{name: getattr(self, name)[kept] for name in names})

    @property
    def usable(self) -> Bool:
        """Vectors that were measured."""
        return np.asarray(self.validity == Validity.VALID)


def largest(values: npt.NDArray[Any]) -> float:
    """The largest magnitude among the finite values, 0 if there is none."""
    return float(np.max(np.abs(values), where=np.isfinite(values), initial=0.0))


def split_gaps(measured: Bool) -> Int8:
    """Validity of every cell: VALID for a vector, INVALID for a gap inside, MASKED for one outside.

    A gap is inside if vectors enclose it, or if it is at most two cells wide.

    Args:
        measured: [T, Y, X].
    """
    codes = np.full(measured.shape, Validity.MASKED, np.int8)
    for code, frame in zip(codes, measured, strict=True):
        code[grains_around(frame)] = Validity.INVALID
        code[frame] = Validity.VALID
    return codes


def grains_around(measured: Bool) -> Any:
    """Cells [Y, X] with a vector or among vectors."""
    return scipy.ndimage.binary_fill_holes(closed(measured))
