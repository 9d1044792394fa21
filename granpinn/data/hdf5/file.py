"""Reads a HDF5 file into memory and opens the datasets that lie in the file itself."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import Any

from h5py import h5d, h5f, h5g, h5l, h5o

from granpinn.data.flow import FlowFileError
from granpinn.data.hdf5.attributes import Attributes
from granpinn.data.hdf5.dataset import Dataset
from granpinn.data.hdf5.kinds import HDF5_ERRORS, damage

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
# H5LT_FILE_IMAGE_DONT_COPY | H5LT_FILE_IMAGE_DONT_RELEASE: parse our bytes where they are.
_IN_PLACE = 0x2 | 0x4
_LINKS = {h5l.TYPE_SOFT: "a soft link", h5l.TYPE_EXTERNAL: "a link to another file"}


def read_regular_file(path: Path, max_bytes: int) -> bytes:
    """The content of a regular file; an error for a directory, FIFO, device or larger file."""
    try:
        kind = path.stat().st_mode  # before opening: opening a device can have effects
        if stat.S_ISDIR(kind):
            raise FlowFileError("this is a directory, expected a flow file: name the file in it")
        if not stat.S_ISREG(kind):
            raise FlowFileError("this is no regular file: copy the flow to one and name that")
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(handle, "rb") as file:
            status = os.fstat(handle)
            if not stat.S_ISREG(status.st_mode):
                raise FlowFileError("this file was replaced while it was opened: try again")
            if status.st_size > max_bytes:
                raise too_large(status.st_size, max_bytes)
            content = file.read(status.st_size)
    except FileNotFoundError:
        raise FlowFileError("there is no such file: check the path") from None
    except OSError as error:
        raise FlowFileError(f"the file cannot be opened ({error.strerror}): check it") from None
    if not content:
        raise FlowFileError("the file is empty, expected a flow file: copy or make it again")
    return content


def too_large(n_bytes: int, max_bytes: int) -> FlowFileError:
    """The error for a file that holds or declares more than `max_bytes`."""
    return FlowFileError(
        f"the file must hold at most {max_bytes / 2**30:.3g} GiB of data, got "
        f"{n_bytes / 2**30:.3g} GiB: if it can be trusted, raise max_bytes of read_flow"
    )


class SafeFile:
    """A HDF5 file in memory: a context manager."""

    def __init__(self, image: bytes) -> None:
        # HDF5 looks for the signature at 0, 512, 1024, 2048, ...
        offsets = [0, *(512 << i for i in range(len(image).bit_length()))]
        if not any(image[i : i + 8] == _SIGNATURE for i in offsets):
            raise FlowFileError(
                "this is no HDF5 file, expected a flow file: make one with granpinn.data.write_flow"
            )
        self._image = image  # HDF5 works on these bytes: they must outlive the file

    def __enter__(self) -> SafeFile:
        try:
            self._file = h5f.open_file_image(self._image, flags=_IN_PLACE)
            self._root = h5g.open(self._file, b"/")
        except HDF5_ERRORS:  # their messages are of no use here
            raise FlowFileError(
                "the file is damaged or was cut off, expected a whole HDF5 file: copy or make it "
                "again"
            ) from None
        self.attributes = Attributes(self._root)
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()

    def open_dataset(self, name: str) -> Dataset | None:
        """A dataset that lies in this file itself, None if there is none.

        Args:
            name: of a dataset of the root, or "group/name".
        """
        with damage(name):
            place: Any = self._root
            *groups, _ = parts = name.split("/")
            for depth, part in enumerate(parts):
                if not place.links.exists(part.encode()):
                    return None
                kind = place.links.get_info(part.encode()).type
                if kind != h5l.TYPE_HARD:
                    raise FlowFileError(
                        f"{name} must be stored in the file itself, got "
                        f"{_LINKS.get(kind, 'a user-defined link')}: copy the data into the file"
                    )
                place = h5o.open(place, part.encode())
                if depth < len(groups) and not isinstance(place, h5g.GroupID):
                    raise FlowFileError(
                        f"{part} must be a group that holds {name}, got no group: rename it"
                    )
            if not isinstance(place, h5d.DatasetID):
                raise FlowFileError(
                    f"{name} must be a dataset, got a group or a type: store the data in it"
                )
            return Dataset(name, place, len(self._image))
