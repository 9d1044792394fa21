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

from granpinn.arrays import Int8, plain_array
from granpinn.importers.columns import Column, chosen, in_one_unit
from granpinn.importers.gaps import GAPS, split_gaps
from granpinn.importers.netcdf4 import read_variables
from granpinn.importers.vectors import DataFileError, Validity, VectorFields, vector_fields
from granpinn.importers.zarr_folder import open_store
from granpinn.regular import UnsafeFileError, first_bytes, read_regular_file

MAX_BYTES = 2**32
INTERPOLATED_FROM = 5
_UNITLESS = ("chc", "p")  # a code, and a pressure that is kept for scoring only
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
    return xarray.Dataset(variables, attrs=facts)


def from_dataset(data: Any, path: str = "the data set") -> VectorFields:
    """Vector fields of an xarray.Dataset."""
    data = _decoded(data)
    missing = [name for name in ("x", "y", "u", "v") if name not in data.variables]
    if missing:
        raise DataFileError(
            f"{path} must have the variables x, y, u, v, got no {', '.join(missing)}: rename them"
        )
    if sum(data[name].size for name in VARIABLES if name in data.variables) * _ITEM > MAX_BYTES:
        raise DataFileError(f"{path} must hold at most 4 GiB: choose fewer frames")
    if "t" not in data.dims:
        data = data.expand_dims("t")
    columns = {}
    for name in VARIABLES:
        dims = (name,) if name in "xyt" else ("t", "y", "x")
        if name in data.variables:
            variable = data[name].variable
            if set(variable.dims) != set(dims):
                raise DataFileError(
                    f"{path}: {name} must have the dimensions {', '.join(dims)}, got "
                    f"{', '.join(map(str, variable.dims))}: reduce or rename them"
                )
            values = variable.transpose(*dims).data
            columns[name] = plain_array(values, f"{path}: {name}", DataFileError).astype(np.float64)
    named = [Column(name, _unit(data, name)) for name in columns]
    _, stated = chosen(path, named, {name: (name,) for name in columns if name not in _UNITLESS})
    columns, units, differing = in_one_unit(path, columns, stated)
    chc = columns.pop("chc", None)
    if "t" not in columns:
        columns["t"] = np.arange(data.sizes["t"], dtype=np.float64)
        units["time_unit"] = "frame"
    elif units["time_unit"] is None and (columns["t"] == np.rint(columns["t"])).all():
        units["time_unit"] = "frame"
    return vector_fields(
        **columns,
        **units,
        validity=_codes(chc, np.isfinite(columns["u"] + columns["v"]), "c" in columns),
        facts={"delta_t": str(data.attrs.get("delta_t", ""))}
        | ({} if "c" in columns else {"mask": GAPS})
        | differing,
    )


def _decoded(data: Any) -> Any:
    """The data set with the numbers that its attributes mean, such as scale_factor."""
    import xarray

    try:
        return xarray.decode_cf(data, decode_times=False)
    except (ValueError, TypeError) as error:
        raise DataFileError(f"the attributes of the data set contradict it: {error}") from None


def _unit(data: Any, name: str) -> str:
    # pivpy writes "dt" for the time between the images of a pair.
    return str(data[name].attrs.get("units", "")).replace("dt", "frame")


def _codes(chc: Any, finite: Any, fraction: bool) -> Int8:
    """Validity of the vectors; their gaps show the mask where no `fraction` of grains does."""
    there = finite if chc is None else finite & (chc > 0)
    inside = np.where(there, np.int8(Validity.VALID), np.int8(Validity.INVALID))
    codes = inside if fraction else split_gaps(there)
    if chc is None:
        return codes
    codes[chc < 0] = Validity.INVALID
    codes[(chc >= INTERPOLATED_FROM) & finite] = Validity.INTERPOLATED
    return codes
