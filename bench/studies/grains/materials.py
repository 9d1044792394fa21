"""The grains, disks in two dimensions or spheres, and the LAMMPS lines that all scenes share.

Units: mean grain diameter d, mass m of a grain of diameter d, gravity g; so time is in sqrt(d/g).
Diameters are uniform within 15 % of d. Contacts are springs and dashpots with friction
(`gran/hooke/history`): normal stiffness k_n = 4e4 m g/d, tangential 2/7 of it, damping of a
restitution of about 0.5. A grain is solid: the density of a disk is 4/pi, of a sphere 6/pi.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path

SPREAD = 0.15  # diameters are uniform in 1 - SPREAD .. 1 + SPREAD
STIFFNESS = 4e4
DAMPING = 138.0
TIME_STEP = 5e-4
MEAN_AREA = math.pi / 4 * (1 + SPREAD**2 / 3)  # of a disk, d^2
GRAIN_DENSITY = 4 / math.pi  # mass of a disk over its area
BULK_FRACTION = 0.80  # of a dense flow of disks, for the inertial number and momentum
BULK_DENSITY = BULK_FRACTION * GRAIN_DENSITY
I0 = 0.3  # of the law that is fitted to the shear cells


@dataclass(frozen=True)
class Shape:
    """Disks or spheres.

    Attributes:
        dimension: 2 or 3.
        density: mass of a grain over its area or volume.
        fraction: solid fraction of a dense flow, for the inertial number and momentum.
    """

    dimension: int
    density: float
    fraction: float

    @property
    def bulk_density(self) -> float:
        """Density of a dense flow."""
        return self.fraction * self.density

    @property
    def set_density(self) -> str:
        """Gives the grains their masses."""
        keyword = "density/disc" if self.dimension == 2 else "density"
        return f"set atom * {keyword} {self.density:.10f}"


DISKS = Shape(2, GRAIN_DENSITY, BULK_FRACTION)
SPHERES = Shape(3, 6 / math.pi, 0.60)


@dataclass(frozen=True)
class Material:
    """Grains of one friction coefficient between them."""

    friction: float

    @property
    def name(self) -> str:
        return f"{self.friction:g}"

    def pair_style(self) -> str:
        """Contacts between all grains, glued ones too."""
        return (
            f"pair_style gran/hooke/history {STIFFNESS:g} NULL {DAMPING:g} NULL "
            f"{self.friction:g} 1\npair_coeff * *"
        )

    def wall(self, friction: float) -> str:
        """The contact law of a flat wall (`fix wall/gran`)."""
        return f"hooke/history {STIFFNESS:g} NULL {DAMPING:g} NULL {friction:g} 1"


FRICTIONS = (0.2, 0.4, 0.7)
TRUTHS = Path(__file__).with_name("results") / "truths.json"  # the laws that shear cells measured
PRESSURE = 20.0  # sigma_yy at which the laws of the scenes were measured


def truth_of(material: Material, shape: Shape = DISKS) -> dict[str, float] | None:
    """mu_s, mu_2 and I0 of a material; None if no shear cell has measured it."""
    cells = json.loads(TRUTHS.read_text(encoding="utf-8"))
    name = f"{'' if shape.dimension == 2 else 'spheres_'}{material.name}_{PRESSURE:g}"
    found: dict[str, float] | None = cells.get(name, {}).get("law")
    return found


def head(shape: Shape, boundary: str) -> str:
    """The first lines of every input: units, dimension, what a grain is."""
    return f"""units lj
dimension {shape.dimension}
atom_style sphere
atom_modify map array
boundary {boundary}
comm_modify vel yes
newton off"""


def motion(shape: Shape, material: Material) -> str:
    """Contacts, neighbours and the integration of the free grains."""
    flat = shape.dimension == 2
    return f"""{material.pair_style()}
neighbor 0.15 bin
neigh_modify delay 0 every 1 check yes
timestep {TIME_STEP:g}
{"fix plane all enforce2d" if flat else ""}
fix move free nve/sphere{" disc" if flat else ""}"""
