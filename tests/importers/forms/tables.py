"""Tables of tracked particles, with velocities or as positions of linked tracks."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.data import Particles
from tests.importers import scene
from tests.importers.forms import physical
from tests.importers.forms.form import TEXT, Family, Given, odd, plain
from tests.importers.forms.texts import METERS, MIXED, PIXELS, given, style, styles, view

# A few grains far apart show no free surface.
UP = {up: {"flip_y": flip, "surface": "none"} for up, flip in ((True, "no"), (False, "yes"))}
N_FRAMES, EP = 7, 1e-4
DIFFERENCE = 100 * TEXT  # a velocity is a small difference of positions
NAMES: dict[str, dict[str, str]] = {
    "plain": {},
    "capitals": {"x": "X", "y": "Y", "u": "U", "v": "V", "t": "Time"},
    "vx vy": {"u": "vx", "v": "vy", "sigma_u": "sigma_vx", "sigma_v": "sigma_vy"},
    "TrackMate": {
        **{"x": "POSITION_X", "y": "POSITION_Y", "frame": "FRAME"},
        **{"particle": "TRACK_ID"},
    },
}


def title(name: str, unit: str, names: str, brackets: str) -> str:
    shown = NAMES[names].get(name, name)
    return f"{shown} {brackets[0]}{unit}{brackets[1]}" if unit and brackets else shown


def write(
    path: Path,
    columns: dict[str, Any],
    units: dict[str, str],
    names: str,
    brackets: str,
    **style: Any,
) -> Path:
    """A table in CSV; NaN is an empty cell."""
    titles = [title(name, units.get(name, ""), names, brackets) for name in columns]
    values = [["" if np.isnan(v) else f"{v:.10g}" for v in part] for part in columns.values()]
    return scene.write_table(path, [], titles, list(zip(*values, strict=True)), **style)


def velocities(
    folder: Path,
    units: str,
    time: str,
    up: bool,
    names: str,
    brackets: str,
    order: str,
    gone: str,
    sigma: str,
    dialect: str,
) -> Given | None:
    seen = view(units, up)
    if not brackets and (units in MIXED or sigma):
        return None
    columns = physical.columns(view=seen)
    columns["t"] = columns["t"] / scene.SI[time] if time != "frame" else columns["t"]
    del columns["t" if time == "frame" else "frame"]
    named = dict(zip("xyuv", seen.units, strict=True)) | {"t": time}
    flow = physical.scattered()
    if sigma:
        spread = 0.01 + 1e-4 * np.arange(columns["x"].size)
        own = (seen.u, seen.v) if sigma == "like u v" else sigma.split()
        for name, unit in zip(("sigma_u", "sigma_v"), own, strict=True):
            columns[name], named[name] = spread / scene.si(unit), unit
        found = {"sigma_u": spread.astype(np.float32), "sigma_v": spread.astype(np.float32)}
        assert flow.particles is not None
        flow = physical.of_particles(Particles(**(vars(flow.particles) | found)))
    if gone:  # a row without a velocity
        more = {name: np.nan if name in ("u", "v") else a[0] for name, a in columns.items()}
        columns = {name: np.append(a, more[name]) for name, a in columns.items()}
    write(folder / "a.csv", columns, named, names, brackets, order=order, **style(dialect))
    settings = UP[up] | ({"start": "1 ms"} if time == "frame" else {})
    if not brackets:
        settings |= {"length_unit": seen.x, "velocity_unit": seen.u}
        settings |= {} if time == "frame" else {"time_unit": time}
    return given(folder / "a.csv", flow, settings)


def linked(
    folder: Path,
    units: str,
    time: str,
    up: bool,
    names: str,
    ep: str,
    order: str,
    dialect: str,
) -> Given | None:
    """Grains that start like the scene and speed up; the parabolas are fitted here once more."""
    seen = view(f"{units} m/s m/s", up)
    settings = UP[up] | ({"start": "1 ms"} if time == "frame" else {})
    if not up:  # the lowest grain has moved
        settings["origin"] = ",".join(scene.text(seen.axes()[0][0], seen.axes()[1][-1]))
    positions, particles = tracks()
    columns = dict(positions)
    columns["x"], columns["y"] = physical.in_view(columns["x"], columns["y"], seen)
    named = {"x": seen.x, "y": seen.y, "t": time}
    columns["t"] = columns["t"] / scene.SI[time] if time != "frame" else columns["t"]
    del columns["t" if time == "frame" else "frame"]
    if ep:
        columns["ep"], named["ep"] = np.full(columns["x"].size, EP / scene.si(ep)), ep
        flow = physical.of_particles(particles)
    else:
        settings["sigma"] = "0.01 m/s"
        particles = replace(particles, sigma_u=None, sigma_v=None)
        flow = physical.of_particles(particles, sigma_u=0.01, sigma_v=0.01)
    path = folder / "a.csv"
    options = {"names": names, "brackets": "[]", "order": order, **style(dialect)}
    write(path, columns, named, **options)
    return given(path, flow, settings, DIFFERENCE)


@cache
def tracks() -> tuple[dict[str, Any], Particles]:
    """Positions of all tracks, and what parabolas over five frames make of them."""
    t = physical.T[0] + scene.SI["frame"] * np.arange(N_FRAMES)
    start = physical.columns()
    first = start["frame"] == 0
    since = (t - t[0])[:, None]
    places = {
        "x": start["x"][first] + start["u"][first] * since + 2e3 * since**3,
        "y": start["y"][first] + start["v"][first] * since - 3e3 * since**3,
    }
    frame, particle = np.indices(places["x"].shape)
    fitted = {name: np.empty(frame.shape) for name in ("x", "y", "u", "v")}
    sigma = np.empty(frame.shape)
    for k in range(N_FRAMES):
        near = slice(max(k - 2, 0), k + 3)
        matrix = (t[near] - t[k])[:, None] ** np.arange(3)
        for name, speed in (("x", "u"), ("y", "v")):
            fit = np.linalg.lstsq(matrix, places[name][near], rcond=None)[0]
            fitted[name][k], fitted[speed][k] = fit[:2]
        sigma[k] = EP * np.sqrt(np.linalg.inv(matrix.T @ matrix)[1, 1])
    columns = {**places, "frame": frame, "t": t[frame], "particle": particle}
    parts = {name: a.ravel() for name, a in fitted.items()}
    spread = sigma.ravel().astype(np.float32)
    particles = Particles(t=t[frame].ravel(), **parts, sigma_u=spread, sigma_v=spread)
    return {name: a.ravel() for name, a in columns.items()}, particles


FAMILIES = {
    "tracks with velocities": Family(
        velocities,
        {
            "units": plain(METERS, PIXELS, "mm mm mm/s mm/s") | MIXED,
            "time": plain("s", "ms", "frame"),
            "up": plain(True, False),
            "names": plain("plain", "capitals", "vx vy"),
            "brackets": plain("[]", "()", ""),
            "order": plain("", "10", "0132", "4321"),
            "gone": plain("", "row"),
            "sigma": plain("", "like u v") | odd("m/s mm/s", "px/frame px/frame"),
            "dialect": styles(",", ";", "tab", quoted=True),
        },
    ),
    "linked tracks": Family(
        linked,
        {
            "units": plain("px px", "m m", "mm mm") | odd("mm m", "m px"),
            "time": plain("frame", "s", "ms"),
            "up": plain(False, True),
            "names": plain("plain", "capitals", "TrackMate"),
            "ep": plain("") | odd("m", "mm", "px"),
            "order": plain("", "10", "32"),
            "dialect": styles(",", ";", "tab", quoted=True),
        },
    ),
}
