"""The vectors of a conversion: the formats of files, their frames and times, the frames to use."""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from granpinn.arrays import Float64
from granpinn.data.flow_file import is_flow_file
from granpinn.importers import arrays, grids, pivlab_mat, tracks, units
from granpinn.importers.columns import (
    GROUPS,
    NAMES,
    Column,
    head_of,
    header,
    is_number,
    lines_of,
    read_headed,
    read_table,
    require_finite,
    roles_in,
    text_lines,
)
from granpinn.importers.grids import MIXED, ROWS
from granpinn.importers.limits import require_room
from granpinn.importers.settings import Settings
from granpinn.importers.vectors import (
    CALIBRATION,
    TRACK_WINDOW,
    DataFileError,
    Validity,
    VectorFields,
)
from granpinn.terminal import shell_word


class Format(NamedTuple):
    """The title of a format of files, for messages and --help, and its reader."""

    title: str
    read: Callable[..., VectorFields]


TRACKS = "tracks"
FORMATS = {
    "pivlab-mat": Format("PIVlab .mat: frame or all frames", pivlab_mat.read),
    TRACKS: Format("tracks of particles, a table: trackpy, TrackMate, TracTrac", tracks.read),
    "pivlab": Format("PIVlab text", grids.read_pivlab),
    "davis": Format("LaVision DaVis text", grids.read_davis),
    "basilisk": Format("Basilisk output_field", grids.read_basilisk),
    "openpiv": Format("OpenPIV text", grids.read_openpiv),
    "table": Format("a table of x, y, u, v", grids.read_rows),
    "npz": Format("NumPy arrays", arrays.read),
}


def detect(path: Path) -> str:
    """The name of the format of a file, from its content."""
    head = head_of(path)
    if not head:
        raise DataFileError(f"{path} is empty, expected vectors: export it again")
    lines, kind = lines_of(head), path.suffix.lower()
    first, comment = lines[0].lstrip("# "), lines[0].startswith("#")
    named = {column.name: column.unit for column in header(first)}
    of_tracks, of_grids = (roles_in(lines, NAMES, required) for required in ("xy", "xyuv"))
    pivlab = first.startswith(grids.PIVLAB)
    matlab = head.startswith(b"MATLAB") or (kind == ".mat" and head.startswith(b"\x89HDF"))
    shown = {  # strict tests before weak ones
        "pivlab-mat": matlab,
        TRACKS: not pivlab and of_tracks >= {"x", "y"} and of_tracks & {"frame", "t"},
        "pivlab": pivlab or (named.keys() >= {*"xyuv"} and named["x"] in ("px", "m")),
        "davis": first.startswith("DaVis"),
        "basilisk": comment and grids.NUMBERED.findall(first)[:2] == ["x", "y"],
        "openpiv": comment and named.keys() == {*"xyuv", *grids.OPENPIV_CODES},
        "table": of_grids >= {*"xyuv"},
        "npz": head.startswith(b"PK") and kind == ".npz",
    }
    if found := next((name for name in FORMATS if shown[name]), None):
        return found
    if is_flow_file(path):
        raise DataFileError(
            f"{path} is a flow file already: python -m granpinn.train {shell_word(path)}"
        )
    raise DataFileError(
        f"{path} is of no known format: name it with --format {{{','.join(FORMATS)}}}, export the "
        "vectors as plain arrays (.npz) or a table, or take them as arrays in Python"
    )


AUTO = "auto"
MAX_PATH = 4096  # of Linux
_NUMBER = re.compile(r"(\d++(?:\.\d++)?)")
Source = str | Path | Sequence[str | Path] | VectorFields | Mapping[str, Any]
_TIME = re.compile(r"(-?)(\d++(?:\.\d++)?(?:[eE][-+]?\d++)?)")
_SAME_GRID = 1e-6  # of the extent


def vectors_of(source: Source, settings: Settings) -> VectorFields:
    """The vectors of the source, with the times of --times."""
    if isinstance(source, VectorFields):
        fields = source
    elif isinstance(source, Mapping):
        fields = arrays.from_arrays(source)
    else:
        count = settings.times is not None or units.has(settings.time_unit, "frame")
        fields = read_vectors(source, settings.format, settings.track_window, count=count)
    if settings.times is not None:
        fields = _with_times(fields, settings, settings.times, source)
    if settings.dimensionless and {fields.length_unit, fields.velocity_unit} - {None, "1", "-"}:
        raise DataFileError(
            f"--dimensionless contradicts the files, whose lengths are in {fields.length_unit} and "
            f"velocities in {fields.velocity_unit}: leave it out and give the calibration"
        )
    return fields


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
    return replace(fields, t=t[np.searchsorted(old, fields.t)], time_unit=unit)


