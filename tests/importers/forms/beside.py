"""What is given beside the vectors: files of times, surface and walls, masks, settings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from granpinn.importers import Validity
from tests.importers import scene
from tests.importers.forms import physical
from tests.importers.forms.form import FLOAT64, Family, Given, odd, plain
from tests.importers.forms.memory import in_file, without_vectors
from tests.importers.forms.texts import METERS, PIXELS, given, style, styles, view


def vectors(units: str, up: bool, time: str, gone: str = "nan nan") -> dict[str, Any]:
    """The scene as arrays in memory."""
    seen = view(units, up)
    arrays = without_vectors(in_file(units, up, time, False), gone)
    named = {"length_unit": seen.x, "velocity_unit": seen.u, "time_unit": time}
    return arrays | named | {"y_down": not up}


def table(path: Path, columns: list[tuple[str, Any]], **style: Any) -> str:
    """A table of titles and numbers or text; without titles if they are empty."""
    cells = [[v if isinstance(v, str) else f"{v:.10g}" for v in a] for _, a in columns]
    names = [title for title, _ in columns if title]
    scene.write_table(path, [], names, list(zip(*cells, strict=True)), **style)
    return str(path)


def titled(name: str, unit: str, brackets: str) -> str:
    return f"{name} {brackets[0]}{unit}{brackets[1]}" if unit and brackets else name


def times(
    folder: Path,
    columns: str,
    brackets: str,
    unit: str,
    word: str,
    rows: str,
    stated: str,
    dialect: str,
) -> Given | None:
    bare = not brackets
    if bare and columns not in ("t", "frame t"):
        return None
    if rows and "frame" not in columns:
        return None
    t = physical.T / scene.SI[unit]
    known = {
        "t": (titled(word, unit, brackets), t),
        "frame": ("frame", np.arange(scene.FRAMES)),
        "delay": (titled("delay", "us", brackets), 10 * (1 + np.arange(scene.FRAMES))),
        "note": ("note", ["a", "b", "c"]),
    }
    order = slice(None, None, -1 if rows else 1)
    parts = [known[name] for name in columns.split()]
    parts = [("" if bare else title, values[order]) for title, values in parts]
    path = table(folder / "times.txt", parts, **style(dialect))
    data = vectors(METERS, True, "frame") | {"time_unit": stated}
    if not stated:
        del data["time_unit"]
    # Numbers without a unit are not those of the counted frames.
    settings = {"times": path} | ({"time_unit": unit} if bare and not stated else {})
    return given(data, physical.flow(), settings)


def surface(
    folder: Path,
    units: str,
    time: str,
    own: str,
    own_time: str,
    up: bool,
    names: str,
    extra: str,
    order: str,
    dialect: str,
) -> Given:
    seen, line = view(units, up), physical.surface_line()
    shown = replace(seen, x=own.split()[0], y=own.split()[1]) if own else seen
    x, y = physical.in_view(line.x, line.y, shown)
    name, _, unit = own_time.partition(" ")
    frame = np.rint((line.t - physical.T[0]) / scene.SI["frame"])
    counted = "frame" in (name, unit or time)
    t = frame if counted else line.t / scene.SI[unit or time]
    titles = [titled(name, unit, "[]")]
    titles += [
        titled(n, u if own else "", "[]") for n, u in zip("xy", own.split() or "  ", strict=True)
    ]
    titles = [t.upper() if names == "capitals" else t for t in titles]
    columns = list(zip(titles, (t, x, y), strict=True))
    if extra:
        columns.append((extra, ["a"] * t.size if extra == "note" else np.full(t.size, 7.5)))
    path = table(folder / "line.csv", columns, order=order, **style(dialect))
    return given(vectors(units, up, time), physical.flow(line=True), {"surface": path})


def walls(
    folder: Path,
    units: str,
    time: str,
    own: str,
    up: bool,
    columns: str,
    gap: str,
    pressure: str,
    order: str,
    dialect: str,
) -> Given | None:
    truth, seen = physical.walls(), view(units, up)
    stated = dict(zip("xyuv", own.split(), strict=False))
    shown = replace(seen, **stated)
    x, y = physical.in_view(truth.x, truth.y, shown)
    numbers = {"x": x, "y": y, "slip": truth.slip, "p": truth.p}
    sign = 1 if up else -1
    numbers["u"] = truth.u / scene.si(shown.u)
    numbers["v"] = sign * truth.v / scene.si(shown.v)
    kept = columns.split()
    if len(order) > len(kept):
        return None
    flow = replace(truth, **{n: None for n in numbers if n not in kept})
    made = []
    for name in kept:
        unit, values = stated.get(name, ""), numbers[name]
        if name == "p" and pressure:
            unit, values = pressure, values / (1e3 if pressure == "kPa" else 1.0)
        cells = [gap if np.isnan(v) else f"{v:.10g}" for v in values]
        made.append((titled(name, unit, "[]"), cells))
    path = table(folder / "walls.csv", made, order=order, **style(dialect))
    expected = physical.flow(walls=flow)
    return given(vectors(units, up, time), expected, {"walls": path})


def mask(folder: Path, kind: str, up: bool, images: str) -> Given | None:
    """Images of 90 x 80 px, in which every vector is the center of a square of 8 px."""
    suffix, mode, dark, bright = kind.split()
    inside = scene.codes() != Validity.MASKED
    for k in range(scene.FRAMES if images == "each" else 1):
        squares = np.kron(inside[k], np.ones((8, 8), bool))
        picture = np.zeros((80, 90), bool)
        picture[20 : 20 + squares.shape[0], 12 : 12 + squares.shape[1]] = squares
        image = drawn(np.where(picture, int(bright), int(dark)), picture, mode)
        image.save(folder / f"m{k}.{suffix}")
    data = vectors(PIXELS, False, "frame")
    u, v = (np.where(inside, data[n], a) for n, a in zip("uv", scene.velocity(), strict=True))
    data |= {"u": u, "v": v}
    if up:  # pixels that count from the lower edge of the image
        data |= {"y": 79 - data["y"], "v": -v, "y_down": False}
    origin = {"origin": "16,7"} if up else {}
    return given(data, physical.flow(), {"mask": str(folder / "m*")} | origin, FLOAT64)


def drawn(levels: Any, picture: Any, mode: str) -> Image.Image:
    if mode == "I;16":
        return Image.fromarray(levels.astype(np.uint16))
    if mode == "1":
        return Image.fromarray(picture)
    grey = Image.fromarray(levels.astype(np.uint8))
    if mode == "alpha":  # white everywhere, and transparent where there are no grains
        white = Image.new("RGB", grey.size, "white")
        white.putalpha(Image.fromarray(np.where(picture, 255, 0).astype(np.uint8)))
        return white
    return grey.convert(mode) if mode != "P" else grey.convert("RGB").quantize(16)


TILTS = {"0 deg": 0.0, "1.2 deg": 1.2, "0.02094395102393195 rad": 1.2, "-3 °": -3.0}


def settings(folder: Path, tilt: str, origin: str, up: bool, **given_settings: str | None) -> Given:
    """Numbers with units, as text."""
    data = vectors(PIXELS, up, "frame")
    named = {name: text for name, text in given_settings.items() if text is not None}
    if origin:
        x0, y0 = (float(part) for part in origin.split(","))
        data["x"] = data["x"] - data["x"].min() + x0
        data["y"] = data["y"] - (data["y"].min() if up else data["y"].max()) + y0
        named["origin"] = origin
    angle = np.radians(TILTS[tilt])
    gravity = (physical.G * np.sin(angle), -physical.G * np.cos(angle))
    attributes = {"wall_gap": 0.001} if "wall_gap" in named else {}
    flow = physical.flow(gravity=gravity, attributes=attributes)
    if "sigma" in named:
        flow = replace(flow, sigma_u=0.025, sigma_v=0.025)
    return given(data, flow, {"tilt": tilt, **named}, FLOAT64)


FAMILIES = {
    "--times": Family(
        times,
        {
            "columns": plain("t", "frame t", "t frame", "t delay", "delay t", "frame t note"),
            "brackets": plain("[]", "()", ""),
            "unit": plain("s", "ms"),
            "word": plain("t", "time", "Time") | odd("Zeit"),
            "rows": plain("", "last first"),
            "stated": plain("") | odd("frame", "frames"),
            "dialect": styles(",", ";", "tab", comma=False),
        },
    ),
    "--surface": Family(
        surface,
        {
            "units": plain(METERS, PIXELS),
            "time": plain("s", "frame"),
            "own": plain("", "m m", "px px", "mm px", "m mm"),
            "own_time": plain("t s", "t ms", "t") | odd("frame", "t frame"),
            "up": plain(True, False),
            "names": plain("small") | odd("capitals"),
            "extra": plain("", "p", "note"),
            "order": plain("", "12"),
            "dialect": styles(",", ";", "tab", quoted=True),
        },
    ),
    "--walls": Family(
        walls,
        {
            "units": plain(METERS, PIXELS),
            "time": plain("s", "frame"),
            "own": plain("", "m m m/s m/s", "mm mm mm/s mm/s", "mm px m/s mm/s"),
            "up": plain(True, False),
            "columns": plain("x y u v slip p", "x y", "x y slip"),
            "gap": plain("nan", "", "NaN"),
            "pressure": plain("", "Pa", "kPa"),
            "order": plain("", "10", "3210"),
            "dialect": styles(",", ";", "tab", quoted=True),
        },
    ),
    "--mask": Family(
        mask,
        {
            "kind": plain("png L 0 255", "png L 3 200", "png L 0 1", "png 1 0 1", "png RGB 0 255")
            | plain("png LA 3 200", "png P 0 255", "tif L 0 255", "bmp L 0 255", "gif L 0 255")
            | plain("png I;16 768 51200", "tif I;16 100 4000", "tif I;16 0 65535", "jpg L 0 255")
            | odd("png alpha 0 255"),
            "up": plain(False, True),
            "images": plain("each", "one"),
        },
    ),
    "settings": Family(
        settings,
        {
            "tilt": plain(*TILTS),
            "origin": plain("", "37,11", "-8.5,1e3"),
            "up": plain(False, True),
            "scale": plain("0.5 mm/px", "2 px/mm", "500 um/px") | odd("0,5 mm/px"),
            "frame_rate": plain("500 Hz", "2 ms", "0.5 kHz", "500 fps", "500 1/s") | odd("2"),
            "pulse_delay": plain(None, "2 ms", "2000 µs"),
            "start": plain(None, "1 ms", "0.001 s"),
            "grain_diameter": plain("2 mm", "0.2 cm", "2e-3 m") | odd("2,0 mm", "4 px"),
            "gravity": plain("9.81 m/s^2", "981 cm/s**2") | odd("9,81 m/s^2", "9.81"),
            "sigma": plain(None, "25 mm/s", "0.1 px/frame", "50 px/s") | odd("0.1 px"),
            "wall_gap": plain(None, "1 mm", "0.1 cm") | odd("2 px"),
        },
    ),
}
