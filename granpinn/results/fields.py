"""The predicted fields on the input grid, in the units of the flow file, and their file fields.h5.

fields.h5 has the layout of a flow file (dimension scales t, y, x; variables [T, Y, X]) with NaN
where there are no grains, and opens in xarray.  It also holds the values of the flow file, so that
a run folder can be read and drawn without its input.

The motion determines the pressure only where the material shears. A mean over all points would hide
the error there. A point flows where D2 >= 0.05 sqrt(|g| / H0); elsewhere it is stagnant (at rest or
in rigid motion). 0.05 is the strain-rate error of a velocity field resolved to about 1 %; below it
the direction of the stress is lost. A quarter of the points of a column collapse are stagnant by
this rule. D2 is spread evenly over the decades around this threshold, so that no threshold is
natural.

For scores, D2 is taken from finite differences of the velocity in the file, so that the zones do
not depend on the network. If the file declares measurement noise (sigma_u, sigma_v), the predicted
D2 is used: differences of noise are large even in grains at rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.arrays import Bool, Float32, Float64, Floats, Int64, nearest
from granpinn.data.flow import STEADY, FlowFileError, Units
from granpinn.data.flow_file import Hdf5File, add_dataset, read_hdf5, write_attributes
from granpinn.data.schema import (
    GRID,
    DatasetRule,
    attribute,
    check_format,
    check_rules,
)
from granpinn.declared import checked
from granpinn.errors import BadInput
from granpinn.output import hdf5_file
from granpinn.output.hdf5 import PACKED, write_frames
from granpinn.regular import MissingFileError, UnsafeFileError

FORMAT_NAME = "granpinn-fields"
FORMAT_VERSION = 1
D2_STAGNANT = 0.05  # in units of sqrt(|g| / H0)
SCALES = ("length", "time", "pressure")
MAX_BYTES = 2**34  # all variables of a flow file of the largest size

# name -> (quantity, description)
AXES = {
    "t": ("time", "time"),
    "y": ("length", "upward position"),
    "x": ("length", "position to the right"),
}
VARIABLES = {
    "u": ("velocity", "predicted velocity along x"),
    "v": ("velocity", "predicted velocity along y"),
    "p": ("pressure", "predicted pressure"),
    "tau_xx": ("pressure", "predicted deviatoric stress, xx = -yy"),
    "tau_xy": ("pressure", "predicted deviatoric stress, xy"),
    "D2": ("rate", "predicted strain rate sqrt(D:D)"),
    "I": ("number", "predicted inertial number"),
    "eta": ("viscosity", "predicted effective viscosity"),
    "momentum_residual_x": ("number", "strong-form momentum residual along x / (rho |g|)"),
    "momentum_residual_y": ("number", "strong-form momentum residual along y / (rho |g|)"),
    "divergence": ("rate", "divergence of the predicted velocity"),
    "u_reference": ("velocity", "velocity along x in the flow file"),
    "v_reference": ("velocity", "velocity along y in the flow file"),
    "p_reference": ("pressure", "reference pressure in the flow file"),
}


def _rule(
    name: str, about: tuple[str, str], axes: tuple[str, ...] = GRID, dtype: str = "float32"
) -> DatasetRule:
    return DatasetRule(name, axes, (dtype,), dtype, about[0], name in "tyxc", title=about[1])


RULES = {
    **{name: _rule(name, AXES[name], (name.upper(),), "float64") for name in AXES},
    "c": _rule("c", ("number", "volume fraction of grains")),
    **{name: _rule(name, VARIABLES[name]) for name in VARIABLES},
}


class FieldsFileError(BadInput):
    """fields.h5 is missing or cannot be read."""


def _cell(centers: Float64, at: Float64) -> Int64:
    """The index of the cell that holds each position; -1 outside of all. NaN is outside."""
    half = np.diff(centers).mean() / 2 if centers.size > 1 else np.inf
    within = (at >= centers[0] - half) & (at <= centers[-1] + half)
    return np.where(within, nearest(centers, at), -1)


@dataclass(frozen=True, eq=False)
class Fields:
    """Values at the K points inside the grains (c = 1) of a grid, in the units of the flow file.

    Attributes:
        t, y, x: coordinates [T], [Y], [X].
        c: volume fraction of grains [T, Y, X].
        values: name (see `VARIABLES`) -> values at the points [K], in the order of `index`.
        units: units of length and time.
        length, time, pressure: the scales H0, sqrt(H0 / |g|) and rho |g| H0.
        steady: whether the flow is steady; then its time has no origin.
    """

    t: Float64
    y: Float64
    x: Float64
    c: Float32
    values: dict[str, Float32]
    units: Units
    length: float
    time: float
    pressure: float
    steady: bool = False

    @property
    def shape(self) -> tuple[int, int, int]:
        return self.t.size, self.y.size, self.x.size

    @cached_property
    def index(self) -> Int64:
        """Positions of the points in the flattened grid [K], ascending."""
        return np.flatnonzero(np.equal(self.c, 1.0))

    def inside(self, x: Float64, y: Float64, t: Float64) -> Bool:
        """Whether points are inside the grains: at least half of their cell is, in its frame.

        Args:
            x, y, t: of shapes that broadcast; the time of a steady flow does not count.
        """
        frames = (np.zeros(1), np.zeros_like(t)) if self.steady else (self.t, t)
        places = [_cell(*pair) for pair in (frames, (self.y, y), (self.x, x))]
        known = places[0] >= 0
        for place in places[1:]:
            known = known & (place >= 0)
        inside: Bool = known & (self.c[tuple(places)] >= 0.5)
        return inside

    def time_of_points(self) -> Float64:
        """Time of every point [K]."""
        return self.t[self.index // (self.y.size * self.x.size)]

    def frame(self, name: str, k: int) -> Float32:
        """One variable at frame k [Y, X], NaN outside the grains; c everywhere."""
        if name == "c":
            return np.asarray(self.c[k])
        size = self.y.size * self.x.size
        first, last = np.searchsorted(self.index, (k * size, (k + 1) * size))
        grid = np.full(size, np.nan, np.float32)
        grid[self.index[first:last] - k * size] = self.values[name][first:last]
        return grid.reshape(self.y.size, self.x.size)


def fields_dataset(fields: Fields) -> Any:
    """The fields as an xarray.Dataset over (t, y, x): NaN outside the grains, units in `attrs`."""
    import xarray  # slow to import

    arrays = {name: getattr(fields, name) for name in AXES}
    for name in ("c", *(name for name in VARIABLES if name in fields.values)):
        arrays[name] = np.stack([fields.frame(name, k) for k in range(fields.t.size)])
    variables = {
        name: ([a.lower() for a in RULES[name].axes], array, RULES[name].described(fields.units))
        for name, array in arrays.items()
    }
    scales = {f"{name}_scale": getattr(fields, name) for name in SCALES}
    return xarray.Dataset(variables, attrs=scales)


def write_fields(fields: Fields, path: str | Path) -> None:
    """Write fields.h5 by frames: a few dozen of them are in memory beside the packed file."""
    attributes = {
        "format_name": FORMAT_NAME,
        "format_version": FORMAT_VERSION,
        **{f"{name}_unit": unit for name, unit in vars(fields.units).items()},
        **({STEADY: 1} if fields.steady else {}),
        **{f"{name}_scale": getattr(fields, name) for name in SCALES},
    }
    chunks = (1, fields.y.size, fields.x.size)
    with hdf5_file(path) as file:
        write_attributes(file, attributes)
        for name, rule in RULES.items():
            if name in AXES:
                add_dataset(file, rule, fields.units, data=getattr(fields, name))
            elif name == "c" or name in fields.values:
                options = {"shape": fields.shape, "dtype": np.float32, "chunks": chunks, **PACKED}
                dataset = add_dataset(file, rule, fields.units, **options)
                write_frames(dataset, partial(fields.frame, name))


@checked
def read_fields(path: str | Path) -> Fields:
    """Read fields.h5; the message of FieldsFileError is one sentence."""
    path = Path(path)
    try:
        return _read(read_hdf5(path, [*RULES], MAX_BYTES, "choose fewer frames"))
    except MissingFileError:
        raise FieldsFileError(f"{path} does not exist") from None
    except (UnsafeFileError, FlowFileError) as error:
        raise FieldsFileError(f"{path} could not be read as {FORMAT_NAME}: {error}") from None


def _read(file: Hdf5File) -> Fields:
    stated = file.attributes
    check_format(stated, FORMAT_NAME, FORMAT_VERSION, "read it with the granpinn that wrote it")
    check_rules(RULES.values(), file.datasets, "predict again")
    arrays: dict[str, Any] = {
        name: np.asarray(dataset.values, RULES[name].dtype)
        for name, dataset in file.datasets.items()
    }
    t, y, x, c = (arrays.pop(name) for name in "tyxc")
    values = {name: array[c == 1] for name, array in arrays.items()}
    names = {"length": True, "time": True, "density": False}
    units = Units(*(attribute(stated, f"{name}_unit", str, names[name]) for name in names))
    length, time, pressure = (attribute(stated, f"{name}_scale", float, True) for name in SCALES)
    steady = attribute(stated, STEADY, list) == [1]
    return Fields(t, y, x, c, values, units, length, time, pressure, steady)


def after_start(fields: Fields) -> Bool:
    """Points [K] that count: at t = 0 there is no solution to compare with, unless it is steady."""
    return fields.time_of_points() > 0 if not fields.steady else np.ones(fields.index.size, bool)


def flowing(fields: Fields, d2: Floats | None = None) -> Bool:
    """Points [K] whose strain rate (the predicted one unless given, in the file's units) flows.

    A point with an unknown strain rate (NaN) does not count as flowing.
    """
    d2 = fields.values["D2"] if d2 is None else d2
    return np.asarray(d2 * fields.time >= D2_STAGNANT)


def shearing(fields: Fields) -> Bool:
    """Points [K] after the start that flow: the ones that show friction."""
    return np.asarray(after_start(fields) & flowing(fields))
