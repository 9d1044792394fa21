"""The schema of the flow file, version 1: its datasets and attributes with their types and ranges.

The reader, the writer and the checks of flows in memory all use these tables. Axes: T times, Y
rows, X columns, N scattered vectors, n points of the free surface, m points of walls. A file has
either the grid or the particles. The meaning of the entries stands at the fields of `Flow`,
`Particles`, `Surface` and `Walls`.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from granpinn.data.flow import (
    LARGEST,
    LEAST,
    PERIOD_X,
    SOLVER_CELL,
    SOLVER_MEAN,
    STEADY,
    SURFACE_SD,
    WALL_GAP,
    WINDOW,
    Flow,
    FlowFileError,
    Particles,
    Surface,
    Units,
    Walls,
)
from granpinn.declared import shown
from granpinn.physics.law_values import PARAMETERS
from granpinn.regular import UnsafeFileError

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
        title: what it is, for other programs.
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
    title: str = ""

    def __str__(self) -> str:
        return f"{' or '.join(self.dtypes)} [{', '.join(self.axes)}]"

    def described(self, units: Units) -> dict[str, str]:
        """The attributes of the dataset."""
        texts = {"long_name": self.title, "units": units.of(self.quantity)}
        return {name: text for name, text in texts.items() if text}


GRID, _N, _SURFACE, _WALL = ("T", "Y", "X"), ("N",), ("n",), ("m",)
_SINGLE, _DOUBLE = ("float32",), ("float64",)
# Volume fractions of a solver exceed 0..1 by rounding errors; a larger excess is a mistake.
FRACTION_TOLERANCE = 1e-6
_FRACTION: dict[str, Any] = {"low": -FRACTION_TOLERANCE, "high": 1 + FRACTION_TOLERANCE}
_SD: dict[str, Any] = {"low": LEAST}
# A velocity keeps its type: rounded to float32 in other units, it would be another number.
_BOTH = (*_SINGLE, *_DOUBLE)

# The records of a flow, each with what the names of its datasets begin with, and these datasets. A
# dataset is required if the flow has the record.
RECORDS: dict[type, tuple[str, tuple[DatasetRule, ...]]] = {
    Flow: (
        "",
        (
            DatasetRule("t", ("T",), _DOUBLE, "float64", "time", True),
            DatasetRule("y", ("Y",), _DOUBLE, "float64", "length", True),
            DatasetRule("x", ("X",), _DOUBLE, "float64", "length", True),
            DatasetRule("c", GRID, _SINGLE, "float32", "number", True, **_FRACTION),
            DatasetRule("u", GRID, _BOTH, None, "velocity", True, gaps=True),
            DatasetRule("v", GRID, _BOTH, None, "velocity", True, gaps=True),
            DatasetRule("p", GRID, _SINGLE, "float32", "pressure", gaps=True),
            DatasetRule("sigma_u", GRID, _SINGLE, "float32", "velocity", gaps=True),
            DatasetRule("sigma_v", GRID, _SINGLE, "float32", "velocity", gaps=True),
        ),
    ),
    Particles: (
        "particles/",
        (
            DatasetRule("particles/t", _N, _DOUBLE, "float64", "time", True),
            DatasetRule("particles/x", _N, _DOUBLE, "float64", "length", True),
            DatasetRule("particles/y", _N, _DOUBLE, "float64", "length", True),
            DatasetRule("particles/u", _N, _BOTH, None, "velocity", True),
            DatasetRule("particles/v", _N, _BOTH, None, "velocity", True),
            DatasetRule("particles/sigma_u", _N, _SINGLE, "float32", "velocity", **_SD),
            DatasetRule("particles/sigma_v", _N, _SINGLE, "float32", "velocity", **_SD),
        ),
    ),
    Surface: (
        "surface_",
        (
            DatasetRule("surface_t", _SURFACE, ("float64", "float32"), "float64", "time", True),
            DatasetRule("surface_x", _SURFACE, ("float64", "float32"), "float64", "length", True),
            DatasetRule("surface_y", _SURFACE, ("float64", "float32"), "float64", "length", True),
            DatasetRule("surface_p", _SURFACE, _BOTH, "float32", "pressure"),
        ),
    ),
    Walls: (
        "wall_",
        (
            DatasetRule("wall_x", _WALL, _DOUBLE, "float64", "length", True, gaps=True),
            DatasetRule("wall_y", _WALL, _DOUBLE, "float64", "length", True, gaps=True),
            DatasetRule("wall_u", _WALL, _BOTH, "float64", "velocity"),
            DatasetRule("wall_v", _WALL, _BOTH, "float64", "velocity"),
            DatasetRule("wall_slip", _WALL, _BOTH, "float32", "number", low=0, high=1),
            DatasetRule("wall_p", _WALL, _BOTH, "float32", "pressure", low=0, gaps=True),
        ),
    ),
}
DATASETS = {rule.name: rule for _, rules in RECORDS.values() for rule in rules}
# What comes together, as a dataset or an attribute.
PAIRS = (
    ("wall_u", "wall_v"),
    ("particles/sigma_u", "particles/sigma_v"),
    ("sigma_u", "sigma_v"),
)


class AttributeRule(NamedTuple):
    """What one attribute of the root may be: a text (`kind` is str), or a number in a range."""

    kind: type = float
    required: bool = False
    low: float = LEAST
    high: float = LARGEST


# Fields of a flow.
FIELDS = {
    **dict.fromkeys(("density", "grain_diameter"), AttributeRule(required=True)),
    **dict.fromkeys(("length_unit", "time_unit"), AttributeRule(str, required=True)),
    "density_unit": AttributeRule(str),
    **dict.fromkeys(("grain_density", "eta_max", "sigma_u", "sigma_v"), AttributeRule()),
    "eta_min": AttributeRule(low=0),
}
# Numbers about the whole flow, in `Flow.attributes`: 1 if it is steady; its period along x; the
# distance between side walls; the window of its vectors; the sd of its surface line; lengths of the
# solver that made it.
OF_FLOW = {
    STEADY: AttributeRule(low=0, high=1),
    **dict.fromkeys((PERIOD_X, WALL_GAP, WINDOW), AttributeRule()),
    **dict.fromkeys((SURFACE_SD, SOLVER_CELL, SOLVER_MEAN), AttributeRule(low=0)),
}
TRUTH = {"true_law": "law", **{f"true_{name}": name for name in PARAMETERS}}
# All others are kept in `Flow.attributes`, beside those that state the format, and gravity.
ATTRIBUTES = {
    **FIELDS,
    **OF_FLOW,
    **{name: AttributeRule(str if field == "law" else float) for name, field in TRUTH.items()},
}


# Each makes other numbers of the stored ones: the first two even if they only round, the third
# (of xarray) truth values or durations.
CHANGING = ("scale_factor", "add_offset", "dtype")
FILL = ("_FillValue", "missing_value")
WRITE_HINT = "write it with granpinn.data.write_flow"


def arrays_of(flow: Flow) -> dict[str, npt.NDArray[Any]]:
    """The arrays of a flow by the names of their datasets."""
    vectors = flow.particles or flow
    return arrays_in(vectors) | arrays_in(flow.surface) | arrays_in(flow.walls)


def arrays_in(record: Flow | Particles | Surface | Walls | None) -> dict[str, npt.NDArray[Any]]:
    """The arrays of one record by the names of their datasets."""
    if record is None:
        return {}
    prefix, rules = RECORDS[type(record)]
    parts = {rule.name: getattr(record, rule.name.removeprefix(prefix)) for rule in rules}
    return {name: part for name, part in parts.items() if isinstance(part, np.ndarray)}


def attributes_of(flow: Flow) -> dict[str, Any]:
    """The attributes of a flow by their names in its file; None for what is unknown."""
    values = flow.attributes | {name: getattr(flow, name) for name in FIELDS}
    return values | {name: getattr(flow.truth, field, None) for name, field in TRUTH.items()}


def attribute(stated: Mapping[str, Any], name: str, kind: type, required: bool = False) -> Any:
    """A text (str), one number (float) or all numbers (list); None if there is none.

    Args:
        stated: attributes of a file or a dataset: text, a list of numbers, or `{"type": NAME}`.

    Raises:
        UnsafeFileError: it is of another kind, or it is required and missing.
    """
    value = stated.get(name)
    if value is None and required:
        raise UnsafeFileError(f"the attribute {name} is missing: add it to the root of the file")
    if kind is float and isinstance(value, list):
        if len(value) != 1:
            raise UnsafeFileError(
                f"the attribute {name} must be one number, got {len(value)}: correct it"
            )
        return float(value[0])
    if value is None or isinstance(value, kind):
        return value
    found = value["type"] if isinstance(value, dict) else "text"
    if isinstance(value, list):
        found = f"{len(value)} numbers"
    expected = {str: "one text", float: "a number", list: "numbers"}[kind]
    raise UnsafeFileError(f"the attribute {name} must be {expected}, got {found}: write it as such")


def check_format(stated: Mapping[str, Any], name: str, version: int, remedy: str) -> None:
    """Raises UnsafeFileError unless the attributes of a file state this format and version."""
    for key, kind, wanted in (("format_name", str, name), ("format_version", float, version)):
        if (found := attribute(stated, key, kind)) != wanted:
            raise UnsafeFileError(
                f"the attribute {key} must be {wanted!r}, got {shown(found)}: {remedy}"
            )


def check_conventions(name: str, attributes: Mapping[str, Any], wanted: str | None) -> None:
    """Raises FlowFileError if an attribute of a dataset changes its numbers or their unit.

    Programs that open the file as netCDF, such as xarray, apply the attributes of the CF
    conventions. granpinn takes the numbers as they are stored.
    """
    fills = {fill: attribute(attributes, fill, list) for fill in FILL}
    other = [a for a, values in fills.items() if values and not np.isnan(values).all()]
    if wrong := [a for a in CHANGING if a in attributes] + other:
        raise FlowFileError(
            f"{name} must be stored as it is, NaN where there is no value, got the attribute "
            f"{wrong[0]}, by which other programs change its numbers: write the final numbers "
            "without it"
        )
    found = attribute(attributes, "units", str)
    known = [] if wanted is None else [_plain(wanted), _plain(wanted.replace("/", " ") + "-1")]
    if found is not None and _plain(found) not in known:
        raise FlowFileError(
            f"{name} must be in {wanted!r} by length_unit, time_unit and density_unit of the file "
            f"(None: no unit may be stated), got the attribute units = {found!r}: convert {name}, "
            "or correct or remove the attribute"
        )


def _plain(unit: str) -> str:
    """A unit without the signs of a product or a power: "m s^-1" becomes "ms-1"."""
    return re.sub(r"[ .*^]", "", unit) or "1"


def check_layout(found: Mapping[str, Any]) -> None:
    """Checks the presence, types and shapes of the datasets.

    Args:
        found: every dataset of the format that a file or a flow has, with its `shape` and `dtype`.
    """
    there = {
        kind: [rule.name for rule in rules if rule.name in found]
        for kind, (_, rules) in RECORDS.items()
    }
    if there[Particles] and there[Flow]:
        raise FlowFileError(
            f"a flow must be on a grid or at particles, got both {there[Flow][0]} and "
            f"{there[Particles][0]}: leave one of them out"
        )
    vectors = Particles if there[Particles] else Flow
    for kind, (_, rules) in RECORDS.items():
        if there[kind] or kind is vectors:
            check_rules(rules, found)


def check_pairs(found: Collection[str]) -> None:
    """Raises FlowFileError if one of two names that come together is missing."""
    for pair in PAIRS:
        if len(lacking := [name for name in pair if name not in found]) == 1:
            raise FlowFileError(
                f"{' and '.join(pair)} must come together, got no {lacking[0]}: add it or leave "
                "both out"
            )


def check_rules(
    rules: Iterable[DatasetRule], found: Mapping[str, Any], hint: str = WRITE_HINT
) -> None:
    """Checks the presence, types and shapes of the datasets of one record.

    Args:
        found: as in `check_layout`.
        hint: what else may be done about a wrong type.
    """
    sizes: dict[str, int] = {}
    for rule in rules:
        if rule.name in found:
            _check_one_layout(rule, found[rule.name], sizes, hint)
        elif rule.required:
            raise FlowFileError(
                f"{rule.name} is missing: expected a dataset {rule.name} {rule}, found "
                f"{', '.join(found) or 'none of the format'}; add it"
                + ", NaN where nothing is known"
                * rule.gaps
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


def _check_one_layout(rule: DatasetRule, dataset: Any, sizes: dict[str, int], hint: str) -> None:
    """Checks one dataset against its rule; `sizes` collects the length of every axis."""
    name, shape, dtype = rule.name, dataset.shape, str(dataset.dtype)
    if dtype not in rule.dtypes or len(shape) != len(rule.axes):
        raise FlowFileError(
            f"{name} must be {rule}, got {dtype} {list(shape)}: convert it or {hint}"
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
