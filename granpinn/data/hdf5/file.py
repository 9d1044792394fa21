"""Reads a HDF5 file, in memory or mapped, and opens the datasets that lie in the file itself."""

from __future__ import annotations

import io
import mmap
import struct
from pathlib import Path
from typing import Any

from h5py import h5d, h5f, h5fd, h5g, h5l, h5o, h5p, h5r

from granpinn.data.hdf5.attributes import Attributes
from granpinn.data.hdf5.dataset import Dataset
from granpinn.data.hdf5.kinds import HDF5_ERRORS, damage
from granpinn.regular import RETRY, UnsafeFileError, read_regular_file, too_large

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
# H5LT_FILE_IMAGE_DONT_COPY | H5LT_FILE_IMAGE_DONT_RELEASE: parse our bytes where they are.
_IN_PLACE = 0x2 | 0x4
_LINKS = {h5l.TYPE_SOFT: "a soft link", h5l.TYPE_EXTERNAL: "a link to another file"}
MAX_NAMES = 100_000


class _Pages(io.RawIOBase):
    """A mapped file as a stream, for HDF5."""

    def __init__(self, image: mmap.mmap) -> None:
        self._image, self._place = image, 0

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        start = {io.SEEK_SET: 0, io.SEEK_CUR: self._place, io.SEEK_END: len(self._image)}
        self._place = start[whence] + offset
        return self._place

    def readinto(self, buffer: Any) -> int:
        found = self._image[self._place : self._place + len(buffer)]
        buffer[: len(found)] = found
        self._place += len(found)
        return len(found)


