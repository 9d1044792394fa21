"""A zarr folder in memory, as a store of zarr that holds nothing but checked content.

Only the metadata and the chunks of the variables that are used are opened. They must be regular
files of the folder itself. A chunk must unpack to the size that the metadata declare, and says so
before it is unpacked.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from struct import error as StructError
from struct import unpack_from
from typing import Any

from granpinn.importers import zarr_metadata
from granpinn.importers.zarr_metadata import Array
from granpinn.regular import UnsafeFileError, read_regular_file, too_large

MAX_CHUNKS = 100_000
LARGE_CHUNK = 2**26
_ZSTD = 0xFD2FB528
_CHECKSUM_BYTES = 4


def open_store(folder: Path, names: tuple[str, ...], max_bytes: int) -> Any:
    """A read-only store of the arrays of these names that the root of the folder holds.

    Args:
        max_bytes: of all files together, and of all unpacked arrays as float64.

    Raises:
        UnsafeFileError: a document, a codec or a chunk breaks a rule.
        ImportError: zarr is not installed.
    """
    from zarr.core.buffer import default_buffer_prototype
    from zarr.storage import MemoryStore

    buffer = default_buffer_prototype().buffer
    found = _Folder(folder, max_bytes).content(names)
    store = {key: buffer.from_bytes(content) for key, content in found.items()}
    return MemoryStore(store, read_only=True)


class _Folder:
    def __init__(self, folder: Path, max_bytes: int) -> None:
        self._folder, self._max_bytes, self._left = folder, max_bytes, max_bytes
        self._checked: set[Path] = set()
        self._chunks = 0

    def content(self, names: tuple[str, ...]) -> dict[str, bytes]:
        """Documents and chunks by key."""
        second = self._read("zarr.json") is None
        arrays = {name: self._array(name, second) for name in names}
        found = self._root(second)
        declared = 0
        for name, array in arrays.items():
            if array is None:
                continue
            n_bytes = 8 * math.prod(array.shape)
            declared += n_bytes
            if declared > self._max_bytes:
                raise too_large(declared, self._max_bytes)
            if array.chunk_bytes > max(4 * n_bytes, LARGE_CHUNK):
                raise UnsafeFileError(
                    f"{name} must have chunks no larger than itself, got {array.chunk_bytes} "
                    "bytes: write it again with chunks of whole frames"
                )
            found |= {f"{name}/{key}": text for key, text in array.documents.items()}
            for key, chunk in self._stored(name, array):
                found[key] = chunk
        return found

    def _root(self, second: bool) -> dict[str, bytes]:
        if second:
            attributes = zarr_metadata.checked_attributes(self._document(".zattrs") or {})
            return {
                ".zgroup": b'{"zarr_format": 2}',
                ".zattrs": zarr_metadata.dump(attributes),
            }
        document = self._document("zarr.json") or {}
        attributes = zarr_metadata.checked_attributes(document.get("attributes") or {})
        group = {"zarr_format": 3, "node_type": "group", "attributes": attributes}
        return {"zarr.json": zarr_metadata.dump(group)}

    def _array(self, name: str, second: bool) -> Array | None:
        key = f"{name}/{'.zarray' if second else 'zarr.json'}"
        document = self._document(key)
        if document is None:
            return None
        try:
            if second:
                return zarr_metadata.version_2(document, self._document(f"{name}/.zattrs") or {})
            return zarr_metadata.version_3(document)
        except UnsafeFileError as error:
            raise UnsafeFileError(f"{key}: {error}") from None

    def _document(self, key: str) -> dict[str, Any] | None:
        content = self._read(key)
        try:
            return None if content is None else zarr_metadata.parse(content)
        except UnsafeFileError as error:
            raise UnsafeFileError(f"{key}: {error}") from None

    def _stored(self, name: str, array: Array) -> Iterator[tuple[str, bytes]]:
        """Chunks that exist; zarr fills the others with the value that the metadata give."""
        self._chunks += math.prod(array.counts)
        if self._chunks > MAX_CHUNKS:
            raise UnsafeFileError(
                f"the arrays must have at most {MAX_CHUNKS} chunks, got {self._chunks}: write it "
                "again with chunks of whole frames"
            )
        for index in product(*map(range, array.counts)):
            key = f"{name}/{array.key(index)}"
            content = self._read(key)
            if content is not None:
                _check_size(key, content, array)
                yield key, content

    def _read(self, key: str) -> bytes | None:
        """A regular file of the folder, None if there is none; no link leads out of it."""
        path = self._folder
        for part in key.split("/"):
            path = path / part
            if path in self._checked:
                continue
            if path.is_symlink():
                raise UnsafeFileError(f"{key} must be a file of the folder, got a link: copy it")
            if not path.exists():
                return None
            if path.is_dir():
                self._checked.add(path)
        try:
            content = read_regular_file(path, self._left, follow=False)
        except UnsafeFileError as error:
            raise UnsafeFileError(f"{key}: {error}") from None
        self._left -= len(content)
        return content


def _check_size(key: str, content: bytes, array: Array) -> None:
    """Raises an error unless a chunk unpacks to the declared size."""
    body = content[:-_CHECKSUM_BYTES] if array.checksum else content
    try:
        size = _unpacked_bytes(body, array.compressor, array.chunk_bytes)
    except (StructError, zlib.error, IndexError):
        size = None
    if size != array.chunk_bytes:
        found = "an unknown size" if size is None else f"{size} bytes"
        raise UnsafeFileError(
            f"{key} must unpack to {array.chunk_bytes} bytes as declared, got {found}: it is "
            "damaged, write it again"
        )


def _unpacked_bytes(content: bytes, compressor: str | None, expected: int) -> int | None:
    """Size of an unpacked chunk, from its header or by unpacking no more than expected."""
    if compressor is None:
        return len(content)
    if compressor in ("gzip", "zlib"):
        stream = zlib.decompressobj(zlib.MAX_WBITS | 32)  # both headers
        size = len(stream.decompress(content, expected + 1))
        return size if stream.eof and not stream.unused_data else None
    if compressor == "lz4":
        return int(unpack_from("<I", content)[0])
    if compressor == "blosc":
        size, _, stored = unpack_from("<III", content, 4)
        return int(size) if stored == len(content) else None
    return _zstd_bytes(content)


def _zstd_bytes(content: bytes) -> int | None:
    """Size in the header of a zstd frame (RFC 8878, section 3.1.1.1), None if it has none."""
    magic, flags = unpack_from("<IB", content)
    if magic != _ZSTD:
        return None
    single = bool(flags & 0x20)
    at = 5 + (not single) + (0, 1, 2, 4)[flags & 3]
    width = (1 if single else 0, 2, 4, 8)[flags >> 6]
    if width == 0 or len(content) < at + width:
        return None
    return int.from_bytes(content[at : at + width], "little") + (256 if width == 2 else 0)
