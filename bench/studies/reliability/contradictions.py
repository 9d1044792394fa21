"""What `convert` and `inspect` say of contradictions, traps and good files.

    python -m bench.studies.reliability.contradictions --traps DIR --good FLOW.h5... --piv FILE...

Every case has the exit code and the words that are right. One that is right for good files is that
nothing is called impossible or improbable. Exit code 1: a case is wrong.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import io
import os
import re
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray

from bench.studies.reliability import commands
from bench.studies.reliability.writers import by_name
from granpinn import simulate
from granpinn.data import Flow

MATERIAL = ("--grain-density", "2500 kg/m^3", "--solid-fraction", "0.6")
GRAINS = ("--grain-diameter", "2 mm", *MATERIAL)
SLIP = "impossible|improbable"
SHOWN = 180  # characters of a sentence
COLUMNS = ("case", "format", "command", "exit code", "said", "right")

Files = Callable[[Path], Sequence[Path]]


@dataclass(frozen=True)
class Case:
    """A command line, and what is right.

    Attributes:
        files: writes the files to a folder, or names those that are there.
        code: the exit code that is right.
        said: a pattern in what the command says; it must not occur if it begins with "not ".
    """

    name: str
    format: str
    files: Files
    flags: tuple[str, ...]
    code: int
    said: str
    command: str = "convert"


def outcome(case: Case, folder: Path) -> dict[str, Any]:
    """The row of a case."""
    files = [str(path) for path in case.files(folder)]
    out = ("--out", str(folder / "out.h5")) if case.command == "convert" else ()
    printed = io.StringIO()
    with (
        contextlib.redirect_stdout(printed),
        contextlib.redirect_stderr(printed),
        commands.without_drawing(),
    ):
        code = commands.MAINS[case.command]([*files, *out, *case.flags])
    text = printed.getvalue()
    for place in {str(folder), *(str(Path(file).parent) for file in files)}:
        text = text.replace(f"{place}{os.sep}", "")
    wanted, pattern = not case.said.startswith("not "), case.said.removeprefix("not ")
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    found = [line for line in lines if re.search(pattern, line)]
    right = code == case.code and bool(found) == wanted
    said = (found or [line for line in lines if "warning" in line] or lines[-1:] or [""])[0]
    names = [Path(file).name for file in files]
    flags = [
        Path(flag).name if os.sep in flag and Path(flag).exists() else flag for flag in case.flags
    ]
    words = [*names[:1], *(["..."] if len(names) > 1 else []), *flags]
    command = f"{case.command} {' '.join(w if ' ' not in w else repr(w) for w in words)}"
    row = (case.name, case.format, command, code, said[:SHOWN], "right" if right else "wrong")
    return dict(zip(COLUMNS, row, strict=True))


# Vectors of films, in the formats of programs.

Arrays = dict[str, Any]
PIXEL, DELAY = 0.5e-3, 1e-3  # m, s between the two images
CAMERA = ("--length-unit", "px", "--velocity-unit", "px/frame", "--time-unit", "s")


def film(flow: Flow) -> Arrays:
    """A collapse as a camera sees it: px and px/frame, y down; NaN above the grains."""
    u, v = (np.where(flow.material, a, np.nan) * DELAY / PIXEL for a in (flow.u, flow.v))
    down = (flow.y[-1] - flow.y)[::-1] / PIXEL
    return {"t": flow.t, "y": down, "x": flow.x / PIXEL, "u": u[:, ::-1], "v": -v[:, ::-1]}


def npz(a: Arrays, folder: Path) -> list[Path]:
    np.savez(folder / "a.npz", **a, y_down=True)
    return [folder / "a.npz"]


def netcdf(a: Arrays, folder: Path) -> list[Path]:
    fields = {n: (("t", "y", "x"), a[n]) for n in "uv"}
    data = xarray.Dataset(fields, {n: a[n] for n in "tyx"})
    data.to_netcdf(folder / "a.nc", engine="h5netcdf")
    return [folder / "a.nc"]


def pivlab(a: Arrays, folder: Path, xy: float = 1.0, uv: Sequence[float] = (1.0,)) -> list[Path]:
    """PIVlab's text; `uv` of each file, the last one for all that follow."""
    y, x = np.meshgrid(a["y"], a["x"], indexing="ij")
    length, velocity = ("px", "px/frame") if xy == 1 else ("m", "m/s")
    files = []
    for k in range(len(a["t"])):
        factor = uv[min(k, len(uv) - 1)]
        head = (
            f"FRAME: {k + 1}, filenames: A: s {2 * k + 1:04}.tif & B: s {2 * k + 2:04}.tif, "
            f"conversion factor xy (px -> m): {xy}, "
            f"conversion factor uv (px/frame -> m/s): {factor}"
        )
        names = f"x [{length}],y [{length}],u [{velocity}],v [{velocity}],Vector type [-]"
        u, v = (factor * a[n][k] for n in "uv")
        columns = (xy * x, xy * y, u, v, np.where(np.isfinite(u), 1, 0))
        rows = np.stack([c.T.ravel() for c in columns], 1)
        files.append(folder / f"PIVlab_{k:04}.txt")
        np.savetxt(files[-1], rows, "%.9g", ",", header=f"PIVlab\n{head}\n{names}", comments="")
    return files


