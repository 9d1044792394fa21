"""netCDF and zarr in the schema of pivpy: dimensions y, x, t; variables u, v, chc.

chc: 1 to 4 measured (number of the correlation peak), 5 and above interpolated, 0 nothing, below 0
rejected; some writers put 0 into u and v there. Attributes: `units` of every variable, `delta_t`.
This package adds c (volume fraction), p, sigma_u, sigma_v. Needs xarray.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.arrays import Int8
from granpinn.importers.gaps import GAPS, split_gaps
from granpinn.importers.netcdf4 import read_variables
from granpinn.importers.vectors import DataFileError, Validity, VectorFields, vector_fields
from granpinn.importers.zarr_folder import open_store
from granpinn.regular import UnsafeFileError, first_bytes, read_regular_file

MAX_BYTES = 2**32
INTERPOLATED_FROM = 5
_EXTRAS = ("sigma_u", "sigma_v", "c", "p")
VARIABLES = ("x", "y", "t", "u", "v", "chc", *_EXTRAS)
FACTS = ("delta_t",)
_ITEM = 8  # bytes of a number as float64


def sniff(path: Path, head: bytes) -> bool:
    """netCDF-3, a HDF5 file named .nc or .netcdf, or a zarr folder."""
    if path.is_dir():
        return any((path / name).exists() for name in (".zgroup", ".zmetadata", "zarr.json"))
    hdf5 = head.startswith(b"\x89HDF") and path.suffix.lower() in (".nc", ".nc4", ".netcdf", ".cdf")
    return hdf5 or head.startswith(b"CDF")


def read(path: Path) -> VectorFields:
    """All frames of a data set."""
    try:
        import xarray
    except ImportError:
        raise DataFileError(
            f"{path} is netCDF or zarr, which needs xarray: pip install 'granpinn[netcdf]'"
        ) from None
    try:
        with _open(xarray, path) as data:
            return from_dataset(data, str(path))
    except DataFileError:
        raise
    except UnsafeFileError as error:
        raise DataFileError(f"{path} cannot be read by xarray: {error}") from None
    except (
        *(OSError, ValueError, TypeError, LookupError, RuntimeError, ImportError),
        *(ArithmeticError, AssertionError, AttributeError),
    ) as error:
        reason = " ".join(str(error).split())[:160]
        raise DataFileError(f"{path} cannot be read by xarray ({reason}): check it") from None


def _open(xarray: Any, path: Path) -> Any:
    """The variables that this module reads, as an xarray.Dataset; nothing but `path` is opened."""
    if path.is_dir():
        store = open_store(path, VARIABLES, MAX_BYTES)
        return xarray.open_zarr(store, decode_times=False, chunks=None, consolidated=False)
    if first_bytes(path, 3) == b"CDF":
        content = io.BytesIO(read_regular_file(path, MAX_BYTES))
        return xarray.open_dataset(content, engine="scipy", decode_times=False)
    found, facts = read_variables(path, VARIABLES, FACTS, MAX_BYTES)
    variables = {name: xarray.Variable(*parts) for name, parts in found.items()}
    return xarray.decode_cf(xarray.Dataset(variables, attrs=facts), decode_times=False)


def from_dataset(data: Any, path: str = "the data set") -> VectorFields:
    """Vector fields of an xarray.Dataset."""
    missing = [name for name in ("x", "y", "u", "v") if name not in data.variables]
    if missing:
        raise DataFileError(
            f"{path} must have the variables x, y, u, v, got no {', '.join(missing)}: rename them"
        )
    if sum(data[name].size for name in VARIABLES if name in data.variables) * _ITEM > MAX_BYTES:
        raise DataFileError(f"{path} must hold at most 4 GiB: choose fewer frames")
    if "t" not in data.dims:
        data = data.expand_dims("t")
    fields = {}
    for name in ("u", "v", "chc", *_EXTRAS):
        if name in data.variables:
            variable = data[name]
            if set(variable.dims) != {"t", "y", "x"}:
                raise DataFileError(
                    f"{path}: {name} must have the dimensions t, y, x, got "
                    f"{', '.join(map(str, variable.dims))}: reduce or rename them"
                )
            fields[name] = np.asarray(variable.transpose("t", "y", "x").values, np.float64)
    timed = "t" in data.variables
    unit = {name: _unit(data, name) for name in ("x", "u", "t")}
    finite = np.isfinite(fields["u"] + fields["v"])
    y = np.asarray(data["y"].values, np.float64)
    return vector_fields(
        t=data["t"].values if timed else np.arange(data.sizes["t"]),
        y=y,
        x=data["x"].values,
        u=fields["u"],
        v=fields["v"],
        validity=_codes(fields.get("chc"), finite),
        **{name: fields[name] for name in _EXTRAS if name in fields},
        length_unit=unit["x"],
        time_unit=unit["t"] if timed and unit["t"] else "frame",
        velocity_unit=unit["u"],
        y_down=None,
        facts={"delta_t": str(data.attrs.get("delta_t", "")), "mask": GAPS},
    )


def _unit(data: Any, name: str) -> str | None:
    text = data[name].attrs.get("units") if name in data.variables else None
    # pivpy writes "dt" for the time between the images of a pair.
    return None if text is None else str(text).replace("dt", "frame")


def _codes(chc: Any, finite: Any) -> Int8:
    if chc is None:
        return split_gaps(finite)
    codes = split_gaps(finite & (chc > 0))
    codes[chc < 0] = Validity.INVALID
    codes[(chc >= INTERPOLATED_FROM) & finite] = Validity.INTERPOLATED
    return codes
