"""Safetensors files that hold a record beside their tensors: checkpoints and networks.

The record is JSON in the header of the file, which is decoded into a typed class. The files hold no
pickle, so reading them executes no code.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, TypeVar

from safetensors import SafetensorError
from safetensors import torch as safetensors
from torch import Tensor

from granpinn.results.decoding import decoded, parsed

LENGTH = 8  # bytes at the start of a safetensors file: the length of its JSON header
T = TypeVar("T")


def packed(name: str, version: int, record: Any, tensors: Mapping[str, Tensor]) -> bytes:
    """The content of a file of a format; infinite numbers must be in the tensors."""
    head = {"format_name": name, "format_version": version}
    text = json.dumps(head | asdict(record), allow_nan=False)
    plain = {key: tensor.cpu().contiguous() for key, tensor in tensors.items()}
    return safetensors.save(plain, {"granpinn": text})


def unpacked(content: bytes, name: str, version: int, kind: type[T]) -> tuple[T, dict[str, Tensor]]:
    """The record and the tensors; ValueError for the content of another file."""
    try:
        tensors = safetensors.load(content)
        header = content[LENGTH : LENGTH + int.from_bytes(content[:LENGTH], "little")]
        named = dict(parsed(parsed(header)["__metadata__"]["granpinn"]))
    except (SafetensorError, LookupError, TypeError) as error:
        raise ValueError(str(error)) from None
    found = named.pop("format_name", None), named.pop("format_version", None)
    if found != (name, version):
        raise ValueError(f"expected {name} version {version}, got {found[0]} version {found[1]}")
    return decoded(named, kind), tensors