def matlab(
    a: Arrays, folder: Path, xy: float, uv: Sequence[float], names: str = "calxy caluv"
) -> list[Path]:
    """PIVlab's MATLAB files of one frame each."""
    y, x = np.meshgrid(a["y"], a["x"], indexing="ij")
    write, files = by_name("test_pivlab_mat", "version_73"), []
    for k in range(len(a["t"])):
        factor = uv[min(k, len(uv) - 1)]
        facts = dict(zip(names.split(), (xy, factor), strict=True))
        frame = {"x": xy * x, "y": xy * y, "u": factor * a["u"][k], "v": factor * a["v"][k]}
        frame["typevector"] = np.isfinite(a["u"][k]).astype(float)
        files.append(write(folder / f"a{k:04}.mat", frame | facts))
    return files


def insight(a: Arrays, folder: Path, delays: Sequence[float] = (2e3,)) -> list[Path]:
    """TSI Insight in mm and m/s, with the time between the images in us."""
    y, x = np.meshgrid(a["y"], a["x"], indexing="ij")
    files = []
    for k in range(len(a["t"])):
        delay = delays[min(k, len(delays) - 1)]
        title = (
            'TITLE="a" VARIABLES="X mm", "Y mm", "U m/s", "V m/s", "CHC", DATASETAUXDATA '
            f'MicrosecondsPerDeltaT="{delay}" ZONE I={len(a["x"])}, J={len(a["y"])}, F=POINT'
        )
        u, v = (np.nan_to_num(sign * a[n][k]) for n, sign in (("u", 1), ("v", -1)))
        columns = (x, a["y"].max() - y, u, v, np.where(np.isfinite(a["u"][k]), 1, -2))
        rows = np.stack([np.ravel(c) for c in columns], 1)
        files.append(folder / f"a{k:04}.vec")
        np.savetxt(files[-1], rows, "%.9g", ", ", header=title, comments="")
    return files


def tracks(a: Arrays, folder: Path, unit: str = "px") -> list[Path]:
    """A table of grains with their velocities, y up; `unit` of both."""
    t, y, x = np.meshgrid(a["t"], a["y"].max() - a["y"], a["x"], indexing="ij")
    there = np.isfinite(a["u"])
    length, speed = (PIXEL * 1e3, PIXEL * 1e3 / DELAY) if unit == "mm" else (1.0, 1.0)
    velocity = "mm/s" if unit == "mm" else "px/frame"
    columns = (t, length * x, length * y, speed * a["u"], -speed * a["v"])
    rows = np.stack([c[there] for c in columns], 1)
    header = f"t [s],x [{unit}],y [{unit}],u [{velocity}],v [{velocity}]"
    np.savetxt(folder / "tracks.csv", rows, "%.9g", ",", header=header, comments="")
    return [folder / "tracks.csv"]


def table(folder: Path, text: str, before: str = "") -> list[Path]:
    """A table of six grains in four frames in the place of the {} of `text`.

    Args:
        before: every row.
    """
    places = [(k, i, 20 * i + 0.2 * k * (1 + i), 30 + i * i) for k in range(4) for i in range(6)]
    rows = "\n".join(before + ",".join(map(str, place)) for place in places)
    (folder / "a.csv").write_text(text.format(rows), encoding="utf-8")
    return [folder / "a.csv"]


def trackpy(folder: Path) -> list[Path]:
    """The same grains in HDF5 by pandas, with one grain twice in a frame."""
    (path,) = table(folder, "frame,particle,x,y\n{}\n3,4,1,2\n")
    with warnings.catch_warnings(), pd.HDFStore(folder / "a.h5") as store:
        warnings.simplefilter("ignore")
        store.append("FrameData", pd.read_csv(path), data_columns=["frame"])
    return [folder / "a.h5"]


