"""Calls of the API with values of wrong types, shapes and sizes end in one sentence, or work.

A call gets good arguments, one or two of which are replaced by draws from `VALUES`. Allowed are the
errors of granpinn, and TypeError or ValueError that the call itself raises with a sentence. A
training that has begun must give its result.
"""

from __future__ import annotations

import dataclasses
import linecache
import random
import traceback
import warnings
from collections.abc import Callable
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import granpinn
from granpinn.config import flatten
from granpinn.data import (
    Flow,
    Particles,
    Surface,
    Truth,
    add_noise,
    check_flow,
    particle_flow,
    read_flow,
    write_flow,
)
from granpinn.errors import BadInput, CannotGoOn
from granpinn.importers import read
from granpinn.importers.settings import Settings
from granpinn.laws import Law, Parameter, register
from granpinn.progress import Progress
from granpinn.results import read_fields, read_results
from tests.flows import make_flow
from tests.runs import TINY

FEW = TINY | {"steps": 3}
FLOW = make_flow(frames=6, rows=12, columns=10)
ARRAYS = {name: getattr(FLOW, name) for name in "tyxuv"}
UNITS = {"length_unit": "m", "time_unit": "s", "velocity_unit": "m/s"}
MATERIAL = {"grain_diameter": "25 mm", "grain_density": "2500 kg/m^3", "solid_fraction": 0.6}
PARTICLES = {name: np.linspace(0.1, 1, 60) ** k for k, name in enumerate("txyuv", 1)}
OTHERS = {"gravity": (0.0, -9.81), "density": 1500.0, "grain_diameter": 0.01}
VALUES: list[Callable[[random.Random], Any]] = [
    lambda r: None,
    lambda r: r.choice([True, False]),
    lambda r: r.choice([0, 1, 2, -1, -7]),
    lambda r: r.choice([10**12, -(2**63), 2**64, 10**400]),
    lambda r: r.choice([0.0, 0.5, -1.5, 1e-300, 1e300, float("nan"), float("inf")]),
    lambda r: r.choice([1 + 2j, Decimal("0.5"), np.float32(0.3), np.int8(3), np.float64("nan")]),
    lambda r: r.choice(["", "text", "1", "0.5 mm", "no/such/file", "a\0b", "x" * 5000, "é\n"]),
    lambda r: r.choice([b"bytes", bytearray(b"x"), object(), int, len, ...]),
    lambda r: r.choice([[], (), {}, set(), [None], ["a"], [[1, 2], [3]], {"a": 1}, {1: 2}]),
    lambda r: r.choice([[1.0, 2.0], (0, 1), range(3), iter([1]), (0.5,), [float("nan")] * 3]),
    lambda r: np.zeros(r.choice([(), (0,), (1,), (6,), (6, 12), (6, 12, 10), (2, 2, 2, 2)])),
    lambda r: np.full((6, 12, 10), r.choice([np.nan, np.inf, 1e30, -1.0]), np.float32),
    lambda r: np.array(["a", "b"], r.choice([object, "U1"])),
    lambda r: np.ones((6, 12, 10), r.choice(["c8", "i8", "bool", "O", "M8[s]", ">f8", "f2"])),
    lambda r: torch.ones(6, 12, 10, requires_grad=r.choice([True, False])),
    lambda r: r.choice([FLOW, granpinn.Config(**FEW), Path("no/such"), FLOW.surface, Truth(0.4)]),
    lambda r: lambda *args: args,
]


class Begun(Progress):
    """Notes whether a training has begun."""

    steps = 0

    def at(self, name: str, done: float, total: float, text: str = "") -> None:
        self.steps = int(total)


def made_flow(**fields: Any) -> Any:
    flow = dataclasses.replace(FLOW, **fields)
    check_flow(flow)
    return flow


def identified(**given: Any) -> Any:
    changed = {name: given.pop(name) for name in [*given] if name.startswith("flow.")}
    if changed:
        given["flow"] = made_flow(**{name[5:]: value for name, value in changed.items()})
    return granpinn.identify(**given)


def predicted(**given: Any) -> Any:
    result = granpinn.identify(FLOW, granpinn.Config(**FEW))
    return result.predict(**given)


def new_law(mu: Any, name: Any, parameters: Any) -> Any:
    return register(Law(name, mu, parameters))


