"""PIVlab's MATLAB files, and data sets of xarray."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray

import granpinn
from tests.importers import scene
from tests.importers.forms import physical
from tests.importers.forms.form import FLOAT32, FLOAT64, INT16, Family, Given, odd, plain
from tests.importers.forms.memory import stored
from tests.importers.forms.texts import METERS, PIXELS, given, view
from tests.importers.test_pivlab_mat import all_frames, one_frame, version_5, version_73
from tests.importers.test_simulation_files import dataset

ROUNDINGS = {"f8": FLOAT64, ">f8": FLOAT64, "f4": FLOAT32, ">f4": FLOAT32, "i2": 4 * INT16}


def in_type(value: Any, store: str) -> Any:
    """A matrix, or the matrices of a cell array, in another type."""
    if isinstance(value, str) or (np.ndim(value) == 0 and np.asarray(value).dtype != object):
        return value
    if np.asarray(value).dtype != object:
        return stored(value, store)
    found = np.empty(value.shape, object)
    for index, cell in np.ndenumerate(value):
        found[index] = stored(cell, store)
    return found


def matlab(
    folder: Path,
    layout: str,
    version: str,
    units: str,
    up: bool,
    types: bool,
    gone: str,
    store: str,
) -> Given | None:
    seen = view(units, up)
    if not types and gone != "nan":
        return None
    options = {"view": seen, "types": types, "gone": float(gone)}
    write: Callable[..., Path] = {"5": version_5, "5 packed": version_5, "7.3": version_73}[version]
    packed = {"do_compression": True} if "packed" in version else {}
    frames = range(scene.FRAMES) if layout == "one frame" else range(1)
    for k in frames:
        made = all_frames if layout == "all frames" else partial(one_frame, k)
        content = {name: in_type(value, store) for name, value in made(**options).items()}
        if seen.u == "m/frame":
            content["units"] = "[m] respectively [m/frame]"
        write(folder / f"a{k}.mat", content, **packed)
    return given(folder, physical.flow(), {}, ROUNDINGS[store])


def packing(data: Any, store: str) -> dict[str, dict[str, Any]]:
    """Encoding of u and v, or of all, in a file."""
    dtype, _, fill = store.partition(" ")
    names = [*data.data_vars, *data.coords]
    if dtype != "i2":
        encoding: dict[str, dict[str, Any]] = {name: {"dtype": dtype} for name in names}
        for name in ("u", "v") if fill else ():
            encoding[name] |= {
                fill: -9999.0,
                **({} if fill == "_FillValue" else {"_FillValue": None}),
            }
        return encoding
    encoding = {}
    for name in ("u", "v"):
        values = data[name].values
        low, high = np.nanmin(values), np.nanmax(values)
        scale, middle = (high - low) / 65000, (high + low) / 2
        encoding[name] = {"dtype": "i2", "scale_factor": scale, "add_offset": middle}
        encoding[name]["_FillValue"] = np.int16(-32768)
    return encoding


def data_set(
    folder: Path,
    holder: str,
    units: str,
    time: str,
    up: bool,
    store: str,
    gone: str,
    dims: str,
    order: str,
    whole: float,
) -> Given | None:
    kind, _, fill = gone.partition(" ")
    if kind == "chc" and store == "i2" and fill == "9e9":
        return None
    c = None if whole == 0 else scene.fraction() * whole
    seen = view(units, up)
    data = dataset(seen, time=time, dims=dims, types=kind == "chc", gone=float(fill), c=c)
    data = data.isel({name: slice(None, None, -1) for name in order})
    settings = physical.SETTINGS | {"flip_y": "no" if up else "yes"}
    flow = physical.flow(fraction=whole > 0)
    rounding = ROUNDINGS[store.split()[0]]
    if holder == "undecoded":
        data.to_netcdf(folder / "a.nc", engine="scipy", encoding=packing(data, store))
        data = xarray.open_dataset(folder / "a.nc", mask_and_scale=False, decode_times=False)
    elif " " in store or store == "i2":
        return None
    else:
        data = data.map(partial(stored_variable, store)).assign_coords(data.coords)
    return Given(partial(granpinn.flow, data, **settings), flow, rounding)


def stored_variable(store: str, variable: Any) -> Any:
    return variable.copy(data=stored(variable.values, store))


FAMILIES = {
    "PIVlab MATLAB": Family(
        matlab,
        {
            "layout": plain("all frames", "one frame"),
            "version": plain("5", "5 packed", "7.3"),
            "units": plain(PIXELS, METERS, "m m m/frame m/frame"),
            "up": plain(False, True),
            "types": plain(True, False),
            "gone": plain("nan", "0", "9e9"),
            "store": plain("f8", "f4"),
        },
    ),
    "xarray": Family(
        data_set,
        {
            "holder": plain("undecoded", "Dataset"),
            "units": plain(METERS, "pix pix pix/dt pix/dt", "mm mm mm/s mm/s")
            | odd("mm m cm/s mm/s"),
            "time": plain("s", "", "frame") | odd("hours since 2020-01-01"),
            "up": plain(True, False),
            "store": plain("f8", "f4", "i2", "f8 _FillValue", ">f4"),
            "gone": plain("nan nan", "chc 0", "chc 9e9"),
            "dims": plain("t y x", "y x t", "x t y"),
            "order": plain("", "yx"),
            "whole": plain(0.0, 1.0) | odd(100.0),
        },
    ),
}
