"""VTK files of every kind, and an OpenFOAM case."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tests.importers import scene
from tests.importers.forms import physical
from tests.importers.forms.form import FLOAT32, FLOAT64, TEXT, Family, Given, odd, plain
from tests.importers.forms.texts import METERS, PIXELS, given, view
from tests.importers.test_meshes import foam_case, mesh

ROUNDINGS = {"f8": FLOAT64, "f4": FLOAT32}


def settings_of(units: str, up: bool, time: str) -> dict[str, Any]:
    """What a mesh does not say."""
    seen = view(units, up)
    settings = {"length_unit": seen.x, "velocity_unit": seen.u, "flip_y": "no" if up else "yes"}
    return settings | ({"times": "name", "time_unit": "s"} if time == "name" else {})


def vtk(
    folder: Path, kind: str, at: str, units: str, up: bool, store: str, time: str, whole: float
) -> Given | None:
    suffix, _, ascii_text = kind.partition(" ")
    if suffix == "vtp" and at == "cells":
        return None
    fraction = whole > 0
    options: dict[str, Any] = {"kind": suffix, "at": at, "whole": whole if fraction else None}
    for k, t in enumerate(physical.T):
        made = mesh(k, view(units, up), **options)
        if store == "f4" and hasattr(made, "points") and suffix in ("vtu", "vtk", "vtp", "vts"):
            made.points = made.points.astype(np.float32)
        data = made.cell_data if at == "cells" else made.point_data
        for name in data:
            data[name] = data[name].astype(store)
        if time == "TimeValue":
            made.field_data["TimeValue"] = [t]
        made.save(folder / f"a-{t:.3f}.{suffix}", binary=not ascii_text)
    flow = physical.flow(gaps=not fraction, fraction=fraction)
    rounding = max(ROUNDINGS[store], TEXT if ascii_text else 0.0)  # VTK writes ten digits
    return given(folder, flow, settings_of(units, up, time), rounding)


def foam(folder: Path, units: str, up: bool, whole: float) -> Given:
    seen = view(units, up)
    x, y = (np.sort(axis) for axis in seen.axes())
    upwards = slice(None, None, -1 if up else 1)
    edges = [np.append(a - (a[1] - a[0]) / 2, a[-1] + (a[1] - a[0]) / 2) for a in (x, y)]
    frames = {}
    for k, t in enumerate(physical.T):
        u, v = (a[k][upwards].ravel() for a in seen.velocity())
        c = whole * scene.fraction()[k][upwards].ravel()
        velocity = [f"({' '.join(scene.text(*pair))} 0)" for pair in zip(u, v, strict=True)]
        frames[f"{t:g}"] = velocity, scene.text(*c)
    case = foam_case(folder / "case", frames, *edges)
    flow = physical.flow(gaps=False, fraction=True)
    # VTK keeps the points and fields of OpenFOAM as float32.
    return given(case, flow, settings_of(units, up, ""), FLOAT32)


UNITS = plain(METERS, PIXELS, "mm mm cm/s cm/s")
FAMILIES = {
    "VTK": Family(
        vtk,
        {
            "kind": plain("vti", "vtr", "vts", "vtu", "vtk", "vtp", "vtk ascii"),
            "at": plain("points", "cells"),
            "units": UNITS,
            "up": plain(True, False),
            "store": plain("f8", "f4"),
            "time": plain("TimeValue", "name"),
            "whole": plain(0.0, 1.0) | odd(100.0, 255.0),
        },
    ),
    "OpenFOAM": Family(
        foam, {"units": UNITS, "up": plain(True, False), "whole": plain(1.0) | odd(100.0)}
    ),
}
