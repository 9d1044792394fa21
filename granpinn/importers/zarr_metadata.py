"""Metadata of a zarr array, of version 2 or 3: parsed strictly, checked, and written anew.

The metadata of a zarr folder names the codecs that unpack its chunks, and some codecs run foreign
code (pickle). So every document is read as strict JSON, codecs are allowed by name, and zarr gets a
new document that holds nothing but what was checked here.
"""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from granpinn.regular import UnsafeFileError

MAX_BYTES = 2**20
MAX_TEXT = 1000
MAX_AXES = 8
COMPRESSORS = ("blosc", "gzip", "zlib", "zstd", "lz4")
_ENDIAN = {"little": "<", "big": ">"}
_NUMPY_TYPES = re.compile(r"[<>|][fiub][1248]")
_TYPES = re.compile(r"bool|u?int(8|16|32|64)|float(16|32|64)")
# Attributes that change the meaning of the numbers; the unit; the dimensions (version 2).
ATTRIBUTES = (
    *("_FillValue", "missing_value", "scale_factor", "add_offset", "_Unsigned", "dtype"),
    *("units", "_ARRAY_DIMENSIONS", "delta_t"),
)


def parse(content: bytes) -> dict[str, Any]:
    """A JSON object: UTF-8, no key twice; NaN and Infinity are allowed, as zarr writes them."""
    if len(content) > MAX_BYTES:
        raise UnsafeFileError(
            f"metadata must be at most 1 MiB, got {len(content)} bytes: shorten it"
        )
    try:
        found = json.loads(content.decode("utf-8"), object_pairs_hook=_without_repeats)
    except (ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())[:100]
        raise UnsafeFileError(
            f"metadata must be strict JSON in UTF-8, got other content ({reason}): write it again"
        ) from None
    if not isinstance(found, dict):
        raise UnsafeFileError("metadata must be a JSON object, got something else: write it again")
    return found


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a key stands there twice")
    return found


