"""What a run is of: settings, material, data. A checkpoint is for one identity alone.

Everything that decides the numbers of a run is in it, and nothing else: neither the true parameters
and the reference pressure of a flow file, nor attributes that only a second opinion uses.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from granpinn.config import Config, settings
from granpinn.data import Flow
from granpinn.data.scaling import scales_of
from granpinn.results.decoding import plain
from granpinn.training.objective import Member, Objective

UNITS = ("length_unit", "time_unit", "density_unit")
MATERIAL = ("gravity", "density", "grain_density", "grain_diameter", "eta_min", "eta_max")
GRID = ("t", "y", "x", "u", "v", "c", "sigma_u", "sigma_v")
SURFACE = ("t", "x", "y")  # the level decides whether the pressure there is used: `of_data`
WALLS = ("x", "y", "u", "v", "slip", "p")
PARTICLES = ("t", "x", "y", "u", "v", "sigma_u", "sigma_v")

_digests: WeakKeyDictionary[Flow, str] = WeakKeyDictionary()


def of_settings(config: Config) -> Any:
    """The settings that decide the numbers of a run, by their names."""
    return plain(settings.identity(config))


def of_member(member: Member) -> Any:
    """Material, scales, law and weights of a member, by names for people."""
    problem, flow = member.problem, member.flow
    found: dict[str, Any] = {}
    if flow is not None:
        found |= {name: getattr(flow, name) for name in (*UNITS, *MATERIAL)}
        found["SHA-256 of the flow"] = digest_of_flow(flow)
        found |= {f"scale of {name}": value for name, value in vars(scales_of(flow)).items()}
    found |= {"law": member.law.name, "seed": member.seed}
    found |= {f"fixed {name}": value for name, value in member.fixed.items()}
    found |= {f"constant {name}": v for name, v in problem.physics._asdict().items()}
    found |= {
        "weights": problem.term_weights,
        "length of means": problem.mean_length,
        "window": problem.window,
        "input shift": problem.spec.input_shift,
        "input scale": problem.spec.input_scale,
    }
    return plain(found)


def of_data(objective: Objective) -> str:
    """SHA-256 of the points of all members."""
    sha = hashlib.sha256()
    for tensor in (*objective.tensors().values(), objective.places, objective.seeds):
        sha.update(np.ascontiguousarray(tensor.cpu().numpy()).data)
    return sha.hexdigest()


def digest_of_flow(flow: Flow) -> str:
    """SHA-256 of the measured fields of a flow."""
    if flow not in _digests:
        sha = hashlib.sha256()
        parts = (
            (flow, GRID),
            (flow.surface, SURFACE),
            (flow.particles, PARTICLES),
            (flow.walls, WALLS),
        )
        for part, names in parts:
            for name in names if part is not None else ():
                value = getattr(part, name)
                sha.update(f"{name} {np.shape(value)} ".encode())
                if value is not None:
                    sha.update(np.ascontiguousarray(value).data)
        _digests[flow] = sha.hexdigest()
    return _digests[flow]


def difference(saved: Mapping[str, Any], own: Mapping[str, Any]) -> str | None:
    """The first entry that differs, in words; None: there is none."""
    for name in (*own, *(name for name in saved if name not in own)):
        if saved.get(name) != own.get(name):
            if name.startswith("SHA-256"):
                return "another flow file"
            return f"{name} = {saved.get(name)}, this one has {own.get(name)}"
    return None
