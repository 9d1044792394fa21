"""`granpinn.flow`: flows from plain arrays and from xarray."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import granpinn
from granpinn.importers import DataFileError
from tests.flows import make_flow

HEAP = make_flow()
MATERIAL = {"grain_diameter": "25 mm", "density": "1500 kg/m^3", "grain_density": "2500 kg/m^3"}
UNITS = {"length_unit": "mm", "time_unit": "s", "velocity_unit": "cm/s"}


def arrays(**changes: Any) -> dict[str, Any]:
    """The heap in millimetres and centimetres a second."""
    mm, cm = 1e3, 1e2
    given = {"t": HEAP.t, "y": HEAP.y * mm, "x": HEAP.x * mm, "u": HEAP.u * cm, "v": HEAP.v * cm}
    return given | {"c": HEAP.c} | changes


def dataset() -> Any:
    xarray = pytest.importorskip("xarray")
    units = {"t": "s", "y": "mm", "x": "mm", "u": "cm/s", "v": "cm/s", "c": "1"}
    given = arrays()
    found = xarray.Dataset(
        {name: (("t", "y", "x"), given[name], {"units": units[name]}) for name in "uvc"},
        {name: (name, given[name], {"units": units[name]}) for name in "tyx"},
    )
    return found


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "must hold t, y, x, u, v, got no t, y, x, u, v"),
        ({"u": HEAP.u}, "got no t, y, x, v"),
        (arrays(u=HEAP.u[0]), "u and v must be"),
        (arrays() | MATERIAL, "missing: length_unit"),
        (arrays() | UNITS, "missing: grain_density"),
        (arrays() | UNITS | MATERIAL | {"grain_diametre": "1 mm"}, "did you mean grain_diameter?"),
        (
            arrays() | UNITS | MATERIAL | {"density": 1500},
            "density must be text, got 1500",
        ),
        (arrays() | UNITS | MATERIAL | {"surface": ([0], [1])}, "three arrays t, x, y"),
        (arrays() | UNITS | MATERIAL | {"surface": ([0], [1], [1, 2])}, "of one length"),
        (arrays() | UNITS | MATERIAL | {"surface": ([0], [1], [np.nan])}, "a finite y"),
        (arrays() | UNITS | MATERIAL | {"surface": "line.csv"}, "there is no such file"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_cannot_be_used_is_refused_in_one_sentence(
    given: dict[str, Any], message: str
) -> None:
    with pytest.raises(DataFileError) as error:
        granpinn.flow(**given)
    assert message in str(error.value)
    assert "\n" not in str(error.value)
