"""LaVision DaVis: .vc7 through LaVision's own lvpyio, and the text export of DaVis 8.

.vc7: ACTIVE_CHOICE selects one of the components U0..U3; ENABLED and MASK mark the vectors. Choice
4 is a vector that post-processing filled in or smoothed. Some readers read U0 alone, which gives
other vectors than DaVis shows.

Text: `#DaVis 8.1.6 2D-vector 32 64 64 "position" "mm" "position" "mm" "velocity" "m/s"`, then x, y,
u, v separated by tabs, often with decimal commas. An exact (0, 0) means "no vector".
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.arrays import Int8
from granpinn.foreign import installed
from granpinn.importers.columns import Column, read_table, units_of
from granpinn.importers.limits import read_file
from granpinn.importers.tables import grid_frame, require_rows
from granpinn.importers.textfile import TextFile
from granpinn.importers.units import si
from granpinn.importers.vectors import DataFileError, Validity, VectorFields, vector_fields

POST_PROCESSED = 4  # of ACTIVE_CHOICE
# If more than this share of the vectors is post-processed, all were smoothed, not some filled in.
ALL_SMOOTHED = 0.95
_TEXT_HEADER = re.compile(
    r"#\s*+DaVis\s++(\S++)\s++2D-vector\s++(\d++)\s++(\d++)\s++(\d++)\s*+(.*+)"
)
_MAX_TEXT_UNIT = 40
# Memory for a small buffer. lvpyio fills all that it may take if the sizes in a file are damaged.
LEAST_BYTES = 2**28


def sniff_vc7(path: Path, head: bytes) -> bool:
    """Whether the file has a suffix of DaVis; the content has no mark."""
    return path.suffix.lower() in (".vc7", ".im7")


def sniff_text(path: Path, head: bytes) -> bool:
    """Whether the first line names DaVis."""
    return head.lstrip(b"\xef\xbb\xbf# ").startswith(b"DaVis")


def read_vc7(path: Path) -> VectorFields:
    """The frame of one buffer; needs lvpyio."""
    if not installed("lvpyio"):
        raise DataFileError(
            f"{path} is a DaVis file, which needs LaVision's package lvpyio: pip install "
            "'granpinn[lavision]', or export it from DaVis as text"
        )
    frame = read_file("davis", path, least_bytes=LEAST_BYTES)
    if "image" in frame:
        raise DataFileError(f"{path} must hold vectors, got an image: convert the .vc7 of it")
    rows, columns = frame["u"].shape
    codes, smoothed = _codes(frame)
    sigmas = {
        name: np.where(frame[name] > 0, frame[name], np.nan)[None]
        for name in ("sigma_u", "sigma_v")
        if name in frame
    }
    stated = {"v": frame["units"]["u"], **frame["units"]}
    pixels = {n: "px/frame" for n, u in stated.items() if n not in "xy" and u in ("pixel", "px")}
    t = _acquired(frame["acquired"])
    return vector_fields(
        t=[0.0 if t is None else t],
        x=frame["x_slope"] * (np.arange(columns) + 0.5) * frame["x_step"] + frame["x_offset"],
        y=frame["y_slope"] * (np.arange(rows) + 0.5) * frame["y_step"] + frame["y_offset"],
        u=frame["u"][None],
        v=frame["v"][None],
        validity=codes[None],
        **sigmas,
        **units_of(path, stated | pixels) | {"time_unit": "frame" if t is None else "s"},
        # Both the slope of y and the sign of v follow the frame of the scales.
        y_down=bool(frame["y_slope"] > 0),
        facts={"frame_dt": frame["frame_dt"], "smoothed": smoothed},
    )


def _codes(frame: dict[str, Any]) -> tuple[Int8, str]:
    """Validity of the vectors [Y, X], and "yes" if all of them are smoothed."""
    enabled = frame["enabled"]
    codes = np.where(enabled, Validity.VALID, Validity.INVALID).astype(np.int8)
    processed = enabled & (frame["choice"] == POST_PROCESSED)
    smoothed = processed.sum() > ALL_SMOOTHED * enabled.sum()
    if not smoothed:
        codes[processed] = Validity.INTERPOLATED
    codes[~frame["mask"]] = Validity.MASKED
    return codes, "yes" if smoothed else "no"


def _acquired(text: str) -> float | None:
    """Time of acquisition in seconds since the start of the recording, if the file has it."""
    if not text or len(text) > _MAX_TEXT_UNIT:
        return None
    try:
        return si(text, "time", "AcqTimeSeries")
    except DataFileError:
        return None


def read_text_export(path: Path) -> VectorFields:
    """One frame of the text export."""
    text = TextFile(path)
    first = text.head(1)[0]
    head = _TEXT_HEADER.match(first)
    if head is None:
        raise DataFileError(
            f"{path} must begin with '#DaVis ... 2D-vector', got {first[:40]!r}: export the "
            "vectors from DaVis as text"
        )
    quoted = head[5].split('"')[1::2]
    stated = list(zip(quoted[::2], quoted[1::2], strict=False))
    lengths = [unit for name, unit in stated if name == "position"]
    velocities = [unit for name, unit in stated if name in ("velocity", "displacement")]
    pixels = any(unit in ("pixel", "px") for unit in velocities)
    velocities = ["px/frame" if unit in ("pixel", "px") else unit for unit in velocities]
    named = map(Column, "xyuv", (*_both(path, lengths), *_both(path, velocities)))
    table = read_table(text, {name: (name,) for name in "xyuv"}, [*named], "xyuv")
    require_rows(path, table.columns["x"].size, head[3], head[4])
    none = (table.columns["u"] == 0) & (table.columns["v"] == 0)
    for name in "uv":
        table.columns[name] = np.where(none, np.nan, table.columns[name])
    # Of displacements in pixels, the order of the rows shows the direction of y.
    down = None if pixels else False
    return grid_frame(path, table, y_down=down, facts={"davis": head[1]})


def _both(path: Path, stated: list[str]) -> tuple[str, str]:
    """The units of two components; one unit holds for both."""
    if len(stated) > 2:
        raise DataFileError(f"{path} must state two units of a kind at most, got {len(stated)}")
    return (stated[0], stated[-1]) if stated else ("", "")
