"""The vectors of a conversion: reads files, sets times, selects frames and vectors."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.arrays import Float64
from granpinn.importers import units
from granpinn.importers.arrays import from_arrays
from granpinn.importers.columns import (
    HEADER_LINES,
    NAMES,
    layout_of,
    read_headed,
    require_finite,
)
from granpinn.importers.numerals import number, whole
from granpinn.importers.series import expand, read_vectors
from granpinn.importers.settings import Settings
from granpinn.importers.textfile import TextFile, is_number
from granpinn.importers.vectors import TRACK_WINDOW, DataFileError, Validity, VectorFields

Source = str | Path | Sequence[str | Path] | VectorFields | Mapping[str, Any]
_NUMBER = re.compile(r"(-?)(\d++(?:\.\d++)?(?:[eE][-+]?\d++)?)")


def vectors_of(source: Source, settings: Settings) -> VectorFields:
    """The vectors of the source, with the times of --times."""
    format = settings.format
    if isinstance(source, VectorFields):
        fields = source
    elif isinstance(source, Mapping):
        fields = from_arrays(source)
    else:
        options: dict[str, Any] = {"window": settings.track_window}
        if settings.columns:
            options["columns"] = _columns(settings.columns)
            format = "tracks" if format == "auto" else format
        count = settings.times is not None or units.has(settings.time_unit, "frame")
        fields = read_vectors(source, format, options, count=count)
    if settings.times is not None:
        fields = _with_times(fields, settings, settings.times, source)
    if settings.dimensionless and {fields.length_unit, fields.velocity_unit} - {None, "1", "-"}:
        raise DataFileError(
            f"--dimensionless contradicts the files, whose lengths are in {fields.length_unit} and "
            f"velocities in {fields.velocity_unit}: leave it out and give the calibration"
        )
    return fields


def _columns(text: str) -> dict[str, str]:
    """The names of columns in the files by their roles."""
    known = (*NAMES, "c", "p")
    pairs = [part.partition("=") for part in text.split(",")]
    names = {key.strip(): value.strip() for key, _, value in pairs}
    once = len(names) == len(pairs)
    if not (set(names) <= {*known} and all(names.values()) and once):
        raise DataFileError(
            f"--columns must name some of {', '.join(known)}, such as x=X_mm,y=Y_mm,t=T, got "
            f"{text!r}"
        )
    return names


def _with_times(
    fields: VectorFields, settings: Settings, times: str, source: Source
) -> VectorFields:
    """The vectors with times from a file or from the names of the files."""
    if TRACK_WINDOW in fields.facts:
        raise DataFileError(
            "--times must not be given for tracks, whose velocities follow from the times in their "
            "table: write a column t there"
        )
    unit = None if units.has(fields.time_unit, "frame") else fields.time_unit
    if times == "name":
        if isinstance(source, VectorFields | Mapping):
            raise DataFileError("--times name needs files, got arrays: give t with them")
        t = _times_in_names(expand([source] if isinstance(source, str | Path) else source))
    else:
        t, stated = _times_of(Path(times))
        if stated and settings.time_unit not in (None, stated):
            raise DataFileError(
                f"--time-unit must be {stated}, which the first line of {times} states, got "
                f"{settings.time_unit}: leave it out"
            )
        unit = stated or unit
    old = np.unique(fields.t)
    if not t.size == old.size == np.unique(t).size:
        raise DataFileError(
            f"--times must give another time for every frame of {old.size}, got {t.size} times, "
            f"{np.unique(t).size} of them different: check them"
        )
    new = t[np.searchsorted(old, fields.t)]
    if fields.scattered:
        return replace(fields, t=new, time_unit=unit)
    return replace(_at(fields, np.argsort(new)), t=np.sort(new), time_unit=unit)


def _times_in_names(files: Sequence[Path]) -> Float64:
    """The last number in the name of each file."""
    # The end of "out-0.25" is no suffix.
    stems = [f.name if f.suffix[1:].isdigit() else f.stem for f in files]
    found = [_NUMBER.findall(stem)[-1:] for stem in stems]
    if not all(found):
        raise DataFileError(f"{files[0]} must have a number in its name for --times name")
    if len({minus for ((minus, _),) in found}) > 1:
        raise DataFileError(
            "--times name needs names with a '-' before all numbers or before none, as it may "
            "be a minus: give the times in a file"
        )
    pairs = zip(found, stems, strict=True)
    return np.array([number(digits, f"the time in {stem}") for ((_, digits),), stem in pairs])


def _times_of(path: Path) -> tuple[Float64, str | None]:
    """The times of a file and their unit, None if it states none.

    A single column needs no name. Of several one is t; a column frame sets their order.
    """
    text = TextFile(path)
    roles = {name: NAMES[name] for name in ("t", "frame")}
    named = layout_of(text.head(HEADER_LINES), roles, ("t",)).named
    if not named or is_number(named[0].name):
        rows = text.numbers()
        if rows.shape[1] > 1:
            raise DataFileError(
                f"{path} must hold one number in every row, got {rows.shape[1]}: write a first "
                "line that names the column of the times t"
            )
        return rows[:, 0], None
    if len(named) == 1:
        roles = {"t": (named[0].name,)}
    table = read_headed(path, ("t",), roles)
    require_finite(path, table.columns)
    t, unit = table.columns["t"], table.units.get("t")
    frame = table.columns.get("frame", np.zeros(t.size))
    return t[np.argsort(frame, kind="stable")], unit


def _at(fields: VectorFields, kept: Any) -> VectorFields:
    """The vectors at these places of their first axis: frames of a grid, or scattered vectors."""
    names = ("t", *fields.arrays(), *(("y", "x") if fields.scattered else ()))
    return replace(fields, **{name: getattr(fields, name)[kept] for name in names})


def measured(fields: VectorFields, settings: Settings) -> VectorFields:
    """Makes interpolated vectors invalid, or measured ones if the setting says so; and zeros."""
    code = Validity.VALID if settings.keep_interpolated else Validity.INVALID
    codes = np.where(fields.validity == Validity.INTERPOLATED, np.int8(code), fields.validity)
    if settings.zeros == "missing":
        codes[(fields.u == 0) & (fields.v == 0)] = Validity.INVALID
    gone = codes == Validity.INVALID
    u, v = (np.where(gone, np.nan, a) for a in (fields.u, fields.v))
    return replace(fields, validity=codes, u=u, v=v)


def frames_of(text: str) -> slice:
    """The slice of --frames; DataFileError if it is none."""
    parts = text.split(":")
    try:
        chosen = slice(*(whole(part, "--frames") if part.strip() else None for part in parts))
        if len(parts) < 2 or (chosen.step is not None and chosen.step < 1):
            raise TypeError
    except (DataFileError, TypeError):
        raise DataFileError(
            f"--frames must be FIRST:LAST:STEP such as 10:200:2, got {text!r}"
        ) from None
    return chosen


def selected_frames(fields: VectorFields, settings: Settings) -> VectorFields:
    """The frames of --frames."""
    if settings.frames is None:
        return fields
    times = np.unique(fields.t)[frames_of(settings.frames)]
    if times.size < settings.fewest_frames:
        raise DataFileError(
            f"--frames must leave {settings.fewest_words}, got {times.size} of "
            f"{np.unique(fields.t).size}"
        )
    return _at(fields, np.isin(fields.t, times))
