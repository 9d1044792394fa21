"""The table of formats: how to detect and how to read each of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from granpinn.data.flow_file import is_flow_file
from granpinn.importers import arrays, grids, pivlab_mat, tracks
from granpinn.importers.columns import head_of
from granpinn.importers.vectors import DataFileError, VectorFields
from granpinn.output import shell_word


@dataclass(frozen=True)
class Format:
    """One file format.

    Attributes:
        title: for messages and --help.
        sniff: tests the path and the first bytes of a file for this format.
        read: reads a file as vector fields.
    """

    title: str
    sniff: Callable[[Path, bytes], bool]
    read: Callable[..., VectorFields]


TRACKS = "tracks"
# Strict tests come before weak ones.
FORMATS = {
    "pivlab-mat": Format("PIVlab .mat: frame or all frames", pivlab_mat.sniff, pivlab_mat.read),
    TRACKS: Format(
        "tracks of particles, a table: trackpy, TrackMate, TracTrac",
        tracks.sniff,
        tracks.read,
    ),
    "pivlab": Format("PIVlab text", grids.is_pivlab, grids.read_pivlab),
    "davis": Format("LaVision DaVis text", grids.is_davis, grids.read_davis),
    "basilisk": Format("Basilisk output_field", grids.is_basilisk, grids.read_basilisk),
    "openpiv": Format("OpenPIV text", grids.is_openpiv, grids.read_openpiv),
    "table": Format("a table of x, y, u, v", grids.is_table, grids.read_table_of_vectors),
    "npz": Format("NumPy arrays", arrays.sniff, arrays.read),
}


def detect(path: Path) -> str:
    """The name of the format of a file, from its content."""
    head = head_of(path)
    if not head:
        raise DataFileError(f"{path} is empty, expected vectors: export it again")
    for name, found in FORMATS.items():
        if found.sniff(path, head):
            return name
    if is_flow_file(path):
        raise DataFileError(
            f"{path} is a flow file already: python -m granpinn.train {shell_word(path)}"
        )
    raise DataFileError(
        f"{path} is of no known format: name it with --format {{{','.join(FORMATS)}}}, export the "
        "vectors as plain arrays (.npz) or a table, or take them as arrays in Python"
    )
