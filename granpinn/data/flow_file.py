"""Reads and writes a flow file, version 1, which xarray can open as netCDF-4.

Every fault of a file is a FlowFileError. `read_hdf5` also reads other HDF5 files of granpinn.
"""

from __future__ import annotations

import hashlib
import mmap
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt

from granpinn.data.flow import Flow, FlowFileError, Particles, Surface, Truth, Units, Walls
from granpinn.data.particles import grid_view
from granpinn.data.rules import check_flow
from granpinn.data.schema import (
    ATTRIBUTES,
    DATASETS,
    FIELDS,
    FORMAT_NAME,
    FORMAT_VERSION,
    MOST_IN_MEMORY,
    OF_FLOW,
    RECORDS,
    TRUTH,
    WRITE_HINT,
    arrays_of,
    attribute,
    attributes_of,
    check_conventions,
    check_layout,
)
from granpinn.declared import checked
from granpinn.foreign import read_foreign
from granpinn.output import hdf5_file
from granpinn.regular import RETRY, UnsafeFileError, open_regular_file

MOST_MAPPED = 2**37  # bytes of a file


@dataclass(frozen=True)
class Dataset:
    """A dataset; `values` is None unless it holds numbers."""

    shape: tuple[int, ...]
    dtype: str
    attributes: dict[str, Any]
    values: npt.NDArray[Any] | None


@dataclass(frozen=True)
class Hdf5File:
    """What is read of a file; `datasets` holds those that exist."""

    attributes: dict[str, Any]
    datasets: dict[str, Dataset]
    sha256: str


def read_hdf5(path: Path, names: list[str], max_bytes: int, remedy: str) -> Hdf5File:
    """Reads some datasets of a regular file, and the attributes of its root.

    Args:
        max_bytes: of all arrays in memory. In a larger file those that are stored without chunks
            stay in the file, read-only; it must not change while they are used.
        remedy: for a file with more data.

    Raises:
        UnsafeFileError: the file breaks a rule of the container.
    """
    with open_regular_file(path, MOST_MAPPED) as stream:
        n_bytes = os.fstat(stream.fileno()).st_size
        in_place = n_bytes > max_bytes
        image = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) if in_place else None
        request: dict[str, Any] = {"names": names, "remedy": remedy, "in_place": in_place}
        found = read_foreign("hdf5", path, n_bytes, max_bytes=max_bytes, **request)
        sha256 = hashlib.file_digest(stream, "sha256").hexdigest()  # type: ignore[arg-type]
    datasets = {}
    for name, part in found["datasets"].items():
        values, shape = part.get("values"), tuple(part["shape"])
        if "place" in part:
            values = _mapped(image, part["dtype"], shape, part["place"])
        datasets[name] = Dataset(shape, part["dtype"], part["attributes"], values)
    return Hdf5File(found["attributes"], datasets, sha256)


def _mapped(image: Any, dtype: str, shape: tuple[int, ...], place: int | None) -> Any:
    """Numbers that lie in a mapped file."""
    count = int(np.prod(shape))
    if place is None or place + count * np.dtype(dtype).itemsize > len(image):
        raise UnsafeFileError(f"the file was cut off, expected a whole HDF5 file: {RETRY}")
    return np.frombuffer(image, dtype, count, place).reshape(shape)


DEFAULT_MAX_BYTES = MOST_IN_MEMORY
MOVING_WALLS = "wall_t"  # times of pieces in files of older versions
_RAISE = (
    "if it can be trusted, raise max_bytes of read_flow, or write the file without chunks and "
    "filters, which needs no memory"
)


def is_flow_file(path: Path) -> bool:
    """Whether a file is a flow file, from its attribute."""
    try:
        file = read_hdf5(path, [], DEFAULT_MAX_BYTES, _RAISE)
        return bool(attribute(file.attributes, "format_name", str) == FORMAT_NAME)
    except UnsafeFileError:  # no HDF5, or another kind of it
        return False


