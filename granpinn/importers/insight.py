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

from granpinn.importers.columns import Column, read_table
from granpinn.importers.numerals import number
from granpinn.importers.statements import PULSE_DELAY
from granpinn.importers.tables import grid_frame, require_rows
from granpinn.importers.textfile import TextFile
from granpinn.importers.vectors import Validity, VectorFields

_HEADER_LINES = 50
_DELTA = re.compile(r'MicrosecondsPerDeltaT="(\d++(?:\.\d*+)?)"')
_SIZE = re.compile(r"I=\s*+(\d++),\s*+J=\s*+(\d++)")
_MICROSECONDS = 1e-6
_NEEDED = ("x", "y", "u", "v", "chc")


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
    names = [name.partition(" ") for name in variables.split('"')[1::2]]
    named = [Column(name.lower(), unit.strip()) for name, _, unit in names]
    delta = _DELTA.search(head)
    delay = number(delta[1], f"{path}: MicrosecondsPerDeltaT") if delta else 0.0
    table = read_table(text, {name: (name,) for name in _NEEDED}, named, _NEEDED, start)
    zone = _SIZE.search(head.partition("ZONE")[2])
    chc = table.columns.pop("chc")
    if zone:
        require_rows(path, chc.size, zone[1], zone[2])
    codes = np.where(chc == 1, Validity.VALID, Validity.INTERPOLATED)
    codes[~(chc > 0)] = Validity.INVALID
    for name in ("u", "v"):
        if table.units.get(name) in ("pixel", "pixels"):
            table.units[name] = "px/s" if delay > 0 else "px/frame"
            if delay > 0:
                table.columns[name] = table.columns[name] / (delay * _MICROSECONDS)
    facts = {PULSE_DELAY: delta[1]} if delta else {}
    return grid_frame(path, table, codes, facts=facts)
