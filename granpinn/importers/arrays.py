"""Plain NumPy arrays: an .npz file, or a mapping in Python.

t, y, x and u, v [T, Y, X]; or t, x, y, u, v [n] for scattered vectors; NaN for no vector.
Optional: validity (see `Validity`) or mask (true = masked out), sigma_u, sigma_v, c, p; and as text
length_unit, time_unit, velocity_unit; and y_down.
"""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.importers.gaps import GAPS, split_gaps
from granpinn.importers.vectors import DataFileError, Validity, VectorFields, vector_fields

MAX_BYTES = 2**32
REQUIRED = ("t", "y", "x", "u", "v")
OPTIONAL = ("sigma_u", "sigma_v", "c", "p")
# Exceptions of zipfile and NumPy for damaged files.
_DAMAGED = (
    OSError,
    ValueError,
    KeyError,
    EOFError,
    RuntimeError,
    MemoryError,
    SyntaxError,
    zipfile.BadZipFile,
    zlib.error,
)
TEXTS = ("length_unit", "time_unit", "velocity_unit")


def sniff(path: Path, head: bytes) -> bool:
    """A zip archive named .npz."""
    return head.startswith(b"PK") and path.suffix.lower() == ".npz"


def read(path: Path) -> VectorFields:
    """All frames of an .npz file."""
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(info.file_size for info in archive.infolist()) > MAX_BYTES:
                raise DataFileError(f"{path} must unpack to at most 4 GiB: choose fewer frames")
        with np.load(path) as file:  # without pickled objects, which is the default
            return from_arrays({name: file[name] for name in file.files}, str(path))
    except _DAMAGED as error:
        if isinstance(error, DataFileError):
            raise
        reason = " ".join(str(error).split())[:160]
        raise DataFileError(
            f"{path} cannot be read as .npz ({reason}): write plain arrays with numpy.savez"
        ) from None


def from_arrays(arrays: Mapping[str, Any], path: str = "the arrays") -> VectorFields:
    """Vector fields of a mapping of arrays."""
    missing = [name for name in REQUIRED if name not in arrays]
    if missing:
        raise DataFileError(
            f"{path} must hold {', '.join(REQUIRED)}, got no {', '.join(missing)}: add them"
        )
    known = {*REQUIRED, *OPTIONAL, *TEXTS, "validity", "mask", "y_down"}
    unknown = sorted(set(arrays) - known)
    if unknown:
        raise DataFileError(
            f"{path} has the unknown array {unknown[0]}: expected {', '.join(sorted(known))}"
        )
    try:
        values = {
            n: np.asarray(arrays[n], np.float64) for n in (*REQUIRED, *OPTIONAL) if n in arrays
        }
    except (TypeError, ValueError):
        raise DataFileError(f"{path} must hold numbers, got something else") from None
    u, v = values["u"], values["v"]
    if u.shape != v.shape or u.ndim not in (1, 3):
        raise DataFileError(
            f"{path}: u and v must be [T, Y, X], or [n] for scattered vectors, got "
            f"{list(u.shape)} and {list(v.shape)}"
        )
    return vector_fields(
        **values,
        validity=_codes(arrays, np.isfinite(u + v), path),
        **{name: str(np.asarray(arrays[name])) for name in TEXTS if name in arrays},
        y_down=bool(np.asarray(arrays["y_down"])) if "y_down" in arrays else None,
        facts={} if {"validity", "mask"} & set(arrays) else {"mask": GAPS},
    )


def _codes(arrays: Mapping[str, Any], finite: Any, path: str) -> Any:
    if "validity" in arrays:
        codes = np.asarray(arrays["validity"])
        if not np.isin(codes, list(Validity)).all():
            raise DataFileError(f"{path}: validity must be 0, 1, 2 or 3, got another number")
        return codes
    if "mask" in arrays:
        masked = np.asarray(arrays["mask"], bool)
        inside = np.where(finite, Validity.VALID, Validity.INVALID)
        if masked.shape != finite.shape:
            raise DataFileError(
                f"{path}: mask must have the shape {list(finite.shape)} of u, got "
                f"{list(masked.shape)}"
            )
        return np.where(masked, Validity.MASKED, inside)
    if finite.ndim == 1:
        return np.where(finite, Validity.VALID, Validity.INVALID)
    return split_gaps(finite)
