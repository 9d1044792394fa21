"""Hostile and valid zarr folders, of version 2 and 3."""

from __future__ import annotations

import json
import os
import shutil
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from granpinn.importers import DataFileError, read_vectors
from tests.importers.test_simulation_files import dataset
from tests.opened import watched

xarray = pytest.importorskip("xarray")
zarr = pytest.importorskip("zarr")
numcodecs = pytest.importorskip("numcodecs")

Edit = Callable[[dict[str, Any]], object]


def written(path: Path, version: int, **encoding: Any) -> Path:
    options = dict.fromkeys("uv", encoding) if encoding else {}
    dataset().to_zarr(path, zarr_format=version, consolidated=version == 2, encoding=options)
    return path


def document(path: Path, version: int) -> Path:
    return path / "u" / (".zarray" if version == 2 else "zarr.json")


def change(path: Path, version: int, edit: Edit) -> None:
    content = json.loads(document(path, version).read_text())
    edit(content)
    document(path, version).write_text(json.dumps(content))


def a_chunk(path: Path, version: int) -> Path:
    return path / "u" / ("0.0.0" if version == 2 else "c/0/0/0")


def _codec(content: dict[str, Any], name: str, **settings: Any) -> None:
    if content["zarr_format"] == 2:
        content["filters"] = [{"id": name, **settings}]
    else:
        content["codecs"].append({"name": name, "configuration": settings})


def _sharding(content: dict[str, Any]) -> None:
    inner = {"chunk_shape": [1, 1, 1], "codecs": [{"name": "numcodecs.pickle"}]}
    _codec(content, "sharding_indexed", **inner)


def _two_names(content: dict[str, Any]) -> None:
    used, other = ("id", "name") if content["zarr_format"] == 2 else ("name", "id")
    codec = {used: "numcodecs.pickle", other: "bytes"}
    content["filters" if content["zarr_format"] == 2 else "codecs"] = [codec]


def _group_of_objects(content: dict[str, Any]) -> None:
    """What is a group in one version, and a type that is only read in the other."""
    _retype(content, "|O")
    content |= {"node_type": "group"}
    content["data_type" if content["zarr_format"] == 2 else "dtype"] = "<f8"


def _grow(content: dict[str, Any], n: int) -> None:
    content["shape"] = [n] * 3


def _grow_chunks(content: dict[str, Any], n: int) -> None:
    if content["zarr_format"] == 2:
        content["chunks"] = [n] * 3
    else:
        content["chunk_grid"]["configuration"]["chunk_shape"] = [n] * 3


def _retype(content: dict[str, Any], kind: Any) -> None:
    content["dtype" if content["zarr_format"] == 2 else "data_type"] = kind


LIBRARY = "cannot be read by xarray"
EDITS: dict[str, tuple[Edit, str]] = {
    "pickle": (lambda c: _codec(c, "pickle"), "got 'pickle'"),
    "msgpack": (lambda c: _codec(c, "msgpack2"), "got 'msgpack2'"),
    "json": (lambda c: _codec(c, "json2"), "got 'json2'"),
    "numcodecs.pickle": (lambda c: _codec(c, "numcodecs.pickle"), "got 'numcodecs.pickle'"),
    "text of variable length": (lambda c: _codec(c, "vlen-utf8"), "got 'vlen-utf8'"),
    "codec inside shards": (_sharding, "got 'sharding_indexed'"),
    "codec that is a list": (lambda c: _codec(c, ["pickle"]), "codecs must be among"),  # type: ignore[arg-type]
    "two names of a codec": (_two_names, "got 'numcodecs.pickle'"),
    "group with a type": (_group_of_objects, f"must be a number type|{LIBRARY}"),
    "objects": (lambda c: _retype(c, "|O"), "must be a number type"),
    "record": (lambda c: _retype(c, [["a", "<f8"], ["b", "|O"]]), "must be a number type"),
    "named type": (lambda c: _retype(c, {"name": "numpy.object"}), "must be a number type"),
    "terabytes": (lambda c: _grow(c, 10**5), "must hold at most"),
    "beyond 64 bits": (lambda c: _grow(c, 10**30), "must hold at most"),
    "negative": (lambda c: _grow(c, -1), LIBRARY),
    "no integers": (lambda c: c.update(shape=[1.5, True, "2"]), LIBRARY),
    "no shape": (lambda c: c.pop("shape"), "got no u"),
    "chunks of 0": (lambda c: _grow_chunks(c, 0), LIBRARY),
    "chunks of 8 GB": (lambda c: _grow_chunks(c, 1000), LIBRARY),
    "millions of chunks": (
        lambda c: (_grow(c, 200), _grow_chunks(c, 1)),
        LIBRARY,
    ),
    "other chunks": (lambda c: _grow_chunks(c, 3), LIBRARY),
}


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", EDITS)
def test_metadata(tmp_path: Path, version: int, name: str) -> None:
    edit, message = EDITS[name]
    path = written(tmp_path / "a.zarr", version)
    change(path, version, edit)
    with pytest.raises(DataFileError, match=message) as caught:
        read_vectors(path)
    assert "\n" not in str(caught.value)


