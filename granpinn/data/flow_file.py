"""Reads and writes a flow file, version 1, which xarray can open as netCDF-4.

Every fault of a file is a FlowFileError. `read_hdf5` also reads other HDF5 files of granpinn.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
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
    GRID,
    MOST_IN_MEMORY,
    OF_FLOW,
    RECORDS,
    TRUTH,
    WRITE_HINT,
    DatasetRule,
    arrays_of,
    attribute,
    attributes_of,
    check_conventions,
    check_format,
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
        request: dict[str, Any] = {"names": names, "remedy": remedy, "in_place": in_place}
        found = read_foreign("hdf5", path, n_bytes, max_bytes=max_bytes, **request)
        sha256 = hashlib.file_digest(stream, "sha256").hexdigest()  # type: ignore[arg-type]
        datasets = {}
        for name, part in found["datasets"].items():
            values, shape, dtype = part.get("values"), tuple(part["shape"]), part["dtype"]
            if "place" in part:
                try:
                    values = np.memmap(stream, dtype, "r", part["place"], shape)
                except (TypeError, ValueError):
                    raise UnsafeFileError(
                        f"{name} was cut off, expected all of it: {RETRY}"
                    ) from None
            datasets[name] = Dataset(shape, dtype, part["attributes"], values)
    return Hdf5File(found["attributes"], datasets, sha256)


MOVING_WALLS = "wall_t"  # times of pieces in files of older versions
_RAISE = (
    "if it can be trusted, raise max_bytes of read_flow, or write the file without chunks and "
    "filters, which needs no memory"
)


def is_flow_file(path: Path) -> bool:
    """Whether a file is a flow file, from its attribute."""
    try:
        file = read_hdf5(path, [], MOST_IN_MEMORY, _RAISE)
        return bool(attribute(file.attributes, "format_name", str) == FORMAT_NAME)
    except UnsafeFileError:  # no HDF5, or another kind of it
        return False


@checked
def read_flow(path: str | os.PathLike[str], *, max_bytes: int = MOST_IN_MEMORY) -> Flow:
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
    remedy = f"{WRITE_HINT}, or update granpinn"
    check_format(file.attributes, FORMAT_NAME, FORMAT_VERSION, remedy)
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
    arrays = arrays_of(flow)
    values = {
        **{name: value for name, value in attributes_of(flow).items() if name not in arrays},
        "format_name": FORMAT_NAME,
        "format_version": FORMAT_VERSION,
        "gravity": np.asarray(flow.gravity, dtype=np.float64),
    }
    packed = sum(array.nbytes for array in arrays.values()) <= MOST_IN_MEMORY
    with hdf5_file(path) as file:
        write_attributes(file, values)
        for name, rule in DATASETS.items():
            if name not in arrays:
                continue
            shape = arrays[name].shape
            options: dict[str, Any] = {}
            if packed and rule.axes == ("N",):
                options = {"chunks": (min(ROWS_PER_CHUNK, *shape),), **_PACKED}
            elif packed and rule.axes == GRID:
                options = {"chunks": (min(FRAMES_PER_CHUNK, shape[0]), *shape[1:]), **_PACKED}
            add_dataset(file, rule, flow.units, data=arrays[name], **options)


def add_dataset(
    file: h5py.File, rule: DatasetRule, units: Units, /, **options: Any
) -> h5py.Dataset:
    """Adds a dataset with its attributes and the scales of its axes, which are added before it."""
    dataset = file.create_dataset(rule.name, **options)
    write_attributes(dataset, rule.described(units))
    if rule.name in _SCALES.values():
        dataset.make_scale(rule.name.rpartition("/")[2])
        return dataset
    for dimension, axis in zip(dataset.dims, rule.axes, strict=True):
        dimension.attach_scale(file[_SCALES[axis]])
    return dataset


def write_attributes(place: h5py.File | h5py.Dataset, values: Mapping[str, Any]) -> None:
    """Writes texts and numbers; None is left out."""
    for name, value in sorted(values.items()):  # equal flows make equal files
        if isinstance(value, str):
            # Of fixed length: HDF5 hangs on some damaged strings of variable length.
            encoded = value.encode()
            kind = h5py.string_dtype("utf-8", max(len(encoded), 1))
            place.attrs.create(name, np.array(encoded, dtype=kind), dtype=kind)
        elif value is not None:
            place.attrs[name] = int(value) if isinstance(value, bool) else value
