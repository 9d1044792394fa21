"""Reads and writes a flow file, version 1, which xarray can open as netCDF-4.

Every fault of a file is a FlowFileError.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from granpinn.data.flow import Flow, FlowFileError, Particles, Surface, Truth, Walls
from granpinn.data.hdf5 import Hdf5File, read_hdf5
from granpinn.data.particles import grid_view
from granpinn.data.rules import check_flow, check_values
from granpinn.data.schema import (
    DATASETS,
    FORMAT_NAME,
    FORMAT_VERSION,
    KNOWN_ATTRIBUTES,
    MOST_IN_MEMORY,
    NUMBERS,
    OF_FLOW,
    OPTIONAL_NUMBERS,
    OPTIONAL_TEXTS,
    PARTICLES,
    TEXTS,
    TRUE_LAW,
    TRUTH,
    WRITE_HINT,
    arrays_of,
    check_conventions,
    check_layout,
    unit_of,
)
from granpinn.declared import checked
from granpinn.output import hdf5_file
from granpinn.physics.laws import DEFAULT
from granpinn.regular import UnsafeFileError

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
        return bool(file.attributes.text("format_name") == FORMAT_NAME)
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
        check_values(flow)
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
    stated = file.attributes
    constants: dict[str, Any] = {"gravity": tuple(map(float, stated.numbers("gravity", True)))}
    constants |= {name: stated.number(name, True) for name in NUMBERS}
    constants |= {name: stated.text(name, True) for name in TEXTS}
    optional: dict[str, Any] = {name: stated.number(name) for name in OPTIONAL_NUMBERS}
    optional |= {name: stated.text(name) for name in OPTIONAL_TEXTS}
    truth = _truth(file)
    others = stated.scalars(KNOWN_ATTRIBUTES)
    of_flow = {name: stated.number(name) for name in OF_FLOW}
    others |= {name: value for name, value in of_flow.items() if value is not None}
    units = constants["length_unit"], constants["time_unit"], optional["density_unit"]
    arrays = _arrays(file, units)
    for name in ("sigma_u", "sigma_v"):
        if name in arrays and optional[name] is not None:
            raise FlowFileError(
                f"{name} must be either an attribute or a dataset, got both: remove one"
            )
        optional[name] = arrays.pop(name, optional[name])
    prefix = f"{PARTICLES}/"
    scattered = {n.removeprefix(prefix): arrays.pop(n) for n in [*arrays] if n.startswith(prefix)}
    if scattered:
        optional["particles"] = particles = Particles(**scattered)
        arrays |= grid_view(particles)
    surface = {name: arrays.pop(f"surface_{name}", None) for name in ("t", "x", "y", "p")}
    walls = {n.removeprefix("wall_"): arrays.pop(n) for n in [*arrays] if n.startswith("wall_")}
    return Flow(
        **arrays,
        **constants,
        **optional,
        surface=None if surface["t"] is None else Surface(**surface),
        walls=Walls(**walls) if walls else None,
        truth=truth,
        attributes=others,
        sha256=file.sha256,
        path=path,
    )


def _truth(file: Hdf5File) -> Truth | None:
    """The law that made the data; None if the file states neither the law nor a parameter."""
    law = file.attributes.text(TRUE_LAW)
    values = {field: file.attributes.number(name) for name, field in TRUTH.items()}
    if law is None and all(value is None for value in values.values()):
        return None
    try:
        return Truth(law=law or DEFAULT.name, **values)
    except ValueError as error:
        raise FlowFileError(f"the true friction law: {error}") from None


def _arrays(file: Hdf5File, units: tuple[str, str, str | None]) -> dict[str, Any]:
    """All arrays of the format in their types, after checks of their layout and units."""
    check_layout(file.datasets)
    for name, dataset in file.datasets.items():
        check_conventions(name, dataset.attributes, unit_of(DATASETS[name], *units))
    # A number beyond the range of the type becomes infinite, as in HDF5.
    with np.errstate(over="ignore"):
        return {
            name: np.asarray(dataset.values, DATASETS[name].dtype or dataset.dtype)
            for name, dataset in file.datasets.items()
        }


def _check_version(file: Hdf5File) -> None:
    name = file.attributes.text("format_name")
    if name != FORMAT_NAME:
        found = "nothing" if name is None else repr(name[:40])
        raise FlowFileError(
            f"the attribute format_name must be '{FORMAT_NAME}', got {found}: this is another "
            f"kind of HDF5 file; {WRITE_HINT}"
        )
    version = file.attributes.numbers("format_version")
    if version != (FORMAT_VERSION,):
        found = "nothing" if version is None else ", ".join(f"{value:g}" for value in version[:4])
        raise FlowFileError(
            f"the attribute format_version must be {FORMAT_VERSION}, got {found}: update "
            f"granpinn or {WRITE_HINT}"
        )


FRAMES_PER_CHUNK = 10
ROWS_PER_CHUNK = 100_000
_PACKED = {"compression": "gzip", "shuffle": True}
# Dimension scales: the axis that each coordinate stands for.
_SCALES = {"T": "t", "Y": "y", "X": "x", "N": f"{PARTICLES}/t", "n": "surface_t", "m": "wall_x"}


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
    truth = flow.truth or Truth()
    values = {
        **flow.attributes,
        "format_name": FORMAT_NAME,
        "format_version": FORMAT_VERSION,
        "gravity": np.asarray(flow.gravity, dtype=np.float64),
        **{name: getattr(flow, name) for name in (*NUMBERS, *TEXTS)},
        **{name: getattr(flow, name) for name in (*OPTIONAL_NUMBERS, *OPTIONAL_TEXTS)},
        TRUE_LAW: None if flow.truth is None else flow.truth.law,
        **{name: getattr(truth, field) for name, field in TRUTH.items()},
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
        unit = unit_of(rule, flow.length_unit, flow.time_unit, flow.density_unit)
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
