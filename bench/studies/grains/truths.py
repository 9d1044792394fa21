"""The measured laws of the shear cells: results/truths.json, written by shear_cell.py."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from bench.studies.grains.materials import DISKS, Material, Shape

PATH = Path(__file__).with_name("results") / "truths.json"
PRESSURE = 20.0  # at which the law of the scenes is measured


def name_of(material: Material, pressure: float, shape: Shape) -> str:
    """The name of a shear cell in the file."""
    return f"{'' if shape.dimension == 2 else 'spheres_'}{material.name}_{pressure:g}"


def truth_of(
    material: Material, pressure: float = PRESSURE, shape: Shape = DISKS
) -> dict[str, float] | None:
    """mu_s, mu_2 and I0 of a material; None if its shear cell has not been run."""
    found = read(PATH).get(name_of(material, pressure, shape))
    return None if found is None else found["law"]


def read(path: Path) -> dict[str, Any]:
    """All shear cells of a file, by their names; none if there is no file."""
    if not path.exists():
        return {}
    cells: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return cells
