"""What a run is of: settings, material, data. A checkpoint is for one identity alone.

Everything that decides the numbers of a run is in it, and nothing else: neither the true parameters
and the reference pressure of a flow file, nor attributes that only a second opinion uses.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch

from granpinn.config import Config, settings
from granpinn.results.decoding import plain
from granpinn.training.objective import Member, Objective

UNITS = ("length_unit", "time_unit", "density_unit")
MATERIAL = ("gravity", "density", "grain_density", "grain_diameter", "eta_min", "eta_max")


def of_settings(config: Config) -> Any:
    """The settings that decide the numbers of a run, by their names."""
    return plain(settings.identity(config))


def of_member(member: Member) -> Any:
    """Units, material and law of a member, by names for people."""
    flow = member.flow
    of_flow = {} if flow is None else {name: getattr(flow, name) for name in (*UNITS, *MATERIAL)}
    fixed = {f"fixed {name}": value for name, value in member.fixed.items()}
    return plain({**of_flow, "law": member.law.name, "seed": member.seed, **fixed})


def of_data(objective: Objective) -> str:
    """SHA-256 of the points of all members, and of the constants of their equations."""
    sha, spec = hashlib.sha256(), objective.spec
    lengths = [(m.problem.mean_length, m.problem.window) for m in objective.members]
    constants = (objective.physics, objective.term_weights, spec.input_shift, spec.input_scale)
    given = (points for points in objective.pool if points is not None)
    for values in (*given, objective.places, objective.seeds, *constants, lengths):
        sha.update(np.ascontiguousarray(torch.as_tensor(values).cpu().numpy()).data)
    return sha.hexdigest()


def difference(saved: Mapping[str, Any], own: Mapping[str, Any]) -> str | None:
    """The first entry that differs, in words; None: there is none."""
    for name in (*own, *(name for name in saved if name not in own)):
        if saved.get(name) != own.get(name):
            return f"{name} = {saved.get(name)}, this one has {own.get(name)}"
    return None
