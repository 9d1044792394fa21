"""fields.vtkhdf: the fields of a run over time for ParaView (5.11 or later) and pyvista.

VTKHDF version 2.0, type ImageData with time steps: point data with the axes (t, y, x) and, for
vectors, a last axis of length 3; the single layer in z has no axis.  NaN means no grains.  The
format has even spacing only: the points of an uneven grid are moved to the nearest points of an
even one, and `write_vtkhdf` returns True.
https://docs.vtk.org/en/latest/vtk_file_formats/vtkhdf_file_format/
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np

from granpinn.arrays import Float32, Float64, Int64, nearest
from granpinn.output import hdf5_file
from granpinn.output.frames import PACKED, packer
from granpinn.results import Fields
from granpinn.results.fields import VARIABLES

VERSION = (2, 0)
EVEN = 1e-3  # largest deviation from an even grid, in cells, that coordinates of a file may have

Frame = Callable[[int], Float32]


class GridAxis(NamedTuple):
    """An even axis: its first value, spacing, and the grid index of each of its points [n]."""

    origin: float
    spacing: float
    points: Int64
    moved: bool


def even(axis: Float64) -> GridAxis:
    """The even axis with the ends and the number of points of an ascending one."""
    if axis.size == 1:
        return GridAxis(float(axis[0]), 1.0, np.zeros(1, np.int64), False)
    wanted = np.linspace(axis[0], axis[-1], axis.size)
    spacing = float(wanted[1] - wanted[0])
    if np.max(np.abs(axis - wanted)) <= EVEN * spacing:
        return GridAxis(float(axis[0]), spacing, np.arange(axis.size), False)
    return GridAxis(float(axis[0]), spacing, nearest(axis, wanted), True)


def write_vtkhdf(fields: Fields, path: str | Path) -> bool:
    """Write all variables frame by frame; whether points of an uneven grid were moved."""
    y, x = even(fields.y), even(fields.x)
    cut = np.ix_(y.points, x.points)
    with hdf5_file(path) as file, packer() as threads:
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = np.array(VERSION, np.int64)
        root.attrs["Type"] = np.bytes_(b"ImageData")
        extent = (0, x.points.size - 1, 0, y.points.size - 1, 0, 0)
        root.attrs["WholeExtent"] = np.array(extent, np.int64)
        root.attrs["Origin"] = np.array((x.origin, y.origin, 0.0))
        root.attrs["Spacing"] = np.array((x.spacing, y.spacing, 1.0))
        root.attrs["Direction"] = np.eye(3).ravel()
        steps = root.create_group("Steps")
        steps.attrs["NSteps"] = np.int64(fields.t.size)
        steps["Values"] = fields.t
        offsets = steps.create_group("PointDataOffsets")
        points = root.create_group("PointData")
        for name, frame in _arrays(fields).items():
            packed = _dataset(points, name, (fields.t.size, *frame(0)[cut].shape))
            threads.write(packed, lambda k, f=frame: f(k)[cut])  # type: ignore[misc]
            offsets[name] = np.arange(fields.t.size, dtype=np.int64)
    return y.moved or x.moved


def _arrays(fields: Fields) -> dict[str, Frame]:
    """Name in ParaView -> its values at frame k, [Y, X] or [Y, X, 3]."""

    def scalar(name: str) -> Frame:
        return lambda k: fields.frame(name, k)

    def vector(name_x: str, name_y: str) -> Frame:
        def frame(k: int) -> Float32:
            f_x, f_y = fields.frame(name_x, k), fields.frame(name_y, k)
            return np.stack([f_x, f_y, 0 * f_x], axis=-1)

        return frame

    arrays: dict[str, Frame] = {"c": lambda k: np.asarray(fields.c[k], np.float32)}
    vectors = {
        "velocity": ("u", "v"),
        "velocity_reference": ("u_reference", "v_reference"),
        "momentum_residual": ("momentum_residual_x", "momentum_residual_y"),
    }
    for name, parts in vectors.items():
        if set(parts) <= set(fields.values):
            arrays[name] = vector(*parts)
    inside_vectors = {part for parts in vectors.values() for part in parts}
    for name in VARIABLES:
        if name in fields.values and name not in inside_vectors:
            arrays[name] = scalar(name)
    return arrays


def _dataset(points: h5py.Group, name: str, shape: tuple[int, ...]) -> h5py.Dataset:
    """An empty dataset [T, ...] with chunks of one frame."""
    chunks = (1, *shape[1:])
    return points.create_dataset(name, shape=shape, dtype=np.float32, chunks=chunks, **PACKED)
