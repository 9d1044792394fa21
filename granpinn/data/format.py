"""The flow file, version 1, as a table of datasets with their shapes and types.

The reader, the writer and the rules all use this table. Axes: T times, Y rows, X columns,
N scattered vectors, n points of the free surface, m points of walls. A file has either the grid or
the particles.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from granpinn.data.flow import PERIOD_X, STEADY, SURFACE_SD, WALL_GAP, WINDOW, Flow, Particles
from granpinn.physics.law_values import PARAMETERS

FORMAT_NAME = "granpinn-flow"
FORMAT_VERSION = 1
MOST_IN_MEMORY = 2**30  # bytes of a flow; a larger one is stored so that it can be used in its file


@dataclass(frozen=True)
class DatasetRule:
    """Shape and types that one dataset may have."""

    name: str
    axes: tuple[str, ...]
    dtypes: tuple[str, ...]
    required: bool = False

    def __str__(self) -> str:
        return f"{' or '.join(self.dtypes)} [{', '.join(self.axes)}]"


@dataclass(frozen=True)
class Layout:
    """Shape and type of a dataset, in a file or in memory."""

    shape: tuple[int, ...]
    dtype: str


_GRID = ("T", "Y", "X")
# A velocity keeps its type: rounded to float32 in other units, it would be another number.
FLOATS = ("float32", "float64")

GRID_DATASETS = (
    DatasetRule("t", ("T",), ("float64",), required=True),
    DatasetRule("y", ("Y",), ("float64",), required=True),
    DatasetRule("x", ("X",), ("float64",), required=True),
    DatasetRule("c", _GRID, ("float32",), required=True),
    DatasetRule("u", _GRID, FLOATS, required=True),
    DatasetRule("v", _GRID, FLOATS, required=True),
    DatasetRule("p", _GRID, ("float32",)),
    DatasetRule("sigma_u", _GRID, ("float32",)),
    DatasetRule("sigma_v", _GRID, ("float32",)),
)
PARTICLES = "particles"
PARTICLE_DATASETS = (
    *(DatasetRule(f"{PARTICLES}/{name}", ("N",), ("float64",), required=True) for name in "txy"),
    *(DatasetRule(f"{PARTICLES}/{name}", ("N",), FLOATS, required=True) for name in "uv"),
    DatasetRule(f"{PARTICLES}/sigma_u", ("N",), ("float32",)),
    DatasetRule(f"{PARTICLES}/sigma_v", ("N",), ("float32",)),
)
SURFACE_DATASETS = (
    DatasetRule("surface_t", ("n",), ("float64", "float32")),
    DatasetRule("surface_x", ("n",), ("float64", "float32")),
    DatasetRule("surface_y", ("n",), ("float64", "float32")),
    DatasetRule("surface_p", ("n",), ("float32", "float64")),
)
WALL_DATASETS = (
    *(DatasetRule(f"wall_{name}", ("m",), ("float64",)) for name in "xyt"),
    *(DatasetRule(f"wall_{name}", ("m",), FLOATS) for name in ("u", "v", "slip", "p", "tau")),
)
DATASETS = (*GRID_DATASETS, *PARTICLE_DATASETS, *SURFACE_DATASETS, *WALL_DATASETS)

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


def arrays_of(flow: Flow) -> dict[str, npt.NDArray[Any]]:
    """The arrays of a flow by the names of their datasets."""
    own = grid_arrays_of(flow) if flow.particles is None else particle_arrays_of(flow.particles)
    own |= _arrays(("t", "x", "y", "p"), "surface_", flow.surface)
    return own | _arrays(("x", "y", "t", "u", "v", "slip", "p", "tau"), "wall_", flow.walls)


def grid_arrays_of(flow: Flow) -> dict[str, npt.NDArray[Any]]:
    """The arrays on the grid, also if it is only a view of particles."""
    names = ("t", "y", "x", "c", "u", "v", "p", "sigma_u", "sigma_v")
    return _arrays(names, "", flow)


def particle_arrays_of(particles: Particles) -> dict[str, npt.NDArray[Any]]:
    """The arrays of particles by the names of their datasets."""
    names = ("t", "x", "y", "u", "v", "sigma_u", "sigma_v")
    return _arrays(names, f"{PARTICLES}/", particles)


def _arrays(names: Iterable[str], prefix: str, holder: Any) -> dict[str, npt.NDArray[Any]]:
    parts = {prefix + name: getattr(holder, name, None) for name in names}
    return {name: part for name, part in parts.items() if isinstance(part, np.ndarray)}