@checked
def read_flow(path: str | os.PathLike[str], *, max_bytes: int = DEFAULT_MAX_BYTES) -> Flow:
    """Reads and checks a flow file.

    Args:
        path: the file; nothing else is opened.
        max_bytes: most bytes that are read into memory. A larger file is mapped: its arrays that
            are stored without chunks and in the type of the flow stay in the file, read-only. The
            file must not change while the flow is used.

    Raises:
        FlowFileError: the file breaks a rule; the message is one sentence.
    """
    try:
        flow = _read(Path(path), max_bytes)
        check_flow(flow)
    except (FlowFileError, UnsafeFileError) as error:
        raise FlowFileError(f"{path}: {error}") from None
    return flow


def _read(path: Path, max_bytes: int) -> Flow:
    file = read_hdf5(path, [*DATASETS, MOVING_WALLS], max_bytes, _RAISE)
    _check_version(file)
    if MOVING_WALLS in file.datasets:
        raise FlowFileError(
            f"{MOVING_WALLS} must not be there, as walls stay in their place: leave out the pieces "
            "that move, and the frames before a gate has left"
        )
    stated = {n: attribute(file.attributes, n, r.kind, r.required) for n, r in ATTRIBUTES.items()}
    stated = {name: value for name, value in stated.items() if value is not None}
    units = Units(stated["length_unit"], stated["time_unit"], stated.get("density_unit"))
    parts = _arrays(file, units)
    flow, particles = parts[Flow], None
    constants = {name: value for name, value in stated.items() if name in FIELDS}
    constants["gravity"] = tuple(map(float, attribute(file.attributes, "gravity", list, True)))
    if twice := flow.keys() & constants.keys():
        raise FlowFileError(
            f"{min(twice)} must be either an attribute or a dataset, got both: remove one"
        )
    if parts[Particles]:
        particles = Particles(**parts[Particles])
        flow |= grid_view(particles)
    return Flow(
        **flow,
        **constants,
        particles=particles,
        surface=Surface(**parts[Surface]) if parts[Surface] else None,
        walls=Walls(**parts[Walls]) if parts[Walls] else None,
        truth=_truth({field: stated[name] for name, field in TRUTH.items() if name in stated}),
        attributes=_others(file) | {n: stated[n] for n in OF_FLOW if n in stated},
        sha256=file.sha256,
        path=path,
    )


def _others(file: Hdf5File) -> dict[str, str | float]:
    """Texts and single numbers without a meaning in the format."""
    # Attributes with odd names are left out, as they would only clutter reports and tables.
    known = {"format_name", "format_version", "gravity", *ATTRIBUTES}
    named = {n: v for n, v in file.attributes.items() if n.isidentifier() and n not in known}
    single = {n: v[0] for n, v in named.items() if isinstance(v, list) and len(v) == 1}
    return {n: v for n, v in named.items() if isinstance(v, str)} | single


def _truth(stated: dict[str, Any]) -> Truth | None:
    """The law that made the data; None if the file states neither the law nor a parameter."""
    try:
        return Truth(**stated) if stated else None
    except ValueError as error:
        raise FlowFileError(f"the true friction law: {error}") from None


def _arrays(file: Hdf5File, units: Units) -> dict[type, dict[str, Any]]:
    """The arrays of every record, after checks of their layout and units."""
    check_layout(file.datasets)
    for name, dataset in file.datasets.items():
        check_conventions(name, dataset.attributes, units.of(DATASETS[name].quantity))
    # A number beyond the range of the type becomes infinite, as in HDF5.
    with np.errstate(over="ignore"):
        return {
            kind: {
                rule.name.removeprefix(prefix): np.asarray(read.values, rule.dtype or read.dtype)
                for rule in rules
                if (read := file.datasets.get(rule.name))
            }
            for kind, (prefix, rules) in RECORDS.items()
        }


