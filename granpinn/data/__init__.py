"""Flows: files, rules, synthetic noise, and the points of training."""

from granpinn.data.flow import (
    Flow,
    FlowFileError,
    Particles,
    Surface,
    Truth,
    Walls,
)
from granpinn.data.flow_file import read_flow, write_flow
from granpinn.data.noise import add_noise, known_sd
from granpinn.data.outline import with_partial_cells
from granpinn.data.particles import particle_flow
from granpinn.data.points import TrainingSet, training_set
from granpinn.data.rules import check_flow
from granpinn.errors import FlowFileWarning

__all__ = [
    "Flow",
    "FlowFileError",
    "FlowFileWarning",
    "Particles",
    "Surface",
    "TrainingSet",
    "Truth",
    "Walls",
    "add_noise",
    "check_flow",
    "known_sd",
    "particle_flow",
    "read_flow",
    "training_set",
    "with_partial_cells",
    "write_flow",
]
