"""The table of formats: how to detect and how to read each of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from granpinn.data.reader import is_flow_file
from granpinn.importers import (
    arrays,
    basilisk,
    davis,
    insight,
    openpiv,
    pivlab_mat,
    pivlab_text,
    tracks,
)
from granpinn.importers.textfile import encoding_of
from granpinn.importers.vectors import DataFileError, VectorFields
from granpinn.output import shell_word
from granpinn.regular import UnsafeFileError, first_bytes

HEAD = 4096  # bytes for the detection of a format


@dataclass(frozen=True)
class Format:
    """One file format.

    Attributes:
        title: for messages and --help.
        sniff: tests the path and the first bytes of a file for this format.
        read: reads a file as vector fields.
        options: names of further arguments of `read`.
    """

    title: str
    sniff: Callable[[Path, bytes], bool]
    read: Callable[..., VectorFields]
    options: tuple[str, ...] = ()


# Strict tests come before weak ones.
FORMATS = {
    "pivlab-mat": Format(
        "PIVlab .mat: frame, all frames or session", pivlab_mat.sniff, pivlab_mat.read
    ),
    "tracks": Format(
        "tracks of particles, a table: trackpy, TrackMate, TracTrac, opyf",
        tracks.sniff,
        tracks.read,
        ("window", "columns"),
    ),
    "pivlab": Format("PIVlab text", pivlab_text.sniff, pivlab_text.read),
    "insight": Format("TSI Insight .vec", insight.sniff, insight.read),
    "davis": Format("LaVision DaVis text", davis.sniff_text, davis.read_text_export),
    "vc7": Format("LaVision DaVis .vc7 (needs lvpyio)", davis.sniff_vc7, davis.read_vc7),
    "basilisk": Format("Basilisk output_field", basilisk.sniff, basilisk.read, ("columns",)),
    "openpiv": Format("OpenPIV text", openpiv.sniff, openpiv.read),
    "npz": Format("NumPy arrays", arrays.sniff, arrays.read),
}


def detect(path: Path) -> str:
    """The name of the format of a file, from its content."""
    try:
        head = first_bytes(path, HEAD)
    except UnsafeFileError as error:
        raise DataFileError(f"{path}: {error}") from None
    if (encoding := encoding_of(head)).startswith("utf-16"):
        head = head.decode(encoding, "ignore").encode()
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


def read_file(path: Path, name: str, options: dict[str, Any]) -> VectorFields:
    """One file in a format of that name.

    Args:
        options: values of the further arguments of all readers.
    """
    chosen = FORMATS[name]
    taken = {key: value for key, value in options.items() if key in chosen.options}
    return chosen.read(path, **taken)
