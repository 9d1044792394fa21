"""The grains: two-dimensional disks, and the LAMMPS lines that all scenes share.

Units: mean grain diameter d, mass m of a disk of diameter d, gravity g; so time is in sqrt(d/g).
Diameters are uniform within 15 % of d. Contacts are springs and dashpots with friction
(`gran/hooke/history`): normal stiffness k_n = 4e4 m g/d, tangential 2/7 of it, damping of a
restitution of about 0.5. A grain is solid: its density is 4/pi.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

SPREAD = 0.15  # diameters are uniform in 1 - SPREAD .. 1 + SPREAD
STIFFNESS = 4e4
DAMPING = 138.0
TIME_STEP = 5e-4
MEAN_AREA = math.pi / 4 * (1 + SPREAD**2 / 3)  # of a disk, d^2
GRAIN_DENSITY = 4 / math.pi  # mass of a disk over its area
BULK_FRACTION = 0.80  # solid fraction of a dense flow, for the inertial number and momentum
BULK_DENSITY = BULK_FRACTION * GRAIN_DENSITY
I0 = 0.3  # of the law that is fitted to the shear cells


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


def head(boundary: str) -> str:
    """The first lines of every input: units, dimension, what a grain is."""
    return "\n".join(
        (
            "units lj",
            "dimension 2",
            "atom_style sphere",
            "atom_modify map array",
            f"boundary {boundary}",
            "comm_modify vel yes",
            "newton off",
        )
    )


def diameters(group: str, seed: int) -> str:
    """Draws the diameters of a group and gives its grains the mass of disks."""
    low = 1 - SPREAD
    return (
        f"variable drawn atom {low:g}+{2 * SPREAD:g}*random(0,1,{seed})\n"
        f"set group {group} diameter v_drawn\n"
        f"set group {group} density/disc {GRAIN_DENSITY:.10f}"
    )


def motion(material: Material, group: str = "all") -> str:
    """Contacts, neighbours and the integration of a group of disks."""
    return "\n".join(
        (
            material.pair_style(),
            "neighbor 0.15 bin",
            "neigh_modify delay 0 every 1 check yes",
            f"timestep {TIME_STEP:g}",
            "fix plane all enforce2d",
            f"fix move {group} nve/sphere disc",
        )
    )
