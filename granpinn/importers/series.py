"""Many files, one per frame, as one set of vector fields."""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.importers.columns import GROUPS
from granpinn.importers.formats import FORMATS, detect, read_file
from granpinn.importers.frame import PAIRS
from granpinn.importers.limits import require_room
from granpinn.importers.statements import require_one_calibration
from granpinn.importers.tables import MIXED, ROWS
from granpinn.importers.vectors import IMAGES, DataFileError, VectorFields, vector_fields

AUTO = "auto"
MAX_PATH = 4096  # of Linux
_NUMBER = re.compile(r"(\d++(?:\.\d++)?)")
_SAME_GRID = 1e-6  # of the extent
_MAX_DIGITS = 10  # of the number of an image


def read_vectors(
    paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    format: str = AUTO,
    options: dict[str, Any] | None = None,
    *,
    count: bool = False,
) -> VectorFields:
    """The vectors of one file or of a series of files, as the instrument gives them.

    Args:
        paths: files in any order (sorted by the numbers in their names), folders, or patterns such
            as "run/PIVlab_*.txt".
        format: a key of `FORMATS`, or "auto".
        options: values of the further arguments of the readers.
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
        part = read_file(file, name, options or {})
        parts.append(_counted(part) if count else part)
        require_room(len(files) * part.u.size * (len(part.arrays()) - 1), 8, file)
    facts = {"format": FORMATS[name].title, "files": str(len(files))}
    facts |= {PAIRS: needed} if (needed := _pairs_need(files, parts)) else {}
    joined = parts[0] if len(parts) == 1 else _joined(files, parts)
    return replace(joined, facts=joined.facts | facts)


def _pairs_need(files: list[Path], parts: list[VectorFields]) -> str:
    """The settings without which the times of pairs of images are wrong, by the images' names.

    The usual step s from the first image of a pair to that of the next is one frame. Pairs that
    share no image, and have none between their own two, may be double frames.

    Raises:
        DataFileError: the images of some pairs are farther apart than those of others.
    """
    named = [part.facts.get(IMAGES, "").split() for part in parts]
    if not all(named) or any(max(map(len, pair)) > _MAX_DIGITS for pair in named):
        return ""
    first, second = np.array([[int(number) for number in pair] for pair in named]).T
    apart, steps = second - first, np.diff(first)
    step = float(np.median(steps)) if steps.size else 1.0
    film = bool(np.isin(second, first).any() or (apart > 1).any())
    if apart.min() < 1 or step < 1 or (steps <= 0).any() or not film:
        return ""
    if (apart != apart[0]).any():
        k = int(np.argmax(apart != apart[0]))
        raise DataFileError(
            f"{files[k]} has images that are {apart[k]} apart, and those of {files[0]} are "
            f"{apart[0]} apart: export pairs of one distance"
        )
    needed = {"pulse_delay": apart[0] != step, "times": (steps != step).any()}
    return " ".join(name for name, need in needed.items() if need)


def _counted(part: VectorFields) -> VectorFields:
    """The vectors of a file without their time if all have the same time."""
    if np.unique(part.t).size > 1:
        return part
    return replace(part, t=np.zeros_like(part.t), time_unit="frame")


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
        if None not in (part.y_down, first.y_down) and part.y_down != first.y_down:
            raise DataFileError(
                f"{file} must have the direction of y of {files[0]}, got the opposite order of "
                "rows: export both in one way"
            )
        require_one_calibration({files[0]: first.facts, file: part.facts})
        if not first.scattered:
            _check_grid(file, files[0], part, first)
    arrays = {n: np.concatenate([part.arrays()[n] for part in parts]) for n in first.arrays()}
    axes = {"y": first.y, "x": first.x}
    if first.scattered:
        axes = {name: np.concatenate([getattr(part, name) for part in parts]) for name in axes}
    units = {name: getattr(first, name) for name in GROUPS}
    # One file whose rows show no direction of y leaves it open for all.
    oriented = next((part for part in parts if part.y_down is None), first)
    facts = first.facts | {ROWS: MIXED} if oriented.facts.get(ROWS) == MIXED else first.facts
    t = np.concatenate(_times(parts))
    return vector_fields(t=t, **axes, **arrays, **units, y_down=oriented.y_down, facts=facts)


def _common(fields: VectorFields) -> dict[str, Any]:
    """What all files of a series have in common, by its name in a message."""
    return {
        "kind": "scattered vectors" if fields.scattered else "vectors on a grid",
        **{name.replace("_", " "): getattr(fields, name) for name in GROUPS},
        "arrays": ", ".join(fields.arrays()),
    }


def _times(parts: list[VectorFields]) -> list[Any]:
    """Times of the parts; if every file counts its frames from 0, the count continues."""
    times = [part.t for part in parts]
    ascending = all(a.max() < b.min() for a, b in itertools.pairwise(times))
    counted = all(part.time_unit == "frame" and not part.t.any() for part in parts)
    if ascending or (parts[0].scattered and not counted):
        return times
    if parts[0].time_unit != "frame":
        raise DataFileError(
            f"the files must have times that increase with their names, got {times[0][0]:g} and "
            f"{times[1][0]:g} in the first two: give --times, or --time-unit frame to count them"
        )
    if not all(t.min() == 0 for t in times):
        raise DataFileError(
            "the files must have frame numbers that increase with their names, got others: rename "
            "the files, or convert them apart"
        )
    starts = np.cumsum([0, *(np.ptp(t) + 1 for t in times)])
    return [t + start for t, start in zip(times, starts, strict=False)]


def _check_grid(file: Path, other: Path, part: VectorFields, first: VectorFields) -> None:
    for name in ("y", "x"):
        a, b = getattr(part, name), getattr(first, name)
        if a.size != b.size or not np.allclose(a, b, rtol=0, atol=_SAME_GRID * np.ptp(b)):
            raise DataFileError(
                f"{file} must have the grid of {other}, got {a.size} values of {name} from "
                f"{a[0]:g} to {a[-1]:g} instead of {b.size} from {b[0]:g} to {b[-1]:g}: convert "
                "files of one grid at a time"
            )