def _times_in_names(files: Sequence[Path]) -> Float64:
    """The last number in the name of each file."""
    # The end of "out-0.25" is no suffix.
    stems = [f.name if f.suffix[1:].isdigit() else f.stem for f in files]
    found = [_TIME.findall(stem)[-1:] for stem in stems]
    if not all(found):
        raise DataFileError(f"{files[0]} must have a number in its name for --times name")
    if len({minus for ((minus, _),) in found}) > 1:
        raise DataFileError(
            "--times name needs names with a '-' before all numbers or before none, as it may "
            "be a minus: give the times in a file"
        )
    pairs = zip(found, stems, strict=True)
    return np.array([units.number(digits, f"the time in {stem}") for ((_, digits),), stem in pairs])


def _times_of(path: Path) -> tuple[Float64, str | None]:
    """The times of a file and their unit, None if it states none.

    A single column needs no name; a column frame sets the order of the others.
    """
    roles = {name: NAMES[name] for name in ("t", "frame")}
    if is_number(text_lines(path)[0]):
        table = read_table(path, roles, [Column("t")], ("t",), 0)
    else:
        table = read_headed(path, ("t",), roles)
    require_finite(path, table.columns)
    t = table.columns["t"]
    frame = table.columns.get("frame", np.zeros(t.size))
    return t[np.argsort(frame, kind="stable")], table.units.get("t")


def measured(fields: VectorFields, settings: Settings) -> VectorFields:
    """Makes interpolated vectors invalid, or measured ones if the setting says so; and zeros."""
    code = Validity.VALID if settings.keep_interpolated else Validity.INVALID
    codes = np.where(fields.validity == Validity.INTERPOLATED, np.int8(code), fields.validity)
    if settings.zeros == "missing":
        codes[(fields.u == 0) & (fields.v == 0)] = Validity.INVALID
    return replace(fields, validity=codes)


def frames_of(text: str) -> slice:
    """The slice of --frames; DataFileError if it is none."""
    parts = text.split(":")
    try:
        chosen = slice(*(units.whole(part, "--frames") if part.strip() else None for part in parts))
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
    return fields.at(np.isin(fields.t, np.unique(fields.t)[frames_of(settings.frames)]))


def read_vectors(
    paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    format: str = AUTO,
    window: int = 5,
    *,
    count: bool = False,
) -> VectorFields:
    """The vectors of one file or of a series of files, as the instrument gives them.

    Args:
        paths: files in any order (sorted by the numbers in their names), folders, or patterns such
            as "run/PIVlab_*.txt".
        format: a key of `FORMATS`, or "auto".
        window: frames of the local polynomial that gives the velocity of a track.
        count: number files of one frame each as times, and ignore times in the files.

    Raises:
        DataFileError: a file cannot be used; the message is one sentence.
    """
    if format != AUTO and format not in FORMATS:
        raise DataFileError(f"--format must be auto or one of {', '.join(FORMATS)}, got {format!r}")
    files = expand([paths] if isinstance(paths, str | os.PathLike) else paths)
    parts: list[VectorFields] = []
    name = detect(files[0]) if format == AUTO else format
    for file in files:
        if parts and format == AUTO and (found := detect(file)) != name:
            raise DataFileError(
                f"{file} must be in the format {name} like the files before it, got {found}: "
                "convert one kind of files at a time"
            )
        part = FORMATS[name].read(file, *([window] if name == TRACKS else []))
        if count and np.unique(part.t).size == 1:
            part = replace(part, t=np.zeros_like(part.t), time_unit="frame")
        parts.append(part)
        require_room(len(files) * part.u.size * (len(part.arrays()) - 1), file)
    facts = {"format": FORMATS[name].title, "files": str(len(files))}
    joined = parts[0] if len(parts) == 1 else _joined(files, parts)
    return replace(joined, facts=joined.facts | facts)


