"""Writes a flow file, version 1, which xarray can open as netCDF-4."""

from __future__ import annotations

import os
from typing import Any

import h5py
import numpy as np

from granpinn.data.flow import Flow, FlowFileError, Truth
from granpinn.data.rules import check_flow
from granpinn.data.schema import (
    DATASETS,
    FORMAT_NAME,
    FORMAT_VERSION,
    MOST_IN_MEMORY,
    NUMBERS,
    OPTIONAL_NUMBERS,
    OPTIONAL_TEXTS,
    PARTICLES,
    TEXTS,
    TRUE_LAW,
    TRUTH,
    arrays_of,
    unit_of,
)
from granpinn.declared import checked
from granpinn.output import hdf5_file

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
