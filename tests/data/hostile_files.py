"""Damaged and hostile flow files (gate F-1).

Every file starts as a valid flow. References to other files all lead to a FIFO beside it. A
reader that opens the FIFO hangs, and the test fails.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

from granpinn.data import write_flow
from tests.flows import make_flow

from .hostile_edits import EDITS, OUTSIDE


def _damaged_heap(path: Path) -> None:
    """A variable-length string whose heap is overwritten: h5py can hang in reading it."""
    with h5py.File(path, "r+") as file:
        file.attrs["format_name"] = "granpinn-flow"
    content = bytearray(path.read_bytes())
    start = content.rindex(b"GCOL")
    content[start + 16 : start + 64] = b"\xff" * 48
    path.write_bytes(content)


def _damaged_chunk(path: Path) -> None:
    with h5py.File(path) as file:
        chunk = file["u"].id.get_chunk_info(0)
    content = bytearray(path.read_bytes())
    middle = chunk.byte_offset + chunk.size // 2
    content[middle : middle + 8] = b"\xff" * 8
    path.write_bytes(content)


def _short_chunk(path: Path) -> None:
    """A chunk that unpacks to less than it declares."""
    with h5py.File(path, "r+") as file:
        file["u"].id.write_direct_chunk((0, 0, 0), zlib.compress(b"abc"))


def _long_attribute(path: Path) -> None:
    """More than the 64 KiB that HDF5 allows unless told otherwise."""
    with h5py.File(path, "w", libver="latest") as file:
        file.attrs.create("format_name", np.bytes_(b"m" * 10**6))


def _keep(path: Path, part: float) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: int(len(content) * part)])


def _overwrite(path: Path, start: int, length: int) -> None:
    content = bytearray(path.read_bytes())
    content[start : start + length] = b"\xff" * length
    path.write_bytes(content)


def _instead(path: Path, make: Callable[[Path], object]) -> None:
    path.unlink()
    make(path)


# What is done to the file as a whole.
DAMAGES: dict[str, tuple[Callable[[Path], object], str]] = {
    "missing": (Path.unlink, "there is no such file"),
    "empty": (lambda p: p.write_bytes(b""), "the file is empty"),
    "text": (lambda p: p.write_text("t,x,y,u,v\n0,0,0,1,2\n" * 99), "no HDF5 file"),
    "zip": (lambda p: p.write_bytes(b"PK\x03\x04" + bytes(4096)), "no HDF5 file"),
    "signature only": (lambda p: p.write_bytes(b"\x89HDF\r\n\x1a\n"), "damaged or was cut off"),
    "empty HDF5": (lambda p: h5py.File(p, "w").close(), "format_name must be"),
    "directory": (lambda p: _instead(p, Path.mkdir), "this is a directory"),
    "FIFO": (lambda p: _instead(p, os.mkfifo), "no regular file"),
    "device": (lambda p: _instead(p, lambda q: q.symlink_to("/dev/zero")), "no regular file"),
    "link to itself": (lambda p: _instead(p, lambda q: q.symlink_to(q)), "cannot be opened"),
    "cut in half": (lambda p: _keep(p, 0.5), "damaged or was cut off"),
    "cut at the end": (lambda p: _keep(p, 0.999), "damaged or was cut off"),
    "cut after the start": (lambda p: _keep(p, 0.01), "damaged or was cut off"),
    "overwritten superblock": (lambda p: _overwrite(p, 8, 88), "damaged or was cut off"),
    "overwritten root": (lambda p: _overwrite(p, 96, 600), "damaged or was cut off"),
    "sparse and huge": (lambda p: os.truncate(p, 2**40), "at most 128 GiB"),
    "damaged heap": (_damaged_heap, "cannot be read by"),
    "long attribute": (_long_attribute, "format_name must be one text, got 1000000 bytes"),
    "damaged chunk": (_damaged_chunk, "u "),
    "short chunk": (_short_chunk, "u must have chunks of"),
}


def make_hostile_files(folder: Path) -> dict[Path, str]:
    """Makes all files, each in a folder with the FIFO: path and expected part of the message."""
    files: dict[Path, str] = {}
    valid = folder / "valid.h5"
    write_flow(make_flow(), valid)
    content = valid.read_bytes()
    for name, (change, message) in {**EDITS, **DAMAGES}.items():
        path = folder / name.replace(" ", "_") / "flow.h5"
        path.parent.mkdir()
        path.write_bytes(content)
        os.mkfifo(path.parent / OUTSIDE)
        if name in EDITS:
            with h5py.File(path, "r+") as file:
                change(file)
        else:
            change(path)
        files[path] = message
    return files