def expand(paths: Sequence[str | os.PathLike[str]]) -> list[Path]:
    """The files of folders and patterns, sorted by the numbers in their names."""
    found: list[Path] = []
    for given in paths:
        path = Path(given)
        if len(os.fspath(given)) > MAX_PATH or "\0" in os.fspath(given):
            raise DataFileError(f"{str(given)[:60]}... is no path: name a file or a folder")
        if path.is_dir():
            files = [p for p in path.iterdir() if p.is_file() and not p.name.startswith(".")]
            kinds = sorted({file.suffix for file in files})
            if len(kinds) > 1:
                raise DataFileError(
                    f"{path} holds files of several kinds ({', '.join(kinds)}): name those that "
                    f"are meant, such as '{path / ('*' + kinds[0])}'"
                )
            found += files
        elif not path.exists() and any(c in str(given) for c in "*?["):
            try:
                found += Path(path.anchor).glob(str(path.relative_to(path.anchor)))
            except ValueError as error:  # such as "a**"
                raise DataFileError(f"{given} must be a pattern of files, got {error}") from None
        else:
            found.append(path)
    if not found:
        raise DataFileError(f"no file matches {', '.join(map(str, paths))}: check the path")
    for path in found:
        if not path.exists():
            raise DataFileError(f"{path} does not exist: check the path")
        if not path.is_file():
            raise DataFileError(f"{path} must be a file, got a device, a pipe or a folder in it")
    return sorted(dict.fromkeys(found), key=natural)


def natural(path: Path) -> list[tuple[int, float, str]]:
    """Key that sorts frame_9 before frame_10, and t0.10 before t0.9."""
    parts = _NUMBER.split(str(path))
    numbers = range(1, len(parts), 2)
    return [(0, float(p), "") if i in numbers else (1, 0.0, p) for i, p in enumerate(parts)]


def _joined(files: list[Path], parts: list[VectorFields]) -> VectorFields:
    """All frames after one another, on one grid."""
    first, common = parts[0], _common(parts[0])
    for file, part in zip(files, parts, strict=True):
        for what, expected in common.items():
            if (found := _common(part)[what]) != expected:
                raise DataFileError(
                    f"{file} must have the {what} {expected} of {files[0]}, got {found}: convert "
                    "files of one kind at a time"
                )
        if {part.y_down, first.y_down} == {True, False}:
            raise DataFileError(
                f"{file} must have the direction of y of {files[0]}, got the opposite order of "
                "rows: export both in one way"
            )
        for name in () if first.scattered else ("y", "x"):
            a, b = getattr(part, name), getattr(first, name)
            if a.size != b.size or not np.allclose(a, b, rtol=0, atol=_SAME_GRID * np.ptp(b)):
                raise DataFileError(
                    f"{file} must have the grid of {files[0]}, got {a.size} values of {name} from "
                    f"{a[0]:g} to {a[-1]:g} instead of {b.size} from {b[0]:g} to {b[-1]:g}: "
                    "convert files of one grid at a time"
                )
    names = (*first.arrays(), *(("y", "x") if first.scattered else ()))
    together: dict[str, Any] = {
        n: np.concatenate([getattr(part, n) for part in parts]) for n in names
    }
    # One file whose rows show no direction of y leaves it open for all.
    oriented = next((part for part in parts if part.y_down is None), first)
    facts = first.facts | {ROWS: MIXED} if oriented.facts.get(ROWS) == MIXED else first.facts
    t = np.concatenate(_times(parts))
    return replace(first, t=t, **together, y_down=oriented.y_down, facts=facts)


def _common(fields: VectorFields) -> dict[str, Any]:
    """What all files of a series have in common, by its name in a message."""
    return {
        "kind": "scattered vectors" if fields.scattered else "vectors on a grid",
        **{name.replace("_", " "): getattr(fields, name) for name in GROUPS},
        "arrays": ", ".join(fields.arrays()),
        "calibration": ", ".join(f"{n} {v}" for n, v in fields.facts.items() if n in CALIBRATION),
    }


def _times(parts: list[VectorFields]) -> list[Any]:
    """Times of the parts; if every file counts its frames from 0, the count continues."""
    times = [part.t for part in parts]
    ascending = all(a.max() < b.min() for a, b in itertools.pairwise(times))
    counted = all(part.time_unit == "frame" and not part.t.any() for part in parts)
    if ascending or (parts[0].scattered and not counted):
        return times
    if parts[0].time_unit != "frame" or any(t.min() != 0 for t in times):
        raise DataFileError(
            f"the files must have times that increase with their names, got {times[0][0]:g} and "
            f"{times[1][0]:g} in the first two: rename them, give --times, or --time-unit frame to "
            "count them"
        )
    starts = np.cumsum([0, *(np.ptp(t) + 1 for t in times)])
    return [t + start for t, start in zip(times, starts, strict=False)]