def _check_version(file: Hdf5File) -> None:
    name = attribute(file.attributes, "format_name", str)
    if name != FORMAT_NAME:
        found = "nothing" if name is None else repr(name[:40])
        raise FlowFileError(
            f"the attribute format_name must be '{FORMAT_NAME}', got {found}: this is another "
            f"kind of HDF5 file; {WRITE_HINT}"
        )
    version = attribute(file.attributes, "format_version", list)
    if version != [FORMAT_VERSION]:
        found = "nothing" if version is None else ", ".join(f"{value:g}" for value in version[:4])
        raise FlowFileError(
            f"the attribute format_version must be {FORMAT_VERSION}, got {found}: update "
            f"granpinn or {WRITE_HINT}"
        )


FRAMES_PER_CHUNK = 10
ROWS_PER_CHUNK = 100_000
_PACKED = {"compression": "gzip", "shuffle": True}
# Dimension scales: the axis that each coordinate stands for.
_SCALES = {"T": "t", "Y": "y", "X": "x", "N": "particles/t", "n": "surface_t", "m": "wall_x"}


@checked
def write_flow(flow: Flow, path: str | os.PathLike[str]) -> None:
    """Checks a flow and writes it; the file appears only once it is complete.

    A flow of more than 1 GiB is stored without chunks and filters, so that `read_flow` leaves it in
    the file.

    Raises:
        FlowFileError: the flow breaks a rule of the format, or has a source term.
        OutputError: the file cannot be written.
    """
    check_flow(flow)
    if flow.source is not None:
        raise FlowFileError(
            "a flow file has no place for the source term of a flow, got a flow with one: keep it "
            "in memory"
        )
    with hdf5_file(path) as file:
        _write_attributes(file, flow)
        _write_arrays(file, flow)


def _write_attributes(file: h5py.File, flow: Flow) -> None:
    values = {
        **attributes_of(flow),
        "format_name": FORMAT_NAME,
        "format_version": FORMAT_VERSION,
        "gravity": np.asarray(flow.gravity, dtype=np.float64),
    }
    for name, value in sorted(values.items()):  # equal flows make equal files
        if isinstance(value, str):
            _write_text(file, name, value)
        elif value is not None and not (name.startswith("sigma_") and np.ndim(value)):
            file.attrs[name] = int(value) if isinstance(value, bool) else value


def _write_arrays(file: h5py.File, flow: Flow) -> None:
    arrays = arrays_of(flow)
    packed = sum(array.nbytes for array in arrays.values()) <= MOST_IN_MEMORY
    for rule in DATASETS.values():
        if rule.name not in arrays:
            continue
        array = arrays[rule.name]
        options: dict[str, Any] = {}
        if packed and rule.axes == ("N",):
            options = {"chunks": (min(ROWS_PER_CHUNK, array.size),), **_PACKED}
        elif packed and array.ndim == 3:
            chunks = (min(FRAMES_PER_CHUNK, array.shape[0]), *array.shape[1:])
            options = {"chunks": chunks, **_PACKED}
        dataset = file.create_dataset(rule.name, data=array, **options)
        unit = flow.units.of(rule.quantity)
        if unit is not None:
            _write_text(dataset, "units", unit)
    for name in _SCALES.values():
        if name in arrays:
            file[name].make_scale(name.rpartition("/")[2])
    for rule in DATASETS.values():
        if rule.name in arrays and rule.name not in _SCALES.values():
            for axis, axis_name in enumerate(rule.axes):
                file[rule.name].dims[axis].attach_scale(file[_SCALES[axis_name]])


def _write_text(place: h5py.File | h5py.Dataset, name: str, text: str) -> None:
    """Writes a fixed-length string: HDF5 hangs on some damaged variable-length ones."""
    encoded = text.encode()
    kind = h5py.string_dtype("utf-8", max(len(encoded), 1))
    place.attrs.create(name, np.array(encoded, dtype=kind), dtype=kind)
