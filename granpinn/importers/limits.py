"""Sizes and memory of all readers: what a file declares is checked before memory is taken for it.

Readers count values before they convert them, because the conversion to float64 multiplies the size
of small types: a compressed file of a few megabytes can declare many gigabytes.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from granpinn.data.large import available
from granpinn.foreign import read_foreign
from granpinn.importers.vectors import DataFileError
from granpinn.regular import UnsafeFileError, open_regular_file

MAX_BYTES = 2**33  # of a file
# The arrays of the files, those in SI units, and those of the flow exist at the same time: of u and
# v with their validity 94 bytes a vector at the peak, of scattered vectors 196 for t, x, y, u, v.
COPIES = 6


def require_room(values: float, path: Path | str) -> None:
    """Checks that values can be converted to a flow.

    Args:
        values: how many numbers there will be, such as T * Y * X times the number of arrays.
        path: of the file, for the message.

    Raises:
        DataFileError: the copies of a conversion would be larger than the free memory.
    """
    size, free = COPIES * 8 * values, available()  # of float64
    if size > free:
        raise DataFileError(
            f"{path} needs {size / 2**30:.3g} GiB of memory for its conversion, got "
            f"{free / 2**30:.3g} GiB: use fewer frames, a part of the field or a larger machine"
        )


def read_file(
    reader: str, path: Path, most: int = MAX_BYTES, counted: int | None = None, **request: Any
) -> Any:
    """What a reader of `granpinn.foreign` gives for a file.

    Args:
        most: bytes of the file.
        counted: bytes that limit time and memory in place of those of the file.

    Raises:
        DataFileError: it is no regular file with data, or the reader refuses it.
    """
    try:
        with open_regular_file(path, most, "split it into one file per frame") as stream:
            size = os.fstat(stream.fileno()).st_size
        return read_foreign(reader, path, counted or size, **request)
    except UnsafeFileError as error:
        raise DataFileError(f"{path}: {error}") from None
