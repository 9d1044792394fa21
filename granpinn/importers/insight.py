"""TSI Insight's .vec files: Tecplot text with all facts about the file in its first line.

`VARIABLES="X mm", "Y mm", "U m/s", "V m/s", "CHC", ...`, `LengthUnit`, `MicrosecondsPerDeltaT`,
`ZONE I=41, J=43`. A velocity "pixel" means pixels per DeltaT. The choice code CHC is above 0 for a
good vector: 1 is the first correlation peak; larger codes come from post-processing and count as
interpolated. Codes of 0 and below are rejected vectors, although u and v hold numbers.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from granpinn.importers.numerals import number, whole
from granpinn.importers.tables import to_grid, y_points_down
from granpinn.importers.textfile import TextFile
from granpinn.importers.vectors import DataFileError, Validity, VectorFields, vector_fields

_HEADER_LINES = 50
_DELTA = re.compile(r'MicrosecondsPerDeltaT="(\d++(?:\.\d*+)?)"')
_SIZE = re.compile(r"I=\s*+(\d++),\s*+J=\s*+(\d++)")
_MICROSECONDS = 1e-6


def sniff(path: Path, head: bytes) -> bool:
    """A Tecplot title and the choice code among the variables."""
    text = head.decode("utf-8", "replace").lstrip("\ufeff ")
    return text.startswith("TITLE=") and '"CHC"' in text


def read(path: Path) -> VectorFields:
    """One frame; see the module for the layout."""
    text = TextFile(path)
    lines = text.head(_HEADER_LINES)
    start = next((i + 1 for i, line in enumerate(lines) if "ZONE" in line), 0)
    head = " ".join(lines[:start])
    variables = head[head.find("VARIABLES") :].partition("DATASETAUXDATA")[0].partition("ZONE")[0]
    names = [name.split() for name in variables.split('"')[1::2]]
    found = {name[0].upper(): i for i, name in enumerate(names) if name}
    missing = [name for name in ("X", "Y", "U", "V", "CHC") if name not in found]
    if missing:
        raise DataFileError(
            f"{path} must name the variables X, Y, U, V and CHC in its first line, got no "
            f"{', '.join(missing)}: export it from Insight as .vec"
        )
    table = text.numbers(start)
    zone = _SIZE.search(head.partition("ZONE")[2])
    if zone and len(table) != whole(zone[1], f"{path}: I") * whole(zone[2], f"{path}: J"):
        raise DataFileError(
            f"{path} must hold {zone[1]} x {zone[2]} vectors as its ZONE says, got {len(table)}: "
            "the file was cut off; export it again"
        )
    if table.shape[1] < len(names):
        raise DataFileError(
            f"{path} must have {len(names)} columns like its VARIABLES, got {table.shape[1]}"
        )
    columns = {name.lower(): table[:, found[name]] for name in ("X", "Y", "U", "V")}
    chc = table[:, found["CHC"]]
    codes = np.where(chc == 1, Validity.VALID, Validity.INTERPOLATED)
    codes[~(chc > 0)] = Validity.INVALID
    delta = _DELTA.search(head)
    delay = number(delta[1], f"{path}: MicrosecondsPerDeltaT") if delta else 0.0
    units = {name: " ".join(names[found[name]][1:]) or None for name in ("X", "U")}
    velocity_unit = units["U"]
    if velocity_unit in ("pixel", "pixels"):
        velocity_unit = "px/frame"
        if delay > 0:
            velocity_unit = "px/s"
            for name in ("u", "v"):
                columns[name] = columns[name] / (delay * _MICROSECONDS)
    grids = to_grid(path, columns, codes)
    down, facts = y_points_down(columns)
    return vector_fields(
        t=[0],
        **grids,
        length_unit=units["X"],
        time_unit="frame",
        velocity_unit=velocity_unit,
        y_down=down,
        facts=facts | ({"pulse_delay_us": delta[1]} if delta else {}),
    )
