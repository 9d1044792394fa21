"""The measured laws of the shear cells: results/truths.json."""

from __future__ import annotations

import json
from pathlib import Path

from bench.studies.grains.materials import DISKS, Material, Shape

PATH = Path(__file__).with_name("results") / "truths.json"
PRESSURE = 20.0  # sigma_yy at which the laws of the scenes were measured


def truth_of(material: Material, shape: Shape = DISKS) -> dict[str, float] | None:
    """mu_s, mu_2 and I0 of a material; None if no shear cell has measured it."""
    cells = json.loads(PATH.read_text(encoding="utf-8"))
    name = f"{'' if shape.dimension == 2 else 'spheres_'}{material.name}_{PRESSURE:g}"
    found: dict[str, float] | None = cells.get(name, {}).get("law")
    return found
