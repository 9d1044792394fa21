"""The measured laws of the shear cells, from results/truth_FRICTION_PRESSURE.json, of spheres from
results/truth_spheres_FRICTION_PRESSURE.json."""

from __future__ import annotations

import json
from pathlib import Path

from bench.studies.grains.materials import DISKS, Material, Shape

RESULTS = Path(__file__).with_name("results")
PRESSURE = 20.0  # at which the law of the scenes is measured


def truth_of(
    material: Material, pressure: float = PRESSURE, shape: Shape = DISKS
) -> dict[str, float] | None:
    """mu_s, mu_2 and I0 of a material; None if its shear cell has not been run."""
    path = (
        RESULTS
        / f"truth_{'' if shape.dimension == 2 else 'spheres_'}{material.name}_{pressure:g}.json"
    )
    if not path.exists():
        return None
    law: dict[str, float] = json.loads(path.read_text())["law"]
    return law
