"""The schema of the flow file, version 1: a table of datasets with shapes, types, units, bounds.

The reader, the writer and the checks of flows in memory all use this table. Axes: T times, Y rows,
X columns, N scattered vectors, n points of the free surface, m points of walls. A file has either
the grid or the particles. The meaning of the datasets stands at the fields of `Flow`, `Particles`,
`Surface` and `Walls`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from granpinn.data.flow import (
    LARGEST,
    LEAST,
    PERIOD_X,
    STEADY,
    SURFACE_SD,
    WALL_GAP,
    WINDOW,
    Flow,
    FlowFileError,
    Particles,
)
from granpinn.physics.law_values import PARAMETERS

if TYPE_CHECKING:
    from granpinn.data.hdf5 import Attributes

FORMAT_NAME = "granpinn-flow"
FORMAT_VERSION = 1
MOST_IN_MEMORY = 2**30  # bytes of a flow; a larger one is stored so that it can be used in its file


class DatasetRule(NamedTuple):
    """What one dataset may be.

    Attributes:
        axes: names of its axes.
        dtypes: that it may have in a file.
        dtype: in memory; None: as in the file.
        quantity: whose unit it has.
        low, high: the range of its values.
        gaps: whether NaN stands where there is no value.
    """

    name: str
    axes: tuple[str, ...]
    dtypes: tuple[str, ...]
    dtype: str | None
    quantity: str
    required: bool = False
    low: float = -LARGEST
    high: float = LARGEST
    gaps: bool = False

    def __str__(self) -> str:
        return f"{' or '.join(self.dtypes)} [{', '.join(self.axes)}]"


PARTICLES = "particles"
_GRID, _N, _SURFACE, _WALL = ("T", "Y", "X"), ("N",), ("n",), ("m",)
_SINGLE, _DOUBLE = ("float32",), ("float64",)
# Volume fractions of a solver exceed 0..1 by rounding errors; a larger excess is a mistake.
FRACTION_TOLERANCE = 1e-6
_FRACTION: dict[str, Any] = {"low": -FRACTION_TOLERANCE, "high": 1 + FRACTION_TOLERANCE}
_SD: dict[str, Any] = {"low": LEAST}
# A velocity keeps its type: rounded to float32 in other units, it would be another number.
_BOTH = (*_SINGLE, *_DOUBLE)

GRID_DATASETS = (
    DatasetRule("t", ("T",), _DOUBLE, "float64", "time", True),
    DatasetRule("y", ("Y",), _DOUBLE, "float64", "length", True),
    DatasetRule("x", ("X",), _DOUBLE, "float64", "length", True),
    DatasetRule("c", _GRID, _SINGLE, "float32", "fraction", True, **_FRACTION),
    DatasetRule("u", _GRID, _BOTH, None, "velocity", True, gaps=True),
    DatasetRule("v", _GRID, _BOTH, None, "velocity", True, gaps=True),
    DatasetRule("p", _GRID, _SINGLE, "float32", "pressure", gaps=True),
    DatasetRule("sigma_u", _GRID, _SINGLE, "float32", "velocity", gaps=True),
    DatasetRule("sigma_v", _GRID, _SINGLE, "float32", "velocity", gaps=True),
)
PARTICLE_DATASETS = (
    DatasetRule(f"{PARTICLES}/t", _N, _DOUBLE, "float64", "time", True),
    DatasetRule(f"{PARTICLES}/x", _N, _DOUBLE, "float64", "length", True),
    DatasetRule(f"{PARTICLES}/y", _N, _DOUBLE, "float64", "length", True),
    DatasetRule(f"{PARTICLES}/u", _N, _BOTH, None, "velocity", True),
    DatasetRule(f"{PARTICLES}/v", _N, _BOTH, None, "velocity", True),
    DatasetRule(f"{PARTICLES}/sigma_u", _N, _SINGLE, "float32", "velocity", **_SD),
    DatasetRule(f"{PARTICLES}/sigma_v", _N, _SINGLE, "float32", "velocity", **_SD),
)
SURFACE_DATASETS = (
    DatasetRule("surface_t", _SURFACE, ("float64", "float32"), "float64", "time"),
    DatasetRule("surface_x", _SURFACE, ("float64", "float32"), "float64", "length"),
    DatasetRule("surface_y", _SURFACE, ("float64", "float32"), "float64", "length"),
    DatasetRule("surface_p", _SURFACE, _BOTH, "float32", "pressure"),
)
WALL_DATASETS = (
    DatasetRule("wall_x", _WALL, _DOUBLE, "float64", "length", gaps=True),
    DatasetRule("wall_y", _WALL, _DOUBLE, "float64", "length", gaps=True),
    DatasetRule("wall_u", _WALL, _BOTH, "float64", "velocity"),
    DatasetRule("wall_v", _WALL, _BOTH, "float64", "velocity"),
    DatasetRule("wall_slip", _WALL, _BOTH, "float32", "fraction", low=0, high=1),
    DatasetRule("wall_p", _WALL, _BOTH, "float32", "pressure", low=0, gaps=True),
)
# Datasets of a group need these.
_SURFACES = tuple(rule.name for rule in SURFACE_DATASETS)
_WALLS = tuple(rule.name for rule in WALL_DATASETS)
TOGETHER = (
    (("surface_t", "surface_x", "surface_y"), _SURFACES),
    (("wall_x", "wall_y"), _WALLS),
    (("wall_u", "wall_v"), ("wall_u", "wall_v")),
)
DATASETS = {
    rule.name: rule
    for rule in (*GRID_DATASETS, *PARTICLE_DATASETS, *SURFACE_DATASETS, *WALL_DATASETS)
}

# Root attributes with a meaning of their own; all others are kept in Flow.attributes.
NUMBERS = ("density", "grain_diameter")
TEXTS = ("length_unit", "time_unit")
OPTIONAL_TEXTS = ("density_unit",)
OPTIONAL_NUMBERS = ("eta_max", "eta_min", "sigma_u", "sigma_v", "grain_density")
# Numbers about the whole flow, in Flow.attributes: 1 if it is steady; its period along x; the
# sd of its surface line; the distance between side walls; the window of its vectors.
OF_FLOW = (STEADY, PERIOD_X, SURFACE_SD, WALL_GAP, WINDOW)
TRUE_LAW = "true_law"  # absent: mu_of_i
TRUTH = {f"true_{name}": name for name in PARAMETERS}
KNOWN_ATTRIBUTES = frozenset(
    (
        *("format_name", "format_version", "gravity", TRUE_LAW),
        *(*NUMBERS, *TEXTS, *OPTIONAL_TEXTS, *OPTIONAL_NUMBERS, *OF_FLOW, *TRUTH),
    )
)


# Each makes other numbers of the stored ones: the first two even if they only round, the third
# (of xarray) truth values or durations.
CHANGING = ("scale_factor", "add_offset", "dtype")
FILL = ("_FillValue", "missing_value")
SI = ("m", "s", "kg/m^3")
WRITE_HINT = "write it with granpinn.data.write_flow"


def arrays_of(flow: Flow) -> dict[str, npt.NDArray[Any]]:
    """The arrays of a flow by the names of their datasets."""
    own = grid_arrays_of(flow) if flow.particles is None else particle_arrays_of(flow.particles)
    own |= _arrays(SURFACE_DATASETS, "surface_", flow.surface)
    return own | _arrays(WALL_DATASETS, "wall_", flow.walls)


def grid_arrays_of(flow: Flow) -> dict[str, npt.NDArray[Any]]:
    """The arrays on the grid, also if it is only a view of particles."""
    return _arrays(GRID_DATASETS, "", flow)


def particle_arrays_of(particles: Particles) -> dict[str, npt.NDArray[Any]]:
    """The arrays of particles by the names of their datasets."""
    return _arrays(PARTICLE_DATASETS, f"{PARTICLES}/", particles)


def _arrays(
    rules: tuple[DatasetRule, ...], prefix: str, holder: Any
) -> dict[str, npt.NDArray[Any]]:
    parts = {rule.name: getattr(holder, rule.name.removeprefix(prefix), None) for rule in rules}
    return {name: part for name, part in parts.items() if isinstance(part, np.ndarray)}


def unit_of(rule: DatasetRule, length: str, time: str, density: str | None) -> str | None:
    """The unit of a dataset in a file with units of length, time and density.

    None for a pressure, unless the flow is dimensionless or in SI units.
    """
    if rule.quantity == "fraction" or length == time == "1":
        return "1"
    if rule.quantity == "pressure":
        return "Pa" if (length, time, density) == SI else None
    return {"time": time, "length": length, "velocity": f"{length}/{time}"}[rule.quantity]


def check_conventions(name: str, attributes: Attributes, wanted: str | None) -> None:
    """Raises FlowFileError if an attribute of a dataset changes its numbers or their unit.

    Programs that open the file as netCDF, such as xarray, apply the attributes of the CF
    conventions. granpinn takes the numbers as they are stored.
    """
    fills = {attribute: attributes.numbers(attribute) for attribute in FILL}
    other = [a for a, values in fills.items() if values and not np.isnan(values).all()]
    if wrong := [a for a in CHANGING if a in attributes] + other:
        raise FlowFileError(
            f"{name} must be stored as it is, NaN where there is no value, got the attribute "
            f"{wrong[0]}, by which other programs change its numbers: write the final numbers "
            "without it"
        )
    if "units" not in attributes:
        return
    found = attributes.text("units")
    if wanted is None:
        raise FlowFileError(
            f"{name} must have no attribute units unless the file is dimensionless or in m, s and "
            f"kg/m^3 (density_unit), got {found!r}: remove it, or state density_unit"
        )
    if found is None or _plain(found) not in (
        _plain(wanted),
        _plain(wanted.replace("/", " ") + "-1"),
    ):
        raise FlowFileError(
            f"{name} must be in {wanted!r} by length_unit and time_unit of the file, got the "
            f"attribute units = {found!r}: convert {name}, or correct the attribute"
        )


def _plain(unit: str) -> str:
    """A unit without the signs of a product or a power: "m s^-1" becomes "ms-1"."""
    return re.sub(r"[ .*^]", "", unit) or "1"


def check_layout(found: Mapping[str, Any]) -> None:
    """Checks the presence, types and shapes of the datasets.

    Args:
        found: every dataset of the format that a file or a flow has, with its `shape` and `dtype`.
    """
    sizes: dict[str, int] = {}
    scattered = [rule.name for rule in PARTICLE_DATASETS if rule.name in found]
    gridded = [rule.name for rule in GRID_DATASETS if rule.name in found]
    if scattered and gridded:
        raise FlowFileError(
            f"a flow must be on a grid or at particles, got both {gridded[0]} and "
            f"{scattered[0]}: leave one of them out"
        )
    own = PARTICLE_DATASETS if scattered else GRID_DATASETS
    for rule in (*own, *SURFACE_DATASETS, *WALL_DATASETS):
        if rule.name in found:
            _check_one_layout(rule, found[rule.name], sizes)
        elif rule.required:
            names = ", ".join(found) or "none of the format"
            raise FlowFileError(
                f"{rule.name} is missing: expected a dataset {rule.name} {rule}, found {names}; "
                "add it" + ("" if scattered else ", NaN where nothing is known")
            )
    for needed, group in TOGETHER:
        there = [name for name in found if name in group]
        lacking = [name for name in needed if name not in found]
        if there and lacking:
            raise FlowFileError(
                f"{', '.join(there)} must come with {' and '.join(lacking)}, got none: add the "
                "others or leave them all out"
            )


def check_range(
    name: str,
    values: npt.NDArray[Any] | float,
    low: float,
    high: float,
    gaps: bool = False,
    remedy: str = "correct it or its unit",
) -> None:
    """Raises FlowFileError for the first value outside a range.

    Args:
        gaps: whether NaN is allowed.
    """
    array = np.atleast_1d(values)
    wrong = ~((array >= low) & (array <= high))
    if gaps:
        wrong &= ~np.isnan(array)
    if wrong.any():
        place = f" at index {int(np.argmax(wrong))}" if array.size > 1 and array.ndim == 1 else ""
        known = ", or NaN where it is not known" * gaps
        raise FlowFileError(
            f"{name} must be from {low:g} to {high:g}{known}, got {array[wrong][0]:g}{place}: "
            f"{remedy}"
        )


def check_ranges(arrays: Mapping[str, npt.NDArray[Any]]) -> None:
    """Raises FlowFileError for the first value of datasets outside its range."""
    for name, values in arrays.items():
        rule = DATASETS[name]
        if rule.axes == _WALL and not rule.gaps:  # between two pieces there is no value
            values = values[~np.isnan(arrays["wall_x"])]
        check_range(name, values, rule.low, rule.high, rule.gaps)


def _check_one_layout(rule: DatasetRule, dataset: Any, sizes: dict[str, int]) -> None:
    """Checks one dataset against its rule; `sizes` collects the length of every axis."""
    name, shape, dtype = rule.name, dataset.shape, str(dataset.dtype)
    if dtype not in rule.dtypes or len(shape) != len(rule.axes):
        raise FlowFileError(
            f"{name} must be {rule}, got {dtype} {list(shape)}: convert it or {WRITE_HINT}"
        )
    points = {"n": "surface", "m": "walls"}.get(rule.axes[0])
    least = 1 if points or rule.axes == ("T",) else 2  # one frame is a steady flow
    if len(shape) == 1 and shape[0] < least:
        remedy = f"leave the {points} out instead" if points else "give more of the flow"
        raise FlowFileError(
            f"{name} must hold at least {least} value{'s' * (least > 1)}, got {shape[0]}: {remedy}"
        )
    for axis, size in zip(rule.axes, shape, strict=True):
        sizes.setdefault(axis, size)
    expected = tuple(sizes[axis] for axis in rule.axes)
    if shape != expected:
        axes = f"[{', '.join(rule.axes)}]"
        raise FlowFileError(
            f"{name} must be {axes} = {list(expected)}, got {list(shape)}: transpose it, or give a "
            "value at every point"
        )