def calls(folder: Path, begun: Begun) -> dict[str, tuple[Callable[..., Any], dict[str, Any]]]:
    """The functions with good arguments; each name once for every form of a call."""
    write_flow(FLOW, folder / "flow.h5")
    config = granpinn.Config(**FEW)
    settings = {name: Settings.__dataclass_fields__[name].default for name in SETTINGS}
    fields = {f.name: getattr(FLOW, f.name) for f in dataclasses.fields(Flow)}
    many = dict.fromkeys(("seeds", "I0", "laws", "noise", "run_dir"))
    surface = Surface(FLOW.surface.t, FLOW.surface.x, FLOW.surface.y) if FLOW.surface else None
    assert surface is not None
    mu = ("mu_s", 0.3)
    parts = {"progress": begun, "run_dir": None, "law": None}
    parts |= {"level": "V1", "checks": "none"}
    return {
        "flow": (granpinn.flow, ARRAYS | UNITS | MATERIAL),
        "flow, all settings": (granpinn.flow, settings | ARRAYS | UNITS | MATERIAL),
        "flow, with parts": (
            granpinn.flow,
            ARRAYS
            | UNITS
            | MATERIAL
            | {"mask": FLOW.c == 0, "c": FLOW.c, "p": FLOW.p, "sigma_u": FLOW.c, "sigma_v": FLOW.c}
            | {"surface": (surface.t, surface.x, surface.y), "y_down": False},
        ),
        "read": (read, {"source": ARRAYS | UNITS, **MATERIAL}),
        "Flow": (made_flow, fields),
        "Surface": (Surface, vars(surface)),
        "Particles": (lambda **p: particle_flow(Particles(**p), **OTHERS), PARTICLES),
        "particle_flow": (particle_flow, {"particles": Particles(**PARTICLES), **OTHERS}),
        "Truth": (Truth, {"mu_s": 0.4, "mu_2": 0.6, "I0": 0.3, "law": "mu_of_i"}),
        "Config": (granpinn.Config, flatten(config)),
        "Config, sections": (granpinn.Config, vars(config)),
        "identify": (granpinn.identify, {"flow": FLOW, "config": config, **parts}),
        "identify, changed flow": (
            identified,
            {"config": config, "progress": begun}
            | {f"flow.{name}": value for name, value in fields.items()},
        ),
        "identify_many": (
            granpinn.identify_many,
            {"flows": [FLOW], "config": config, "progress": begun, **many},
        ),
        "read_flow": (read_flow, {"path": folder / "flow.h5", "max_bytes": 2**20}),
        "write_flow": (write_flow, {"flow": FLOW, "path": folder / "out.h5"}),
        "add_noise": (add_noise, {"flow": FLOW, "sd": 0.1, "seed": 3}),
        "load": (granpinn.load, {"run_dir": folder}),
        "read_results": (read_results, {"path": folder / "results.json"}),
        "read_fields": (read_fields, {"path": folder / "fields.h5"}),
        "predict": (predicted, {"x": [0.1, 0.2], "y": 0.1, "t": 0.5}),
        "Parameter": (
            Parameter,
            {"name": "a", "start": 0.3, "bounds": (0.01, 3.0), "above": False, "symbol": ""},
        ),
        "Law": (
            new_law,
            {
                "mu": lambda i, theta: theta[0] + 0 * i,
                "name": "one",
                "parameters": [Parameter(*mu)],
            },
        ),
        "simulate": (
            granpinn.simulate,
            {"cells": 32, "frames": 2, "t_end": 0.1, "stride": 4, "mu_s": 0.4, "aspect": 1.0}
            | {"height": 1.0, "d": 0.02, "out": None, "progress": None, "gravity": (0.0, -1.0)},
        ),
    }


SETTINGS = [f.name for f in dataclasses.fields(Settings) if f.name not in {**UNITS, **MATERIAL}]


def complaint(call: Callable[..., Any], given: dict[str, Any], begun: Begun) -> str:
    """What is wrong with the end of a call; "" if it works or ends in one sentence."""
    begun.steps = 0
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            call(**given)
    except (BadInput, CannotGoOn) as error:
        if begun.steps and not isinstance(error, CannotGoOn):
            return f"lost training: {error!r}"
        return "" if str(error).strip() and "\n" not in str(error) else f"no sentence: {error!r}"
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        line = linecache.getline(last.filename, last.lineno or 0)
        own = last.filename == __file__ or last.filename.endswith("torch/_ops.py")  # of csrc/ops
        own |= "/granpinn/" in last.filename and line.lstrip().startswith("raise ")
        sentence = " " in str(error).strip()
        if isinstance(error, TypeError | ValueError) and own and sentence and not begun.steps:
            return ""
        lost = "lost training: " if begun.steps else ""
        return f"{lost}{type(error).__name__}: {str(error)[:150]} ({last.filename}:{last.lineno})"
    return ""


def attempt(number: int, folder: Path) -> str:
    """A call with wrong values; what is wrong with its end."""
    draw, begun = random.Random(f"API call {number}"), Begun()
    forms = calls(folder, begun)
    name = draw.choice(sorted(forms))
    call, good = forms[name]
    given = dict(good)
    for key in draw.sample(sorted(good), min(len(good), draw.choice([1, 1, 1, 2]))):
        given[key] = draw.choice(VALUES)(draw)
        if callable(given[key]) and key == "flow.source":  # its own errors are the user's
            given[key] = None
    found = complaint(call, given, begun)
    changed = {key: value for key, value in given.items() if value is not good[key]}
    return found and f"{number}: {name}({str(changed)[:200]}): {found}"


@pytest.mark.parametrize("part", range(4))
def test_wrong_values_end_in_one_sentence(
    part: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    found = [text for k in range(15) if (text := attempt(15 * part + k, tmp_path))]
    assert found == []


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_500_calls_with_wrong_values(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert [text for k in range(500) if (text := attempt(k, tmp_path))] == []
