"""A mask is no vector: in every kind of array, at every place where arrays come in."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from torch.masked import masked_tensor

import granpinn
from granpinn.arrays import plain_array
from granpinn.data import Particles, Surface, Walls, check_flow
from granpinn.importers import DataFileError, VectorFields, from_arrays, vector_fields
from granpinn.laws import Law, Parameter
from granpinn.physics.laws import LAWS
from tests.flows import make_flow
from tests.importers.test_in_memory import HEAP, MATERIAL, UNITS, arrays, dataset

GONE = np.isnan(HEAP.u)
FILL = 1e20  # what may lie under a mask


def under_mask(values: Any) -> Any:
    return np.ma.array(np.where(GONE, FILL, values), mask=GONE)


def nullable(values: Any) -> Any:
    pandas = pytest.importorskip("pandas")
    frames = [pandas.DataFrame(np.where(GONE[k], None, v)) for k, v in enumerate(values)]
    return [frame.astype("Float64") for frame in frames]


def torch_masked(values: Any) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of torch: masked tensors are young
        return masked_tensor(
            torch.from_numpy(np.where(GONE, FILL, values)), torch.from_numpy(~GONE)
        )


KINDS: dict[str, Callable[[Any], Any]] = {
    "frames of numpy.ma in a list": lambda values: [*under_mask(values)],
    "pandas": nullable,
    "torch.masked": torch_masked,
}


@pytest.mark.parametrize("kind", KINDS)
def test_arrays_give_the_flow_that_nan_gives(kind: str) -> None:
    given = arrays()
    expected = granpinn.flow(**given, **UNITS, **MATERIAL)
    masked = {name: KINDS[kind](given[name].astype(np.float64)) for name in "uv"}
    found = granpinn.flow(**(given | masked), **UNITS, **MATERIAL)
    for name in ("t", "y", "x", "u", "v", "c"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=1e-6)


def test_integers_under_a_mask_are_no_vectors() -> None:
    """A standard deviation of masked integers, and a mask of codes that has gaps itself."""
    found = from_arrays(
        {
            **{name: np.arange(4.0) for name in ("t", "y", "x")},
            "u": np.ma.array([1, 2, 3, 4], mask=[0, 1, 0, 0]),
            "v": np.array([1, 2, 3, 4]),
            "mask": np.ma.array([False, False, False, False], mask=[0, 0, 1, 0]),
        }
    )
    np.testing.assert_array_equal(found.u, [1, np.nan, np.nan, 4])


def test_a_mask_counts_beside_the_validity() -> None:
    line = {name: np.arange(3.0) for name in ("t", "y", "x", "u", "v")}
    found = from_arrays(line | {"validity": [1, 1, 2], "mask": [0, 1, 0]})
    np.testing.assert_array_equal(found.validity, [1, 0, 2])


def test_data_sets_decode_what_their_attributes_say() -> None:
    """Numbers that were opened without mask_and_scale."""
    data, raw = dataset(), dataset()
    raw["u"] = (data.u.dims, np.where(GONE, -999.0, data.u / 2), data.u.attrs)
    raw["u"].attrs |= {"_FillValue": -999.0, "scale_factor": 2.0}
    found, expected = (granpinn.flow(d, **MATERIAL) for d in (raw, data))
    np.testing.assert_allclose(found.u, expected.u, rtol=1e-6)


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
    "vector_fields": lambda: vector_fields(*(np.arange(2.0),) * 3, ROW, ROW),
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


def test_points_of_a_surface_and_inertial_numbers_lose_their_mask() -> None:
    with pytest.raises(DataFileError, match="surface must have a finite x"):
        granpinn.flow(**arrays(), **UNITS, **MATERIAL, surface=(ROW.data, ROW, ROW.data))
    own = Law("own", lambda I, theta: theta[0] + 0 * I, [Parameter("mu", 0.3)])
    for mu in (own.friction(ROW, 0.3), LAWS["power"].friction(ROW, 0.4, 0.6, 0.3)):
        np.testing.assert_array_equal(np.isnan(mu), [False, True])
    assert np.isnan(HEAP.height(ROW, ROW)[1])


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


def test_words_are_no_switch() -> None:
    with pytest.raises(DataFileError, match="y_down must hold numbers"):
        from_arrays({name: np.arange(3.0) for name in ("t", "y", "x", "u", "v")} | {"y_down": "no"})