def edited(files: Files, edit: str, folder: Path) -> list[Path]:
    """Copies of text files, of which each is edited as a case says."""
    copies = []
    for path in files(folder):
        *above, last = path.read_text(encoding="utf-8").splitlines()
        if edit == "comment lines above":
            above = ["# by hand", "# x, y of the film", *above]
        elif edit == "cut off":
            last = last[: len(last) // 2]
        elif edit == "a comma in the numbers":
            last = last.replace(".", ",")
        copies.append(folder / path.name)
        coding = "utf-16" if edit == "UTF-16" else "utf-8"
        copies[-1].write_text("\n".join([*above, last]) + "\n", encoding=coding)
    return copies


DAMAGES = {
    "cut off": (2, "it was cut off here"),
    "a comma in the numbers": (2, "a comma both|use points"),
    "UTF-16": (0, "flow file: "),
}


def small() -> Arrays:
    """Four frames of 6 x 8 vectors of a shear flow in px."""
    y, x = 16.0 + 16 * np.arange(6), 16.0 + 16 * np.arange(8)
    v, u = np.meshgrid(0.01 * y, 1 + 0.02 * x, indexing="ij")
    u, v = (np.broadcast_to(f, (4, 6, 8)).copy() for f in (u, v))
    return {"t": np.arange(4) / 500, "y": y, "x": x, "u": u, "v": v}


def stated_twice() -> Iterator[Case]:
    """A time, a scale or a unit that is stated twice."""
    a, rate = small(), ("--frame-rate", "50 Hz", *GRAINS)
    again = "time between the two images of a pair is stated twice: the header says "
    film_says = "time between two frames is stated twice: the file says 2 ms, --frame-rate says 20"
    calibrated: dict[str, Callable[..., list[Path]]] = {
        "PIVlab text": pivlab,
        "PIVlab MATLAB": matlab,
    }
    for name, write in calibrated.items():
        files = partial(write, a, xy=1e-4)
        yield Case(
            "1 s, 500 Hz",
            name,
            partial(files, uv=[1e-4]),
            ("--frame-rate", "500 Hz", *GRAINS),
            2,
            f"{again}1 s .exactly 1, so probably never set., --frame-rate .you. says 2 ms",
        )
        yield Case("2 ms, 50 Hz", name, partial(files, uv=[0.05]), rate, 2, again)
        yield Case(
            "2 ms, double frames at 50 Hz",
            name,
            partial(files, uv=[0.05]),
            (*rate, "--pulse-delay", "2 ms"),
            0,
            f"not {SLIP}",
        )
        yield Case(
            "calibrated, another scale",
            name,
            partial(files, uv=[0.05]),
            ("--scale", "0.12 mm/px", "--frame-rate", "500 Hz", *GRAINS),
            2,
            "size of a pixel is stated twice: the header says 100 µm/pixel, --scale says 0.12",
        )
        yield Case(
            "factors change",
            name,
            partial(files, uv=[0.05, 0.05, 0.06]),
            ("--frame-rate", "500 Hz", *GRAINS),
            2,
            "calibration calu.? of a series is stated twice",
        )
        yield Case(
            "m in the files, mm by flag",
            name,
            partial(files, uv=[0.05]),
            ("--frame-rate", "500 Hz", "--length-unit", "mm", *GRAINS),
            2,
            "length unit is stated twice: the file says m, --length-unit says mm",
        )
    delayed: dict[str, Files] = {
        "Insight": partial(insight, a),
        **{name: partial(write, a, xy=1e-4, uv=[0.05]) for name, write in calibrated.items()},
    }
    for name, made in delayed.items():
        yield Case(
            "2 ms, another pulse delay",
            name,
            made,
            ("--frame-rate", "15 Hz", "--pulse-delay", "1 ms", *GRAINS),
            2,
            again,
        )
    yield Case(
        "factors change",
        "Insight",
        partial(insight, a, delays=[2e3, 2e3, 3e3]),
        ("--frame-rate", "15 Hz", *GRAINS),
        2,
        "calibration pulse_delay_us of a series is stated twice",
    )
    timed: dict[str, Callable[..., list[Path]]] = {"npz": npz, "netCDF": netcdf, "table": tracks}
    for name, write in timed.items():
        scale = ("--scale", "0.1 mm/px", *CAMERA)
        flip = {"netCDF": ("--flip-y", "yes"), "table": ("--flip-y", "no")}.get(name, ())
        yield Case(
            "times in s, another rate",
            name,
            partial(write, a),
            (*scale, *flip, *rate),
            2,
            film_says,
        )
    for name, write in (("npz", npz), ("Insight", insight)):
        yield Case(
            "files in mm, a scale",
            name,
            partial(write, a),
            (
                *("--scale", "0.1 mm/px", "--frame-rate", "500 Hz", *GRAINS),
                *(("--length-unit", "mm", "--time-unit", "s") if name == "npz" else ()),
            ),
            0,
            "--scale 0.1 mm/px changes nothing",
        )
    pairs = by_name("test_statements", "pivlab")
    for apart in (2, 3):
        yield Case(
            f"images {apart} apart",
            "PIVlab text",
            partial(pairs, pairs=[(k, k + apart) for k in range(1, 5)]),
            ("--scale", "0.1 mm/px", "--frame-rate", "500 Hz", *GRAINS),
            0,
            f"those of a pair are {apart} apart, so every pair has its own time",
        )
    yield Case(
        "images 2 apart, another pulse delay",
        "PIVlab text",
        partial(pairs, pairs=[(k, k + 2) for k in range(1, 5)]),
        ("--scale", "0.1 mm/px", "--frame-rate", "500 Hz", "--pulse-delay", "2 ms", *GRAINS),
        2,
        "the numbering of the images says 4 ms, --pulse-delay .you. says 2 ms",
    )


def of_a_collapse() -> Iterator[Case]:
    """Calibrations of a film that physics contradicts."""
    size: dict[str, Any] = {"height": 0.5, "aspect": 5.0, "d": 8e-3, "gravity": (0.0, -9.81)}
    solver: dict[str, Any] = {"density": 1500.0, "cells": 128, "stride": 1, "frames": 60}
    flow = simulate(mu_s=0.4, mu_2=0.64, **size, **solver, length_unit="m", time_unit="s")
    a, rate = film(flow), f"{1 / float(np.diff(flow.t).mean()):.10g} Hz"
    formats: dict[str, tuple[Callable[..., list[Path]], tuple[str, ...]]] = {
        "npz": (npz, (*CAMERA, "--pulse-delay", "1 ms")),
        "PIVlab text": (pivlab, ("--frame-rate", rate, "--pulse-delay", "1 ms")),
        "table": (tracks, (*CAMERA, "--pulse-delay", "1 ms", "--flip-y", "no")),
    }

    def of(name: str, change: Callable[[Arrays], Arrays] = lambda a: a) -> Files:
        return lambda folder: formats[name][0](change(a), folder)

    def rounded(part: float) -> Callable[[Arrays], Arrays]:
        return lambda a: a | {n: np.round(a[n] / part) * part for n in "uv"}

    grains, right = ("--grain-diameter", "8 mm", *MATERIAL), ("--scale", "0.5 mm/px")
    for name, (_, flags) in formats.items():
        yield Case("a good film", name, of(name), (*flags, *right, *grains), 0, f"not {SLIP}")
        yield Case(
            "whole pixels",
            name,
            of(name, rounded(1.0)),
            (*flags, *right, *grains),
            0,
            "multiples of .* .peak locking",
        )
        yield Case(
            "tenths of a pixel",
            name,
            of(name, rounded(0.1)),
            (*flags, *right, *grains),
            0,
            "multiples of .* .peak locking",
        )
        ten = (*flags, *right, "--grain-diameter", "80 mm", *MATERIAL)
        few = "improbable: .*diameter"

        def converted(folder: Path, name: str = name, ten: tuple[str, ...] = ten) -> list[Path]:
            files = [str(path) for path in of(name)(folder)]
            with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                commands.MAINS["convert"]([*files, "--out", str(folder / "flow.h5"), *ten])
            return [folder / "flow.h5"]

        yield Case("diameter ten times too large", name, converted, (), 0, few, "inspect")
        wrong = ("--scale", "0.585 mm/px")
        yield Case(
            "scale 17 % too large", name, of(name), (*flags, *wrong, *grains), 0, "scale is .*large"
        )
        yield Case(
            "the same, tilted by 6 degrees",
            name,
            of(name),
            (*flags, *wrong, "--tilt", "6 deg", *grains),
            0,
            "scale is .*too large.*; then .*--tilt",
        )
        twice = ("--scale", "1 mm/px")
        yield Case(
            "tilted by 6 degrees",
            name,
            of(name),
            (*flags, *right, "--tilt", "6 deg", *grains),
            0,
            "clockwise of gravity: check .*--tilt",
        )
        yield Case("scale twice", name, of(name), (*flags, *twice, *grains), 2, "impossible")
        yield Case(
            "scale twice, --force",
            name,
            of(name),
            (*flags, *twice, *grains, "--force"),
            0,
            "impossible",
        )


def of_tables() -> Iterator[Case]:
    """Rows twice, zeros for missing vectors, and the cause of a refusal."""
    camera = ("--scale", "0.5 mm/px", "--frame-rate", "500 Hz", "--flip-y", "yes")
    lab = ("--length-unit", "px", *camera, *GRAINS)
    head, twice = "frame,particle,x,y\n{}\n", "frame,particle,x,y\n{}\n3,4,1,2\n"
    tables: dict[str, Files] = {"table": partial(table, text=twice), "trackpy HDF5": trackpy}
    for name, made in tables.items():
        said = "got particle 4 more than once at frame 3"
        yield Case("a grain twice in a frame", name, made, lab, 2, said)
        dropped = (*lab, "--drop-duplicates")
        yield Case("the same, dropped", name, made, dropped, 0, "not more than once")
    a = small()
    for n in "uv":
        a[n][:, :3, :5] = 0
    rate, delay = ("--frame-rate", "500 Hz"), (*CAMERA, "--pulse-delay", "2 ms")
    films: dict[str, tuple[Files, tuple[str, ...]]] = {
        "npz": (partial(npz, a), delay),
        "netCDF": (partial(netcdf, a), (*delay, "--flip-y", "yes")),
        "PIVlab text": (partial(pivlab, a), rate),
    }
    for name, (made, flags) in films.items():
        words = (*flags, "--scale", "0.1 mm/px", *GRAINS)
        yield Case("zeros", name, made, words, 0, "are exactly zero")
        missing = (*words, "--zeros", "missing")
        yield Case("zeros, --zeros missing", name, made, missing, 0, "not exactly zero")
    texts: dict[str, tuple[Files, tuple[str, ...]]] = {
        "PIVlab text": (partial(pivlab, a), (*rate, "--scale", "0.1 mm/px", *GRAINS)),
        "Insight": (partial(insight, a), (*rate, *GRAINS)),
    }
    for name, (made, flags) in texts.items():
        for damage, (code, said) in DAMAGES.items():
            yield Case(damage, name, partial(edited, made, damage), flags, code, said)
    for name, text, before, code, said in (
        ("comment lines above", "# by hand\n# x, y of the film\n" + head, "", 0, "not cut off"),
        ("index without a name", f",{head}", "0,", 0, "not cut off"),
        ("cut off", head + "3,5,7", "", 2, "it was cut off here"),
        ("a comma in the numbers", "frame,particle,x,y\n1,1,2,5,3,5\n", "", 2, "a comma both"),
    ):
        written = partial(table, text=text, before=before)
        yield Case(name, "table", written, lab, code, said)


def traps(folder: Path) -> Iterator[Case]:
    """The small files in the formats of real programs."""

    def at(*names: str) -> Files:
        return lambda _: sorted(path for name in names for path in folder.glob(name))

    one, change = "pivlab/header_says_1s/*", "pivlab/factors_change/*"
    again = "of a pair is stated twice: the header says 1 s .exactly 1"
    rate = ("--frame-rate", "500 Hz")
    lab = ("--scale", "0.5 mm/px", *rate, *GRAINS)
    # Their grains move as one body, which convert calls impossible.
    image = ("--scale", "0.5 mm/px", *GRAINS, "--flip-y", "yes", "--force")
    px = ("--length-unit", "px", *rate, *image)
    opyf = ("--length-unit", "m", "--velocity-unit", "m/s", "--time-unit", "s", *GRAINS)
    fine, read = f"not {SLIP}", "flow file: "
    rows: tuple[tuple[str, str, Files, tuple[str, ...], int, str], ...] = (
        ("1 s, 500 Hz", "PIVlab text", at(one), (*rate, *GRAINS), 2, again),
        ("1 s, 50 Hz", "PIVlab text", at(one), ("--frame-rate", "50 Hz", *GRAINS), 2, again),
        (
            "calibrated, another scale",
            "PIVlab text",
            at(one),
            ("--frame-rate", "1 Hz", "--scale", "5 mm/px", *GRAINS),
            2,
            "size of a pixel is stated twice: the header says 4.24",
        ),
        ("factors change", "PIVlab text", at(change), (*rate, *GRAINS), 2, r"datos \(2\).*says"),
        ("opyf", "CSV", at("0*.csv"), lab, 0, fine),
        (
            "opyf on a grid",
            "HDF5",
            at("Run_00_rect*"),
            (*opyf, "--surface", str(folder / "Run_00_depths.hdf5")),
            0,
            "free surface: [1-9]",
        ),
        ("opyf, scattered", "HDF5", at("Run_00_unst*"), opyf, 0, fine),
        ("TrackMate", "CSV", at("trackmate.csv"), image, 0, read),
        (
            "times in s, another rate",
            "TrackMate",
            at("trackmate.csv"),
            (*lab, "--flip-y", "yes"),
            2,
            "the file says 10 ms, --frame-rate says 2 ms",
        ),
        ("TracTrac", "text", at("videotest_track.txt"), (*image, *rate), 0, read),
        ("TracTrac", "HDF5", at("videotest_track.hdf5"), (*image, *rate), 0, read),
        ("decimal commas, index, tabs", "table", at("tracks_eu.csv"), px, 0, read),
        ("decimal commas, semicolons", "table", at("tracks_semi.csv"), px, 0, read),
        ("UTF-16", "table", at("tracks_u16.csv"), px, 0, read),
        ("a grain twice in a frame", "table", at("tracks_dup.csv"), px, 2, "more than once"),
        (
            "the same, dropped",
            "table",
            at("tracks_dup.csv"),
            (*px, "--drop-duplicates"),
            0,
            read,
        ),
        (
            "whole pixels",
            "npz",
            at("peaklock.npz"),
            (*CAMERA, "--pulse-delay", "2 ms", *image),
            0,
            "multiples of .* .peak locking",
        ),
    )
    yield from (Case(f"trap: {name}", *others) for name, *others in rows)  # type: ignore[arg-type]
    texts = {
        "opyf CSV": (at("0*.csv"), lab),
        "TrackMate": (at("trackmate.csv"), image),
        "TracTrac": (at("videotest_track.txt"), (*image, *rate)),
    }
    for name, (files, flags) in texts.items():
        for damage, (code, said) in {**DAMAGES, "comment lines above": (0, read)}.items():
            yield Case(damage, name, partial(edited, files, damage), flags, code, said)


def there(path: Path, _: Path) -> list[Path]:
    """A file that is there, in place of one that is written to a folder."""
    return [path]


def good(flows: Sequence[Path], samples: Sequence[Path]) -> Iterator[Case]:
    """Good files, for false alarms."""
    for path in flows:
        name = f"good: {path.parent.name}/{path.stem}"
        yield Case(name, "flow", partial(there, path), (), 0, f"not {SLIP}", "inspect")
    units = ("--length-unit", "px", "--velocity-unit", "px/frame")
    scale = ("--scale", "0.1 mm/px")
    known: dict[str, tuple[str, ...]] = {"openpiv": (*units, *scale), "insight": scale}
    for path in samples:  # of other flows than of grains
        more = known.get(path.stem.partition("_")[0], ())
        flags = ("--steady", "--frame-rate", "15 Hz", *more, *GRAINS, "--force")
        alarm = "not stated twice|changes nothing|peak locking"
        yield Case(f"good: {path.stem}", path.suffix[1:], partial(there, path), flags, 0, alarm)


def main(argv: Sequence[str] | None = None) -> int:
    """Run all cases and write the table; exit code 1 if one is wrong."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--traps", type=Path, help="folder of the small files of programs")
    parser.add_argument("--good", type=Path, nargs="*", default=[], help="flow files")
    parser.add_argument("--piv", type=Path, nargs="*", default=[], help="samples of PIV programs")
    parser.add_argument("--only", default="", help="part of the names of the cases")
    parser.add_argument("--out", type=Path, help="the table")
    own = parser.parse_args(argv)
    cases = [*stated_twice(), *of_tables(), *of_a_collapse(), *good(own.good, own.piv)]
    cases += traps(own.traps) if own.traps else ()
    rows = []
    for case in cases:
        if own.only in case.name:
            with tempfile.TemporaryDirectory() as folder:
                rows.append(outcome(case, Path(folder)))
            print(*rows[-1].values(), sep=" | ", flush=True)
    if own.out is not None:
        with own.out.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
    wrong = [row for row in rows if row["right"] == "wrong"]
    print(f"{len(rows)} cases, {len(wrong)} wrong")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
