"""The flow file, version 1, as a table: which datasets it has, of which shape and type.

The reader, the writer and the rules all go by this table. Axes: T times, Y rows, X columns,
n points of the free surface.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from granpinn.data.flow import Flow

FORMAT_NAME = "granpinn-flow"
FORMAT_VERSION = 1


@dataclass(frozen=True)
class DatasetRule:
    """What the format says about one dataset; the first of `dtypes` is the one written."""

    name: str
    axes: tuple[str, ...]
    dtypes: tuple[str, ...]
    required: bool = False


@dataclass(frozen=True)
class Layout:
    """Shape and type of a dataset, in a file or in memory."""

    shape: tuple[int, ...]
    dtype: str


_GRID = ("T", "Y", "X")

DATASETS = (
    DatasetRule("t", ("T",), ("float64",), required=True),
    DatasetRule("y", ("Y",), ("float64",), required=True),
    DatasetRule("x", ("X",), ("float64",), required=True),
    DatasetRule("c", _GRID, ("float32",), required=True),
    DatasetRule("u", _GRID, ("float32",), required=True),
    DatasetRule("v", _GRID, ("float32",), required=True),
    DatasetRule("p", _GRID, ("float32",)),
    DatasetRule("sigma_u", _GRID, ("float32",)),
    DatasetRule("sigma_v", _GRID, ("float32",)),
    DatasetRule("surface_t", ("n",), ("float64", "float32")),
    DatasetRule("surface_x", ("n",), ("float64", "float32")),
    DatasetRule("surface_y", ("n",), ("float64", "float32")),
    DatasetRule("surface_p", ("n",), ("float32", "float64")),
)

# Root attributes with a meaning of their own; all others are kept in Flow.attributes.
NUMBERS = ("density", "grain_diameter")
TEXTS = ("length_unit", "time_unit")
OPTIONAL_NUMBERS = ("eta_max", "eta_min", "sigma_u", "sigma_v")
TRUTH = {"true_mu_s": "mu_s", "true_mu_2": "mu_2", "true_I0": "I0"}
KNOWN_ATTRIBUTES = frozenset(
    ("format_name", "format_version", "gravity", *NUMBERS, *TEXTS, *OPTIONAL_NUMBERS, *TRUTH)
)


def arrays_of(flow: Flow) -> dict[str, npt.NDArray[Any]]:
    """The arrays that a flow holds, by the name of their dataset."""
    surface = flow.surface
    parts: Mapping[str, Any] = {
        **{name: getattr(flow, name) for name in ("t", "y", "x", "c", "u", "v", "p")},
        **{name: getattr(flow, name) for name in ("sigma_u", "sigma_v")},
        **{f"surface_{name}": getattr(surface, name, None) for name in ("t", "x", "y", "p")},
    }
    return {name: part for name, part in parts.items() if isinstance(part, np.ndarray)}
