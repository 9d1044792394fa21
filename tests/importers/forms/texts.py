"""Text of PIVlab, OpenPIV, DaVis and Basilisk."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from granpinn.importers import read
from tests.importers import scene
from tests.importers.forms import physical
from tests.importers.forms.form import TEXT, Axis, Family, Given, odd, plain
from tests.importers.test_other_piv import davis, openpiv
from tests.importers.test_pivlab_text import export
from tests.importers.test_simulation_files import basilisk

METERS = "m m m/s m/s"
PIXELS = "px px px/frame px/frame"
MIXED = odd("m mm m/s m/s", "m m m/s mm/s")
MIXED |= odd("m px m/s m/s", "m m px/frame m/s", "mm px m/s px/s")
SEPARATORS = {",": ",", "comma blank": ", ", ";": ";", "tab": "\t", "blank": " "}
ENDS: dict[str, dict[str, str]] = {
    "": {},
    "cr lf": {"newline": "\r\n"},
    "cr": {"newline": "\r"},
    "mark": {"mark": "\ufeff"},
    "quoted": {"quote": '"'},
}


def styles(*readable: str, quoted: bool = False, comma: bool = True) -> Axis:
    """Styles of a table: separator, decimal sign, ends of lines, mark, and quotes.

    Args:
        readable: separators with points that granpinn must read, the usual one first.
        quoted: whether it must read cells in quotes.
        comma: whether it must read decimal commas between semicolons and tabs.
    """
    ends = [f"{readable[0]} . {end}" for end in ENDS if end]
    axis = plain(*(f"{name} ." for name in readable))
    axis |= {style: quoted or not style.endswith("quoted") for style in ends}
    axis |= {"; ,": comma, "tab ,": comma}
    others = (f"{name} {sign}" for sign in ",." for name in SEPARATORS)
    return axis | odd(*(style for style in others if style not in axis))


def style(name: str) -> dict[str, str]:
    """The arguments of `scene.write_table` for a style."""
    separator, sign, end = re.fullmatch(r"(.+) ([,.]) ?(.*)", name).groups()  # type: ignore[union-attr]
    return {"delimiter": SEPARATORS[separator], "decimal": sign, **ENDS[end]}


def view(units: str, up: bool) -> scene.View:
    return scene.View(*units.split(), up=up)


def series(folder: Path, write: Callable[..., Path], dialect: str, **options: Any) -> list[Path]:
    """One file for each frame."""
    return [
        write(folder / f"a{k}.txt", k, **style(dialect), **options) for k in range(scene.FRAMES)
    ]


def given(files: Any, flow: Any, settings: dict[str, Any], rounding: float = TEXT) -> Given:
    return Given(partial(read, files, **(physical.SETTINGS | settings)), flow, rounding)


def pivlab(
    folder: Path, units: str, up: bool, info: bool, types: bool, order: str, gone: str, **more: Any
) -> Given | None:
    if not types and (gone in ("0", "9e9") or "4" in order):
        return None
    if not gone and "blank" in more["dialect"]:
        return None
    options = {"view": view(units, up), "info": info, "types": types, "gone": gone}
    return given(series(folder, export, order=order, **options, **more), physical.flow(), {})


def openpiv_text(folder: Path, units: str, up: bool, gone: str, order: str, **more: Any) -> Given:
    seen = view(units, up)
    files = series(folder, openpiv, view=seen, gone=gone, order=order, **more)
    return given(files, physical.flow(), {"length_unit": seen.x, "velocity_unit": seen.u})


def line_file(path: Path, seen: scene.View) -> str:
    """The free surface, for files that do not say where there are no grains."""
    line = physical.surface_line()
    x, y = physical.in_view(line.x, line.y, seen)
    rows = [scene.text(*row) for row in zip(line.t, x, y, strict=True)]
    scene.write_table(path, [], ["t [s]", f"x [{seen.x}]", f"y [{seen.y}]"], rows)
    return str(path)


def davis_text(folder: Path, units: str, up: bool, **more: Any) -> Given | None:
    seen = view(units, up)
    if not up and "frame" not in seen.u:  # in physical units y points up
        return None
    return given(series(folder, davis, view=seen, **more), physical.flow(), {})


def basilisk_text(folder: Path, units: str, fields: str, whole: float, **more: Any) -> Given:
    options = {"view": scene.View(*METERS.split(), up=True), "fields": fields, "whole": whole}
    files = series(folder, basilisk, **options, **more)
    for path, t in zip(files, physical.T, strict=True):
        path.rename(folder / f"out-{t:.3f}.txt")
    settings: dict[str, Any] = {"times": "name"}
    flow = physical.flow(gaps=False, fraction=True)
    if units != "none":
        length, velocity = units.split()
        more = {"length_unit": length, "velocity_unit": velocity, "time_unit": "s"}
        return given(folder, flow, settings | more)
    plain_numbers = {"gravity": "9.81", "grain_diameter": "0.002", "density": "1500"}
    settings |= plain_numbers | {"grain_density": "2500", "dimensionless": True}
    return Given(lambda: read(folder, **settings), physical.without_units(flow), TEXT)


FAMILIES = {
    "PIVlab text": Family(
        pivlab,
        {
            "units": plain(PIXELS, METERS) | MIXED | odd("mm mm mm/s mm/s"),
            "up": plain(False, True),
            "info": plain(True, False),
            "types": plain(True, False),
            "gone": plain("NaN", "0", "", "9e9"),
            "order": plain("", "10", "0132", "4", "01423"),
            "derivatives": plain(False, True),
            "dialect": styles(",", "tab", "blank"),
        },
    ),
    "OpenPIV text": Family(
        openpiv_text,
        {
            "units": plain(PIXELS, METERS, "mm mm mm/s mm/s", "px px px/s px/s"),
            "up": plain(False, True),
            "gone": plain("0.0", "nan", "", "9e9"),
            "order": plain("", "10", "0132", "4"),
            "dialect": styles("tab", "blank"),
        },
    ),
    "DaVis text": Family(
        davis_text,
        {
            "units": plain("mm mm m/s m/s", METERS, "px px px/frame px/frame") | MIXED,
            "up": plain(True, False),
            "gone": plain("0", "NaN"),
            "dialect": plain("tab ,", "tab .", "; .", "; ,", "blank .", ", .") | odd("blank ,"),
        },
    ),
    "Basilisk": Family(
        basilisk_text,
        {
            "units": plain("m m/s", "none"),
            "fields": plain("f p u.x u.y", "u.x u.y f", "p c u.y u.x", "q u.x f u.y"),
            "whole": plain(1.0) | odd(100.0, 255.0),
            "outside": plain("inf", "1e+30", "nan"),
            "rows_first": plain(False, True),
            "dialect": styles("blank", "tab") | odd("blank . mark"),
        },
    ),
}
