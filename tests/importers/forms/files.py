"""The flow file itself, as other programs store it."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from granpinn.data import Flow, Particles, Surface, read_flow, write_flow
from tests.importers.forms import physical
from tests.importers.forms.form import FLOAT16, FLOAT32, FLOAT64, Family, Given, odd, plain

VELOCITY = ("u", "v", "particles/u", "particles/v")
STORAGE: dict[str, dict[str, Any]] = {
    "as written": {},
    "chunks": {"chunks": True},
    "gzip shuffle": {"compression": "gzip", "shuffle": True},
    "fletcher": {"chunks": True, "fletcher32": True},
    "lzf": {"compression": "lzf"},
    "growing": {"maxshape": None, "chunks": True},
}
ROUNDINGS = {"f8": FLOAT64, ">f8": FLOAT64, "f4": FLOAT32, ">f4": FLOAT32, "f2": FLOAT16}
# Every way of CF to say what the numbers of u and v mean.
CF: dict[str, dict[str, Any]] = {
    "": {},
    "scale": {"scale_factor": 0.5},
    "offset": {"add_offset": 2.0},
    "fill": {"_FillValue": -9999.0},
    "missing": {"missing_value": -9999.0},
    "neutral": {"scale_factor": 1.0, "add_offset": 0.0, "_FillValue": np.nan},
    "range": {"valid_max": 0.2},
    "mm/s": {"units": np.bytes_("mm/s")},
    "m s-1": {"units": np.bytes_("m s-1")},
}


@cache
def flow_of(kind: str) -> Flow:
    """The scene with everything that a file can hold, or with the least."""
    if kind == "least":
        return physical.flow(fraction=True)
    if kind == "grid":
        sigma = np.broadcast_to(0.01 + 0.001 * np.arange(9), (3, 7, 9)).astype(np.float32)
        flow = physical.flow(fraction=True)
        flow = replace(flow, sigma_u=sigma, sigma_v=2 * sigma)
    else:
        parts = vars(physical.scattered().particles)
        sigma = np.full(parts["t"].size, 0.01, np.float32)
        flow = physical.of_particles(Particles(**{**parts, "sigma_u": sigma, "sigma_v": sigma}))
    attributes = {"source": "a scene", "wall_gap": 0.02, "surface_sd": 1e-4}
    line = physical.surface_line()
    inside = (line.x > flow.x[0]) & (line.y < flow.y[-1])
    line = Surface(*(getattr(line, name)[inside] for name in ("t", "x", "y")))
    return replace(flow, walls=physical.walls(), attributes=attributes, surface=line)


@cache
def parts_of(kind: str) -> tuple[dict[str, tuple[Any, bytes | None]], dict[str, Any]]:
    """Datasets with their units, and attributes, as `write_flow` stores them."""
    with tempfile.TemporaryDirectory() as folder:
        write_flow(flow_of(kind), Path(folder, "a.h5"))
        datasets: dict[str, tuple[Any, bytes | None]] = {}
        with h5py.File(Path(folder, "a.h5")) as file:

            def keep(name: str, item: Any) -> None:
                if isinstance(item, h5py.Dataset):
                    datasets[name] = item[()], item.attrs.get("units")

            file.visititems(keep)
            return datasets, dict(file.attrs)


def stated(values: Any, how: str) -> Any:
    """The stored numbers of a velocity under statements of CF."""
    attributes = CF[how]
    values = (values - attributes.get("add_offset", 0)) / attributes.get("scale_factor", 1)
    fill = attributes.get("_FillValue", attributes.get("missing_value", np.nan))
    return np.where(np.isnan(values), fill, values / (1e-3 if how == "mm/s" else 1))


def flow_file(
    folder: Path,
    kind: str,
    velocity: str,
    coordinates: str,
    fraction: str,
    storage: str,
    structure: str,
    attributes: str,
    cf: str,
    length: str,
) -> Given:
    datasets, texts = parts_of(kind)
    options = {"libver": structure} if structure in ("earliest", "latest") else {}
    options |= {"userblock_size": 512} if structure == "userblock" else {}
    with h5py.File(folder / "a.h5", "w", **options) as file:
        for name, (values, unit) in datasets.items():
            kept = {"units": unit} if unit and attributes != "none" else {}
            if length == "mm" and unit == b"m":
                values, kept["units"] = 1e3 * values, np.bytes_("mm")
            if name in VELOCITY:
                values = stated(values, cf).astype(velocity)
                kept |= CF[cf]
            elif name.rpartition("/")[2] in ("t", "x", "y"):
                values = values.astype(coordinates)
            elif name == "c":
                values = values.astype(fraction)
            more = STORAGE[storage]
            more = more | {"maxshape": (None,) * values.ndim} if "maxshape" in more else more
            made = file.create_dataset(name, data=values, **more)
            made.attrs.update(kept)
        for name, value in texts.items():
            file.attrs[name] = said(value, attributes)
    rounding = max(ROUNDINGS[velocity], ROUNDINGS[coordinates])
    rounding = max(rounding, FLOAT32) if attributes == "float32" else rounding
    return Given(partial(read_flow, folder / "a.h5"), flow_of(kind), rounding)


def said(value: Any, how: str) -> Any:
    """An attribute of the file in another type."""
    if how == "text of any length" and isinstance(value, bytes):
        return value.decode()
    if how == "arrays" and np.ndim(value) == 0 and not isinstance(value, bytes):
        return np.array([value])
    if how == "float32" and isinstance(value, np.floating):
        return np.float32(value)
    return value


FAMILIES = {
    "flow file": Family(
        flow_file,
        {
            "kind": plain("grid", "particles"),
            "velocity": plain("f8", "f4", ">f8", ">f4") | odd("f2"),
            "coordinates": plain("f8", ">f8") | odd("f4"),
            "fraction": plain("f4", ">f4") | odd("f8"),
            "storage": plain("as written", "chunks", "gzip shuffle", "fletcher", "growing")
            | odd("lzf"),
            "structure": plain("", "earliest", "latest", "userblock"),
            "attributes": plain("", "none") | odd("text of any length", "arrays", "float32"),
            "cf": plain("") | odd(*list(CF)[1:]),
            "length": plain("m") | odd("mm"),
        },
    ),
}
