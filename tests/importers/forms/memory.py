"""Arrays in .npz, in a mapping, and in memory: NumPy, masked arrays, torch, pandas, lists."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch

import granpinn
from granpinn.data import Flow, Particles
from granpinn.importers import Validity, read
from tests.importers import scene
from tests.importers.forms import physical
from tests.importers.forms.form import FLOAT16, FLOAT32, FLOAT64, Family, Given, odd, plain
from tests.importers.forms.texts import METERS, PIXELS, view

ROUNDINGS = {"f8": FLOAT64, "f4": FLOAT32, "f2": FLOAT16}
AXES = {"t": 0, "y": 1, "x": 2}
ON_GRID = ("u", "v", "c", "mask", "validity", "sigma_u", "sigma_v")


def in_file(units: str, up: bool, time: str, fraction: bool) -> dict[str, Any]:
    """t, y, x, u, v and the kinds of vectors in the units of a file, rows from the top."""
    seen = view(units, up)
    x, y = seen.axes()
    u, v = seen.velocity()
    t = np.arange(float(scene.FRAMES)) if time == "frame" else physical.T / scene.SI[time]
    codes, c = scene.codes(), scene.fraction()
    codes = np.where(fraction & (c < 1), Validity.VALID, codes)  # a simulation has air
    return {"t": t, "y": y, "x": x, "u": u, "v": v, "validity": codes}


def without_vectors(arrays: dict[str, Any], gone: str) -> dict[str, Any]:
    """u and v with `gone` where there is no vector: "STATEMENT FILL"."""
    statement, _, fill = gone.partition(" ")
    codes = arrays.pop("validity")
    lost = codes != Validity.VALID
    filled = {name: np.where(lost, float(fill or "nan"), arrays[name]) for name in "uv"}
    if statement == "validity":
        return arrays | filled | {"validity": codes}
    if statement == "mask":
        outside = codes == Validity.MASKED
        filled = {n: np.where(lost & ~outside, np.nan, values) for n, values in filled.items()}
        return arrays | filled | {"mask": outside}
    if statement == "masked":
        return arrays | {n: np.ma.array(values, mask=lost) for n, values in filled.items()}
    if statement == "u":
        del filled["v"]
    if statement == "None":
        return arrays | {n: np.where(lost, None, arrays[n]) for n in "uv"}
    return arrays | filled


def stored(values: Any, store: str) -> Any:
    """An array in another type or layout."""
    dtype, _, layout = store.partition(" ")
    if np.asarray(values).dtype.kind != "f":
        return values
    with np.errstate(over="ignore"):  # what float16 does not hold is infinite
        values = values.astype(dtype)
    if layout == "F":
        return values.copy(order="F")
    return values.repeat(2, axis=-1)[..., ::2] if layout == "strided" else values


def reversed_along(arrays: dict[str, Any], names: str) -> dict[str, Any]:
    """The same grid with axes in descending order."""
    found = dict(arrays)
    for name in names:
        found[name] = found[name][::-1]
        for grid in set(ON_GRID) & found.keys():
            found[grid] = np.flip(found[grid], AXES[name])
    return found


def held(folder: Path, holder: str, arrays: dict[str, Any], settings: dict[str, Any]) -> Any:
    """The call that reads arrays in their holder; None if it cannot hold them."""
    masked = any(np.ma.isMaskedArray(a) or np.asarray(a).dtype == object for a in arrays.values())
    if holder.startswith("npz"):
        if masked or "surface" in settings:
            return None
        (np.savez_compressed if "packed" in holder else np.savez)(folder / "a.npz", **arrays)
        return partial(read, folder / "a.npz", **settings)
    if holder == "mapping":
        return None if "surface" in settings else partial(read, arrays, **settings)
    numbers = {n: a for n, a in arrays.items() if isinstance(a, np.ndarray)}
    if holder.startswith("torch"):
        if masked or any(a.dtype.byteorder == ">" for a in numbers.values()):
            return None
        numbers = {name: torch.from_numpy(a.copy()) for name, a in numbers.items()}
        numbers["u"].requires_grad_("gradient" in holder)
    if holder == "lists":
        if any(np.ma.isMaskedArray(a) for a in numbers.values()):
            return None
        numbers = {name: a.tolist() for name, a in numbers.items()}
    if holder.startswith("pandas"):
        if numbers["u"].ndim > 1:
            return None
        numbers = {name: pd.Series(a) for name, a in numbers.items()}
        if "NA" in holder:
            numbers = {name: a.convert_dtypes() for name, a in numbers.items()}
    return partial(granpinn.flow, **(arrays | numbers), **settings)


def settings_of(units: str, time: str, said: bool) -> tuple[dict[str, Any], dict[str, Any]]:
    """Units as statements of the arrays, or as settings."""
    seen = view(units, False)
    named = {"length_unit": seen.x, "velocity_unit": seen.u, "time_unit": time}
    return (named, {}) if said else ({}, named)


def grid(
    folder: Path,
    holder: str,
    store: str,
    units: str,
    time: str,
    said: bool,
    up: bool,
    gone: str,
    order: str,
    more: str,
) -> Given | None:
    kind, _, detail = more.partition(" ")
    fraction = kind == "fraction"
    arrays = without_vectors(in_file(units, up, time, fraction), gone)
    flow = physical.flow(fraction=fraction, line=kind == "surface")
    named, settings = settings_of(units, time, said)
    settings |= physical.SETTINGS
    if fraction:
        c = scene.fraction()
        masked = np.ma.array(np.where(c == 0, 1e20, c), mask=c == 0)
        arrays["c"] = masked if detail == "masked" else c * float(detail)
    if kind == "sigma":
        arrays, flow = with_sigma(arrays, flow, view(units, up), detail)
    if kind == "surface":
        settings["surface"] = surface_points(units, up, time, detail)
    arrays = {name: stored(values, store) for name, values in arrays.items()}
    arrays = reversed_along(arrays, order) | named | {"y_down": not up}
    call = held(folder, holder, arrays, settings)
    return None if call is None else Given(call, flow, ROUNDINGS[store.strip("<>=|")[:2]])


def with_sigma(
    arrays: dict[str, Any], flow: Flow, seen: scene.View, detail: str
) -> tuple[dict[str, Any], Flow]:
    """Standard deviations that differ from row to row; one vector has none, and the largest
    counts."""
    sigma = np.broadcast_to(0.01 + 0.001 * np.arange(scene.ROWS)[:, None], flow.u.shape)
    lost = np.isnan(flow.u[:, ::-1])
    lost[0, 3, 4] = True
    expected = np.where(lost, sigma[~lost].max(), sigma)[:, ::-1].astype(np.float32)
    for name, unit in (("sigma_u", seen.u), ("sigma_v", seen.v)):
        values = np.where(lost, float(detail.split()[-1]), sigma / scene.si(unit))
        arrays[name] = np.ma.array(values, mask=lost) if "masked" in detail else values
    return arrays, replace(flow, sigma_u=expected, sigma_v=expected)


def surface_points(units: str, up: bool, time: str, detail: str) -> tuple[Any, ...]:
    line = physical.surface_line()
    x, y = physical.in_view(line.x, line.y, view(units, up))
    t = np.rint((line.t - physical.T[0]) / scene.SI["frame"])
    t = t if time == "frame" else line.t / scene.SI[time]
    if detail != "masked":
        return t, x, y
    masked = np.arange(t.size + 3) >= t.size  # three more points, which are masked
    return tuple(np.ma.array(np.append(a, [a[0]] * 3), mask=masked) for a in (t, x, y + 0.0))


def points(
    folder: Path,
    holder: str,
    store: str,
    units: str,
    time: str,
    said: bool,
    up: bool,
    gone: str,
    tilt: str,
) -> Given | None:
    if tilt and not up:  # the corner of a turned image is no vector
        return None
    arrays = in_file(units, up, time, False)
    codes = arrays["validity"]
    where = np.nonzero(codes >= 0)
    columns = {name: arrays[name][where] for name in ("u", "v", "validity")}
    columns |= {name: arrays[name][where[axis]] for name, axis in AXES.items()}
    angle = np.radians(float(tilt.partition(" ")[0] or 0))
    columns = turned(columns, angle)
    if gone == "left out":
        kept = columns.pop("validity") == Validity.VALID
        columns = {name: values[kept] for name, values in columns.items()}
    else:
        columns = without_vectors(columns, gone)
    columns = {name: stored(values, store) for name, values in columns.items()}
    named, settings = settings_of(units, time, said)
    settings |= physical.SETTINGS | ({"start": "1 ms"} if time == "frame" else {})
    settings |= {"surface": "none"} | ({"tilt": tilt} if tilt else {})
    call = held(folder, holder, columns | named | {"y_down": not up}, settings)
    if call is None:
        return None
    flow = physical.scattered()
    if tilt:
        gravity = (physical.G * np.sin(angle), -physical.G * np.cos(angle))
        particles = Particles(**turned(vars(flow.particles), angle))
        flow = physical.of_particles(particles, gravity=gravity)
    return Given(call, flow, ROUNDINGS[store.strip("<>=|")[:2]])


def turned(columns: dict[str, Any], angle: float) -> dict[str, Any]:
    """Vectors as a camera sees them in whose image a plumb line leans to the right."""
    cos, sin = np.cos(angle), np.sin(angle)
    found = dict(columns)
    for x, y in (("x", "y"), ("u", "v")):
        found[x] = cos * columns[x] - sin * columns[y]
        found[y] = sin * columns[x] + cos * columns[y]
    return found


COMMON = {
    "store": plain("f8", "f4", ">f8", ">f4", "f8 F", "f8 strided") | odd("f2"),
    "units": plain(METERS, PIXELS, "mm mm m/s m/s", "cm cm mm/s mm/s"),
    "time": plain("s", "ms", "frame"),
    "said": plain(True, False),
    "up": plain(True, False),
}
LOST = plain("nan nan", "u nan", "validity 0", "validity nan", "masked 0", "masked 1e20")
LOST |= plain("inf inf", "None")
FAMILIES = {
    "arrays on a grid": Family(
        grid,
        {
            "holder": plain("numpy", "npz", "npz packed", "mapping", "torch", "lists")
            | odd("torch gradient"),
            **COMMON,
            "gone": LOST | plain("mask 0", "mask 9e9", "mask nan"),
            "order": plain("", "t", "y", "x", "yx"),
            "more": plain("", "fraction 1", "fraction masked", "sigma nan", "sigma masked 1e20")
            | plain("surface")
            | odd("fraction 100", "fraction 255", "surface masked"),
        },
    ),
    "arrays of points": Family(
        points,
        {
            "holder": plain("numpy", "npz", "mapping", "torch", "lists", "pandas", "pandas NA"),
            **COMMON,
            "gone": LOST | plain("left out"),
            "tilt": plain("", "1.2 deg", "-30 deg"),
        },
    ),
}
