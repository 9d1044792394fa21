"""What the parts of this package need of the open file."""

from __future__ import annotations

from typing import Any, Protocol


class Content(Protocol):
    """An open file; `SafeFile` is the only one."""

    @property
    def n_bytes(self) -> int:
        """Size of the file."""

    @property
    def is_mapped(self) -> bool:
        """Whether the system reads the file page by page, when its bytes are used."""

    def at(self, address: int, length: int) -> bytes:
        """Bytes at an address of HDF5; struct.error beyond the end of the file."""

    def content(self, start: int, length: int) -> memoryview:
        """Bytes at a place of the file."""

    def take(self, n_bytes: int) -> None:
        """Counts bytes that are about to be read."""

    def address(self, item: Any) -> int:
        """Address of the header of an open group or dataset."""
