"""A value of a wrong type ends in one sentence where it is given, before any training."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import granpinn
from granpinn.data import Flow, FlowFileError, Particles, Surface, Truth
from granpinn.data.flow import Walls
from granpinn.declared import checked, require_fields
from granpinn.errors import BadInput
from granpinn.importers import DataFileError
from tests.flows import make_flow

FIELDS: dict[str, Any] = {
    "density": "1500",
    "grain_diameter": None,
    "gravity": ("0", -9.81),
    "attributes": {1: 2},
    "surface": (1, 2, 3),
    "walls": 3,
    "particles": {},
    "truth": {"mu_s": 0.4},
    "sigma_u": "0.1 m/s",
    "path": "flow.h5",
    "u": torch.zeros(3, requires_grad=True),
    "t": [0.0, 1.0],
    "length_unit": b"m",
    "layer": 1,
}
RECORDS: dict[str, Callable[[], Any]] = {
    "surface": lambda: Surface(t=0.0, x=1.0, y=2.0),  # type: ignore[arg-type]
    "walls": lambda: Walls(x=[0.0], y=[1.0]),  # type: ignore[arg-type]
    "particles": lambda: Particles(*([0.0],) * 5),  # type: ignore[arg-type]
    "truth": lambda: Truth(mu_s="0.4"),  # type: ignore[arg-type]
    "law": lambda: Truth(law=["mu_of_i"]),  # type: ignore[arg-type]
}
CALLS: dict[str, Callable[[Flow], Any]] = {
    "config": lambda flow: granpinn.identify(flow, 3),  # type: ignore[arg-type]
    "flow": lambda flow: granpinn.identify([flow]),  # type: ignore[arg-type]
    "law": lambda flow: granpinn.identify(flow, law=3),  # type: ignore[arg-type]
    "run_dir": lambda flow: granpinn.identify(flow, run_dir=3),  # type: ignore[arg-type]
    "flows": lambda flow: granpinn.identify_many(flow),  # type: ignore[arg-type]
    "names": lambda flow: granpinn.identify_many("flow.h5"),
    "seeds": lambda flow: granpinn.identify_many([flow], seeds=3),  # type: ignore[arg-type]
    "laws": lambda flow: granpinn.identify_many([flow], laws=[3]),  # type: ignore[list-item]
    "path": lambda flow: granpinn.read_flow(flow),  # type: ignore[arg-type]
    "load": lambda flow: granpinn.load(None),  # type: ignore[arg-type]
    "write": lambda flow: granpinn.write_flow("flow.h5", flow),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("name", FIELDS)
def test_a_field_of_a_flow(name: str) -> None:
    with pytest.raises(FlowFileError, match=rf"^Flow\.{name}(\[0\])? must be .*, got .*: [^\n]+$"):
        replace(make_flow(), **{name: FIELDS[name]})


@pytest.mark.parametrize("name", RECORDS)
def test_a_field_of_a_record(name: str) -> None:
    with pytest.raises(BadInput, match=r"^\w+\.\w+ must be .*, got .*: [^\n]+$"):
        RECORDS[name]()


@pytest.mark.parametrize("name", CALLS)
def test_an_argument(name: str) -> None:
    with pytest.raises(BadInput, match=r"^\w+(\[0\])? must be .*, got .*: [^\n]+$"):
        CALLS[name](make_flow())


def test_arguments_of_a_conversion() -> None:
    flow = make_flow()
    arrays: dict[str, Any] = {name: getattr(flow, name) for name in "tyxuv"}
    units = {"length_unit": "m", "time_unit": "s", "velocity_unit": "m/s"}
    material = {"grain_diameter": "25 mm", "grain_density": "2500 kg/m^3", "solid_fraction": 0.6}
    given = arrays | units | material
    with pytest.raises(DataFileError, match=r"solid_fraction must be a number, got '0.6'"):
        granpinn.flow(**given | {"solid_fraction": "0.6"})
    graph = torch.tensor(flow.u, requires_grad=True)
    with pytest.raises(DataFileError, match=r"u must hold numbers, got Tensor: .*detach"):
        granpinn.flow(**given | {"u": graph})
    assert granpinn.flow(**given | {"u": graph.detach()}).u.shape == flow.u.shape


def test_numbers_of_numpy_are_numbers() -> None:
    flow = make_flow()
    kinds = {"density": np.float32(1500), "grain_diameter": np.float64(0.025), "gravity": [0, -9]}
    assert replace(flow, **kinds, path=Path("a.h5")).density == 1500
    numbers = np.array([0, 1])
    assert checked(lambda seeds: seeds)(numbers) is numbers
    require_fields(replace(flow, gravity=np.array([0.0, -9.81])))  # type: ignore[arg-type]