@dataclass(frozen=True)
class Array:
    """A checked array.

    Attributes:
        shape, chunk: of the array and of one chunk.
        chunk_bytes: size of an unpacked chunk.
        compressor: name, None if chunks are stored as they are.
        checksum: whether a chunk ends in a CRC-32C of 4 bytes.
        prefix, separator: of the keys of chunks, such as "c/" and "/".
        documents: metadata by key, for zarr.
    """

    shape: tuple[int, ...]
    chunk: tuple[int, ...]
    chunk_bytes: int
    compressor: str | None
    checksum: bool
    prefix: str
    separator: str
    documents: dict[str, bytes]

    @property
    def counts(self) -> tuple[int, ...]:
        """Chunks along every axis."""
        return tuple(-(-n // k) for n, k in zip(self.shape, self.chunk, strict=True))

    def key(self, index: tuple[int, ...]) -> str:
        """The key of a chunk, below the array."""
        if not index:
            return self.prefix.rstrip("/.") or "0"
        return self.prefix + self.separator.join(map(str, index))


def version_2(array: dict[str, Any], attributes: dict[str, Any]) -> Array:
    """An array from its .zarray and .zattrs."""
    _require(array.get("zarr_format") == 2, "zarr_format must be 2")
    shape, chunk = _sizes(array.get("shape"), 0), _sizes(array.get("chunks"), 1)
    _require(len(shape) == len(chunk), "chunks must have as many axes as the array")
    kind = array.get("dtype")
    if not isinstance(kind, str) or not _NUMPY_TYPES.fullmatch(kind):
        raise UnsafeFileError(
            f"dtype must be a number type such as '<f8', got {str(kind)[:40]!r}: objects could run "
            "foreign code; write it again with plain numbers"
        )
    _require(array.get("order", "C") in ("C", "F"), "order must be C or F")
    separator = array.get("dimension_separator", ".")
    _require(separator in (".", "/"), "dimension_separator must be . or /")
    filters = array.get("filters") or []
    _require(isinstance(filters, list), "filters must be a list")
    for codec in filters:
        _codec(codec, "id", ("shuffle",))
    packed = array.get("compressor")
    name = None if packed is None else _codec(packed, "id", COMPRESSORS)
    document = {
        **{"zarr_format": 2, "shape": shape, "chunks": chunk, "dtype": kind},
        **{"compressor": packed, "filters": filters or None, "order": array.get("order", "C")},
        **{"fill_value": _scalar(array.get("fill_value")), "dimension_separator": separator},
    }
    return Array(
        *(shape, chunk, np.dtype(kind).itemsize * math.prod(chunk), name, False, "", separator),
        {".zarray": dump(document), ".zattrs": dump(checked_attributes(attributes))},
    )


def version_3(array: dict[str, Any]) -> Array:
    """An array from its zarr.json."""
    _require(array.get("zarr_format") == 3 and array.get("node_type") == "array", "no array")
    _require(not array.get("storage_transformers"), "storage_transformers must be empty")
    shape = _sizes(array.get("shape"), 0)
    grid, form = _part(array, "chunk_grid"), _part(array, "chunk_key_encoding")
    _require(grid["name"] == "regular", "chunk_grid must be regular")
    chunk = _sizes(grid["configuration"].get("chunk_shape"), 1)
    _require(len(shape) == len(chunk), "chunk_shape must have as many axes as the array")
    _require(form["name"] in ("default", "v2"), "chunk_key_encoding must be default or v2")
    default = "/" if form["name"] == "default" else "."
    separator = form["configuration"].get("separator", default)
    _require(separator in (".", "/"), "the separator of chunk keys must be . or /")
    kind = array.get("data_type")
    if not isinstance(kind, str) or not _TYPES.fullmatch(kind):
        raise UnsafeFileError(
            f"data_type must be a number type such as float64, got {str(kind)[:40]!r}: write it "
            "again with plain numbers"
        )
    codecs = array.get("codecs")
    _require(isinstance(codecs, list) and 1 <= len(codecs) <= 3, "codecs must be 1 to 3 codecs")
    names = [_codec(codec, "name", ("bytes", "crc32c", *COMPRESSORS)) for codec in codecs or []]
    packed = [name for name in names if name in COMPRESSORS]
    order = ["bytes", *packed, *(["crc32c"] if "crc32c" in names else [])]
    _require(names == order and len(packed) < 2, "codecs must be bytes, a compressor and crc32c")
    dims = array.get("dimension_names")
    document = {
        **{"zarr_format": 3, "node_type": "array", "shape": shape, "data_type": kind},
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": chunk}},
        "chunk_key_encoding": {"name": form["name"], "configuration": {"separator": separator}},
        **{"fill_value": _scalar(array.get("fill_value")), "codecs": codecs},
        "attributes": checked_attributes(array.get("attributes") or {}),
        "dimension_names": None if dims is None else _scalar(dims),
    }
    size = 1 if kind == "bool" else np.dtype(kind).itemsize
    return Array(
        *(shape, chunk, size * math.prod(chunk), packed[0] if packed else None, "crc32c" in names),
        *("c" + separator if form["name"] == "default" else "", separator),
        {"zarr.json": dump(document)},
    )


def checked_attributes(attributes: Any) -> dict[str, Any]:
    """Those attributes that are used."""
    _require(isinstance(attributes, dict), "attributes must be a JSON object")
    return {name: _scalar(attributes[name]) for name in ATTRIBUTES if name in attributes}


def dump(document: dict[str, Any]) -> bytes:
    """A document as zarr reads it."""
    return json.dumps(document).encode()


def _require(holds: bool, rule: str) -> None:
    if not holds:
        raise UnsafeFileError(f"{rule}, got something else: write it again with xarray")


def _sizes(value: Any, least: int) -> tuple[int, ...]:
    whole = isinstance(value, list) and all(type(n) is int and least <= n < 2**63 for n in value)
    _require(whole and len(value) <= MAX_AXES, f"sizes must be integers of at least {least}")
    return tuple(value)


def _part(array: dict[str, Any], name: str) -> dict[str, Any]:
    """A named part with its configuration."""
    part = array.get(name)
    _require(isinstance(part, dict) and isinstance(part.get("name"), str), f"{name} needs a name")
    configuration = (part or {}).get("configuration") or {}
    _require(isinstance(configuration, dict), f"{name} needs a configuration")
    return {"name": (part or {})["name"], "configuration": configuration}


def _codec(codec: Any, key: str, allowed: tuple[str, ...]) -> str:
    """The name of a codec that is allowed, whose settings are plain values."""
    name = codec.get(key) if isinstance(codec, dict) else None
    if name not in allowed:
        raise UnsafeFileError(
            f"codecs must be among {', '.join(allowed)}, got {str(name)[:40]!r}: another codec can "
            "run foreign code; write it again with one of these"
        )
    for value in (codec, codec.get("configuration") or {}):
        _require(isinstance(value, dict), "the configuration of a codec must be an object")
        for setting, content in value.items():
            if setting != "configuration":
                _scalar(content)
    return str(name)


def _scalar(value: Any) -> Any:
    """A plain value or a short list of them."""
    parts = value if isinstance(value, list) else [value]
    plain = all(part is None or isinstance(part, str | int | float | bool) for part in parts)
    short = len(parts) <= MAX_AXES and all(len(str(part)) <= MAX_TEXT for part in parts)
    _require(plain and short, "a setting must be a number or a short text")
    return value