def _escaped(text: str) -> bytes:
    return text.replace("pickle", "\\u0070ickle").encode()


DISGUISES: dict[str, tuple[Callable[[str], bytes], str]] = {
    "escape": (_escaped, "got 'pickle'"),
    "UTF-16": (lambda s: s.encode("utf-16"), "got 'pickle'"),
    "UTF-32": (lambda s: s.encode("utf-32-le"), "got 'pickle'"),
    "byte order mark": (lambda s: s.encode("utf-8-sig"), "got 'pickle'"),
    "key twice": (
        lambda s: s.replace("{", '{"filters": null, "codecs": [], ', 1).encode(),
        "got 'pickle'",
    ),
    "nested": (lambda s: b'{"a":' * 100_000, LIBRARY),
    "long": (lambda s: s.encode() + b" " * 2**21, "must hold at most"),
    "long number": (lambda s: s.replace(": 2", ": " + "9" * 5000).encode(), f"{LIBRARY}|codecs"),
    "list": (lambda s: b"[]", LIBRARY),
    "nothing": (lambda s: b"", "the file is empty"),
}


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", DISGUISES)
def test_codecs_in_disguise(tmp_path: Path, version: int, name: str) -> None:
    encode, message = DISGUISES[name]
    path = written(tmp_path / "a.zarr", version)
    change(path, version, lambda c: _codec(c, "pickle"))
    place = document(path, version)
    place.write_bytes(encode(place.read_text()))
    with pytest.raises(DataFileError, match=message):
        read_vectors(path)


def _bomb(n_bytes: int) -> bytes:
    packer = zlib.compressobj(9)
    parts = [packer.compress(bytes(2**20)) for _ in range(n_bytes // 2**20)]
    return b"".join([*parts, packer.flush()])


BAD_CHUNKS: dict[str, tuple[Any, bytes | Callable[[], bytes]]] = {
    "cut blosc": (numcodecs.Blosc(), b"\x02\x01\x21\x08" + b"\xff" * 8 + b"\x10\0\0\0"),
    "large blosc": (numcodecs.Blosc(), b"\x02\x01\x21\x08" + b"\xff" * 8 + b"\x14\0\0\0abcd"),
    "large lz4": (numcodecs.LZ4(), b"\xff\xff\xff\x7f" + bytes(20)),
    "zlib bomb": (numcodecs.Zlib(), lambda: _bomb(2**28)),
    "short zlib": (numcodecs.Zlib(), zlib.compress(b"abc")),
    "large zstd": (numcodecs.Zstd(), b"\x28\xb5\x2f\xfd\xe0" + b"\xff" * 7 + b"\x3f" + bytes(20)),
    "zstd of no size": (numcodecs.Zstd(), b"\x28\xb5\x2f\xfd\x00\x58" + bytes(20)),
    "cut zstd": (numcodecs.Zstd(), b"\x28\xb5"),
    "no compressor": (None, b"abc"),
}


@pytest.mark.parametrize("name", BAD_CHUNKS)
def test_chunks_of_another_size(tmp_path: Path, name: str) -> None:
    codec, content = BAD_CHUNKS[name]
    content = content() if callable(content) else content
    encoding = {"compressors": codec and (codec,), "chunks": (7, 9, 3)}
    path = written(tmp_path / "a.zarr", 2, **encoding)
    a_chunk(path, 2).write_bytes(content)
    with pytest.raises(DataFileError, match=f"{LIBRARY}|its arrays need"):
        read_vectors(path)


def _link_chunk(path: Path, outside: Path) -> None:
    shutil.copy(a_chunk(path, 3), outside)
    a_chunk(path, 3).unlink()
    a_chunk(path, 3).symlink_to(outside)


def _link_metadata(path: Path, outside: Path) -> None:
    shutil.copy(document(path, 3), outside)
    document(path, 3).unlink()
    document(path, 3).symlink_to(outside)


def _link_folder(path: Path, outside: Path) -> None:
    shutil.copytree(path / "u" / "c", outside.parent / "c")
    shutil.rmtree(path / "u" / "c")
    (path / "u" / "c").symlink_to(outside.parent / "c")


def _fifo(path: Path, outside: Path) -> None:
    a_chunk(path, 3).unlink()
    os.mkfifo(a_chunk(path, 3))


@pytest.mark.parametrize(
    ("replace", "message"),
    [
        (_link_chunk, "is a link out of the folder"),
        (_link_metadata, "is a link out of the folder"),
        (_link_folder, "is a link out of the folder"),
        (_fifo, "must be a regular file"),
    ],
)
def test_other_files_are_not_opened(
    tmp_path: Path, replace: Callable[[Path, Path], None], message: str
) -> None:
    path, outside = written(tmp_path / "a.zarr", 3), tmp_path / "outside"
    outside.write_bytes(b"")
    replace(path, outside)
    with watched(outside) as opened:
        with pytest.raises(DataFileError, match=message):
            read_vectors(path)
        assert not opened()
