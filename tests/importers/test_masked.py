"""A mask is no vector: in every kind of array, at every place where arrays come in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import granpinn
from granpinn.arrays import plain_array
from granpinn.data import Particles, Surface, Walls, check_flow
from granpinn.importers import DataFileError, VectorFields
from tests.flows import make_flow
from tests.importers.test_in_memory import HEAP, MATERIAL, UNITS, arrays, dataset

GONE = np.isnan(HEAP.u)
FILL = 1e20  # what may lie under a mask


def under_mask(values: Any) -> Any:
    return np.ma.array(np.where(GONE, FILL, values), mask=GONE)


def masked_flow() -> Any:
    return make_flow(u=under_mask(HEAP.u), v=under_mask(HEAP.v))


ROW = np.ma.array([1.0, FILL], mask=[False, True])
RECORDS: dict[str, Callable[[], Any]] = {
    "Flow": masked_flow,
    "Particles": lambda: Particles(t=ROW, x=ROW, y=ROW, u=ROW, v=ROW),
    "Surface": lambda: Surface(t=ROW, x=ROW, y=ROW),
    "Walls": lambda: Walls(x=ROW, y=ROW, p=ROW),
    "VectorFields": lambda: VectorFields(
        *(np.arange(2.0),) * 3, u=ROW, v=ROW, validity=np.ones(2, np.int8)
    ),
    "without validity": lambda: VectorFields(*(np.arange(2.0),) * 3, ROW, ROW),
}


@pytest.mark.parametrize("record", RECORDS)
def test_no_record_holds_a_mask_or_what_lies_under_it(record: str) -> None:
    found = RECORDS[record]()
    values = [value for value in vars(found).values() if isinstance(value, np.ndarray)]
    assert values
    assert not any(np.ma.isMaskedArray(value) for value in values)
    assert not any((value == FILL).any() for value in values)
    assert any(np.isnan(value).any() for value in values if value.dtype.kind == "f")


def test_a_flow_of_masked_arrays_is_that_of_nan() -> None:
    flow = masked_flow()
    check_flow(flow)
    assert flow.u.dtype == HEAP.u.dtype
    np.testing.assert_array_equal(flow.u, HEAP.u)


@pytest.mark.parametrize(
    "values",
    [["1"], [["1", 2]], [1j], np.array(["2020"], "M8[s]"), [[1], [1, 2]], [True], [{}], [b"1"]],
    ids=repr,
)
def test_other_things_than_numbers_are_refused(values: Any) -> None:
    with pytest.raises(DataFileError, match="u must hold numbers, got "):
        plain_array(values, "u", DataFileError)


def test_an_array_with_a_unit_of_its_own_is_refused() -> None:
    """Its unit would be lost, and the one beside it might be another."""
    pint, xarray = pytest.importorskip("pint"), pytest.importorskip("xarray")
    given = arrays()
    for values in (
        pint.UnitRegistry().Quantity(given["x"], "m"),
        xarray.DataArray(given["x"], attrs={"units": "m"}),
    ):
        with pytest.raises(DataFileError, match="x must be plain numbers, got an array with the"):
            granpinn.flow(**given | {"x": values}, **UNITS, **MATERIAL)
    data = dataset()
    data["u"] = (data.u.dims, pint.UnitRegistry().Quantity(data.u.values, "m/s"), data.u.attrs)
    with pytest.raises(DataFileError, match="u must be plain numbers, got an array with the unit"):
        granpinn.flow(data, **MATERIAL)
