"""The flow file, version 1, as a table: which datasets it has, of which shape and type.

The reader, the writer and the rules all go by this table. Axes: T times, Y rows, X columns,
N scattered vectors, n points of the free surface. A file has either the grid or the particles.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from granpinn.data.flow import Flow, Particles

FORMAT_NAME = "granpinn-flow"
FORMAT_VERSION = 1


@dataclass(frozen=True)
class DatasetRule:
    """What the format says about one dataset, which may have one of `dtypes`."""

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
# A velocity keeps the type that it has: in other units, float32 is not the same number.
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
DATASETS = (*GRID_DATASETS, *PARTICLE_DATASETS, *SURFACE_DATASETS)

# Root attributes with a meaning of their own; all others are kept in Flow.attributes.
NUMBERS = ("density", "grain_diameter")
TEXTS = ("length_unit", "time_unit")
OPTIONAL_TEXTS = ("density_unit",)
OPTIONAL_NUMBERS = ("eta_max", "eta_min", "sigma_u", "sigma_v", "grain_density")
TRUTH = {"true_mu_s": "mu_s", "true_mu_2": "mu_2", "true_I0": "I0"}
KNOWN_ATTRIBUTES = frozenset(
    (
        *("format_name", "format_version", "gravity"),
        *(*NUMBERS, *TEXTS, *OPTIONAL_TEXTS, *OPTIONAL_NUMBERS, *TRUTH),
    )
)


def arrays_of(flow: Flow) -> dict[str, npt.NDArray[Any]]:
    """The arrays that a flow is made of, by the name of their dataset."""
    own = grid_arrays_of(flow) if flow.particles is None else _particle_arrays_of(flow.particles)
    return own | _arrays(("t", "x", "y", "p"), "surface_", flow.surface)


def grid_arrays_of(flow: Flow) -> dict[str, npt.NDArray[Any]]:
    """The arrays on the grid, also where it is but a view of particles."""
    names = ("t", "y", "x", "c", "u", "v", "p", "sigma_u", "sigma_v")
    return _arrays(names, "", flow)


def _particle_arrays_of(particles: Particles) -> dict[str, npt.NDArray[Any]]:
    names = ("t", "x", "y", "u", "v", "sigma_u", "sigma_v")
    return _arrays(names, f"{PARTICLES}/", particles)


def _arrays(names: Iterable[str], prefix: str, holder: Any) -> dict[str, npt.NDArray[Any]]:
    parts = {prefix + name: getattr(holder, name, None) for name in names}
    return {name: part for name, part in parts.items() if isinstance(part, np.ndarray)}
