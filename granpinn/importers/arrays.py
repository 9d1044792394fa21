"""Plain NumPy arrays: an .npz file, or a mapping in Python.

t, y, x and u, v [T, Y, X]; or t, x, y, u, v [n] for scattered vectors; NaN for no vector.
Optional: validity (see `Validity`) or mask (true = masked out), sigma_u, sigma_v, c, p; and as text
length_unit, time_unit, velocity_unit; and y_down.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.arrays import plain_array
from granpinn.importers.gaps import GAPS, split_gaps
from granpinn.importers.limits import read_file, require_room
from granpinn.importers.vectors import DataFileError, Validity, VectorFields, vector_fields

REQUIRED = ("t", "y", "x", "u", "v")
OPTIONAL = ("sigma_u", "sigma_v", "c", "p")
ARRAYS = (*REQUIRED, *OPTIONAL, "validity", "mask", "y_down")
TEXTS = ("length_unit", "time_unit", "velocity_unit")


def sniff(path: Path, head: bytes) -> bool:
    """A zip archive named .npz."""
    return head.startswith(b"PK") and path.suffix.lower() == ".npz"


def read(path: Path) -> VectorFields:
    """All frames of an .npz file."""
    return from_arrays(read_file("npz", path), str(path))


def from_arrays(arrays: Mapping[str, Any], path: str = "the arrays") -> VectorFields:
    """Vector fields of a mapping of arrays."""
    missing = [name for name in REQUIRED if name not in arrays]
    if missing:
        raise DataFileError(
            f"{path} must hold {', '.join(REQUIRED)}, got no {', '.join(missing)}: add them"
        )
    known = {*ARRAYS, *TEXTS}
    unknown = sorted(set(arrays) - known)
    if unknown:
        raise DataFileError(
            f"{path} has the unknown array {unknown[0]}: expected {', '.join(sorted(known))}"
        )
    found = {n: _numbers(arrays, n, path) for n in (*REQUIRED, *OPTIONAL) if n in arrays}
    require_room(sum(a.size for a in found.values()), 8, path)
    values = {name: a.astype(np.float64, copy=False) for name, a in found.items()}
    u, v = values["u"], values["v"]
    if u.shape != v.shape or u.ndim not in (1, 3):
        raise DataFileError(
            f"{path}: u and v must be [T, Y, X], or [n] for scattered vectors, got "
            f"{list(u.shape)} and {list(v.shape)}"
        )
    return vector_fields(
        **values,
        validity=_codes(arrays, np.isfinite(u) & np.isfinite(v), path),
        **{name: str(_one(arrays[name], name, path)) for name in TEXTS if name in arrays},
        y_down=bool(_one(_numbers(arrays, "y_down", path, "fiub"), "y_down", path))
        if "y_down" in arrays
        else None,
        facts={} if {"validity", "mask", "c"} & arrays.keys() else {"mask": GAPS},
    )


def _numbers(arrays: Mapping[str, Any], name: str, path: str, kinds: str = "fiu") -> Any:
    return plain_array(arrays[name], f"{path}: {name}", DataFileError, kinds=kinds)


def _one(given: Any, name: str, path: str) -> Any:
    """The single value of an array or a plain value."""
    found = np.asarray(given)
    if found.size != 1:
        raise DataFileError(f"{path}: {name} must be one value, got {found.size}: correct it")
    return found.flat[0]


def _codes(arrays: Mapping[str, Any], finite: Any, path: str) -> Any:
    codes = np.where(finite, Validity.VALID, Validity.INVALID)
    if "validity" in arrays:
        codes = _numbers(arrays, "validity", path)
        if not np.isin(codes, list(Validity)).all():
            raise DataFileError(f"{path}: validity must be 0, 1, 2 or 3, got another number")
    if "mask" in arrays:
        masked = _numbers(arrays, "mask", path, "fiub").astype(bool)  # NaN, no value, is masked
        if not masked.shape == codes.shape == finite.shape:
            raise DataFileError(
                f"{path}: mask must have the shape {list(finite.shape)} of u, got "
                f"{list(masked.shape)}"
            )
        return np.where(masked, Validity.MASKED, codes)
    known = {"validity", "c"} & arrays.keys() or finite.ndim == 1
    return codes if known else split_gaps(finite)
