"""A small run folder, as after a training, and its contents."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from granpinn import identify
from granpinn.config import Config
from granpinn.results import Fields, Result, read_fields, read_results
from granpinn.training.history import read_history
from tests.flows import make_flow

Array = npt.NDArray[np.floating]

SETTINGS = {
    "steps": 40,
    "log_every": 4,
    "network__widths": (8, 8),
    "batch__interior": 32,
    "batch__surface": 8,
}


class Contents(NamedTuple):
    """The three files that a report is made of."""

    result: Result
    fields: Fields
    history: dict[str, Array]


def make_run(folder: Path) -> Path:
    """Identify the flow of tests.flows with a tiny network, in a fraction of a second."""
    identify(make_flow(), Config(**SETTINGS), run_dir=folder)
    return folder


def read_run(folder: Path) -> Contents:
    return Contents(
        read_results(folder / "results.json"),
        read_fields(folder / "fields.h5"),
        read_history(folder / "history.csv"),
    )


def with_values(fields: Fields, **values: Array | float | None) -> Fields:
    """The fields with some variables replaced by a number or an array [K], or left out (None)."""
    new = dict(fields.values)
    for name, value in values.items():
        if value is None:
            del new[name]
        else:
            new[name] = np.broadcast_to(value, fields.index.size).astype(np.float32)
    return replace(fields, values=new)