class SafeFile:
    """A HDF5 file, in memory or mapped: a context manager.

    Args:
        image: the content of the file.
        max_bytes: most bytes of arrays that may be read from it, all reads together.
    """

    def __init__(self, image: bytes | mmap.mmap, max_bytes: int) -> None:
        # HDF5 looks for the signature at 0, 512, 1024, 2048, ...
        offsets = [0, *(512 << i for i in range(len(image).bit_length()))]
        if not any(image[i : i + 8] == _SIGNATURE for i in offsets):
            raise UnsafeFileError(f"this is no HDF5 file: {RETRY}")
        self._image = image  # HDF5 works on these bytes: they must outlive the file
        self._max_bytes, self._taken = max_bytes, 0

    def __enter__(self) -> SafeFile:
        try:
            self._file = self._parsed()
            self._root = h5g.open(self._file, b"/")
            self._base = self._file.get_create_plist().get_userblock()
        except HDF5_ERRORS:  # their messages are of no use here
            raise UnsafeFileError(
                f"the file is damaged or was cut off, expected a whole HDF5 file: {RETRY}"
            ) from None
        self.attributes = Attributes(self._root, self)
        return self

    def _parsed(self) -> Any:
        if isinstance(self._image, bytes):
            return h5f.open_file_image(self._image, flags=_IN_PLACE)
        access = h5p.create(h5p.FILE_ACCESS)
        access.set_fileobj_driver(h5fd.fileobj_driver, _Pages(self._image))
        return h5f.open(b"mapped", h5f.ACC_RDONLY, fapl=access)

    def __exit__(self, *error: object) -> None:
        self._file.close()

    @property
    def n_bytes(self) -> int:
        """Size of the file."""
        return len(self._image)

    @property
    def is_mapped(self) -> bool:
        """Whether the system reads the file page by page, when its bytes are used."""
        return not isinstance(self._image, bytes)

    def take(self, n_bytes: int) -> None:
        """Counts bytes that are about to be read; an error beyond the limit of the file."""
        self._taken += n_bytes
        if self._taken > self._max_bytes:
            raise too_large(self._taken, self._max_bytes)

    def content(self, start: int, length: int) -> memoryview:
        """Bytes of the file, all of which must exist."""
        if start + length > len(self._image):
            raise UnsafeFileError(f"the file was cut off, expected a whole HDF5 file: {RETRY}")
        return memoryview(self._image)[start : start + length]

    def address(self, item: Any) -> int:
        """Address of the header of an open group or dataset, as references name it."""
        return int(h5o.get_info(item).addr)

    def at(self, address: int, length: int) -> bytes:
        """Bytes at an address, which counts from the end of the user block."""
        start = self._base + address
        if start + length > len(self._image):
            raise struct.error("an address lies beyond the end of the file")
        return self._image[start : start + length]

    def names(self) -> list[str]:
        """Names of the groups and datasets of the root that lie in the file itself."""
        return list(self.addresses().values())

    def addresses(self) -> dict[int, str]:
        """The names by the address of the group or dataset."""
        with damage("the list of names"):
            count = self._root.get_num_objs()
            if count > MAX_NAMES:
                raise UnsafeFileError(
                    f"the file must have at most {MAX_NAMES} datasets, got {count}: split it"
                )
            found = [self._root.get_objname_by_idx(i) for i in range(count)]
            links = [(name, self._root.links.get_info(name)) for name in found]
            return {
                int(link.u): name.decode("utf-8", "surrogateescape")
                for name, link in links
                if link.type == h5l.TYPE_HARD
            }

    def holds(self, name: str) -> bool:
        """Whether the root has an entry of this name, of any kind."""
        with damage(name):
            return bool(self._root.links.exists(name.encode("utf-8", "surrogateescape")))

    def is_group(self, name: str) -> bool:
        """Whether the root has a group of this name."""
        with damage(name):
            encoded = name.encode("utf-8", "surrogateescape")
            return bool(h5g.get_objinfo(self._root, encoded, False).type == h5g.GROUP)

    def dereference(self, name: str, reference: Any) -> Dataset | None:
        """The dataset of this file that a reference names; None for an empty reference.

        Args:
            name: for messages.
            reference: of `Dataset.references`.
        """
        if not reference:
            return None
        with damage(name):
            return self._dataset(name, h5r.dereference(reference, self._file))

    def open_dataset(self, name: str) -> Dataset | None:
        """A dataset that lies in this file itself, None if there is none.

        Args:
            name: of a dataset of the root, or "group/name".
        """
        with damage(name):
            place: Any = self._root
            *groups, _ = parts = name.split("/")
            for depth, part in enumerate(parts):
                encoded = part.encode("utf-8", "surrogateescape")
                if not place.links.exists(encoded):
                    return None
                kind = place.links.get_info(encoded).type
                if kind != h5l.TYPE_HARD:
                    raise self._elsewhere(name, kind)
                place = h5o.open(place, encoded)
                if depth < len(groups) and not isinstance(place, h5g.GroupID):
                    raise UnsafeFileError(
                        f"{part} must be a group that holds {name}, got no group: rename it"
                    )
            return self._dataset(name, place)

    def check_all(self) -> None:
        """Raises an error unless another HDF5 library could read the whole file safely.

        Every group and dataset must lie in the file, and hold numbers and fixed-length text that
        the file holds in full.
        """
        waiting, seen = [("", self._root)], set[int]()
        while waiting:
            name, group = waiting.pop()
            with damage(name or "/"):
                Attributes(group, self).check_all()
                for i in range(group.get_num_objs()):
                    part = group.get_objname_by_idx(i)
                    path = f"{name}/{part.decode('utf-8', 'replace')}"
                    kind = group.links.get_info(part).type
                    if kind == h5l.TYPE_SOFT:
                        continue  # to another name in the file
                    if kind != h5l.TYPE_HARD:
                        raise self._elsewhere(path, kind)
                    item = h5o.open(group, part)
                    address = self.address(item)
                    if address in seen:
                        continue
                    seen.add(address)
                    if len(seen) > MAX_NAMES:
                        raise UnsafeFileError(
                            f"the file must have at most {MAX_NAMES} datasets, got more: split it"
                        )
                    if isinstance(item, h5g.GroupID):
                        waiting.append((path, item))
                    else:
                        dataset = self._dataset(path, item)
                        dataset.attributes.check_all()
                        if dataset.holds_text:
                            continue
                        dataset.read()

    def _elsewhere(self, name: str, kind: int) -> UnsafeFileError:
        return UnsafeFileError(
            f"{name} must be stored in the file itself, got "
            f"{_LINKS.get(kind, 'a user-defined link')}: copy the data into the file"
        )

    def _dataset(self, name: str, item: Any) -> Dataset:
        if not isinstance(item, h5d.DatasetID):
            raise UnsafeFileError(
                f"{name} must be a dataset, got a group or a type: store the data in it"
            )
        return Dataset(name, item, self)


def open_hdf5(path: Path, max_bytes: int) -> SafeFile:
    """A regular file as a SafeFile, to be used in a `with` statement.

    Args:
        max_bytes: largest size of the file, and of all arrays that are read from it.

    Raises:
        UnsafeFileError: see `read_regular_file` and `SafeFile`.
    """
    return SafeFile(read_regular_file(path, max_bytes), max_bytes)
