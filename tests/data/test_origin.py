"""Coordinates far from 0: Unix time and the coordinates of a map give the same training."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from granpinn.data import Flow, FlowFileError, check_flow
from granpinn.data.scaling import scales_of
from granpinn.fit.prediction import predict
from granpinn.results.fields import read_fields, write_fields
from granpinn.training.points import training_set
from tests.examples import make_network
from tests.flows import make_flow, scattered

# Offsets of x, y and t. They are multiples of the spacing of the moved coordinates, so that the
# moved flow has the same steps but for the rounding of float64.
OFFSETS = {
    "unix time": (0.0, 0.0, 1.7e9),
    "kilometers": (1e6, 0.0, 0.0),
    "map": (4.5e5, 5.4e6, 0.0),
    "below": (-1e8, -1e8, 0.0),
    "all": (1e7, -1e7, 1.7e9),
}
FLOW = make_flow()


def moved(flow: Flow, offset: tuple[float, float, float]) -> Flow:
    x, y, t = offset
    places = {"x": flow.x + x, "y": flow.y + y, "t": flow.t + t}
    s, p = flow.surface, flow.particles
    if s is not None:
        places["surface"] = replace(s, x=s.x + x, y=s.y + y, t=s.t + t)
    if p is not None:
        places["particles"] = replace(p, x=p.x + x, y=p.y + y, t=p.t + t)
    return replace(flow, **places)


@pytest.mark.parametrize("kind", ["grid", "particles"])
@pytest.mark.parametrize("level", ["V0", "V1"])
@pytest.mark.parametrize("offset", OFFSETS)
def test_a_moved_flow_is_the_same_training(offset: str, level: str, kind: str) -> None:
    flow = FLOW if kind == "grid" else scattered(FLOW)
    there = moved(flow, OFFSETS[offset])
    check_flow(there)
    before, after = (
        training_set(f, s, level, collocation=0.5)
        for f, s in ((flow, scales_of(flow)), (there, scales_of(there)))
    )
    # The origin is the first value, not 0, and float64 rounds around the offset.
    shift = before.lower - after.lower
    tolerance = 1e-6 + 4 * float(np.spacing(max(map(abs, OFFSETS[offset])))) / 0.05
    for name in ("points", "surface_points", "between", "lower", "upper"):
        a, b = getattr(before, name), getattr(after, name)
        torch.testing.assert_close(b + shift, a, rtol=0, atol=tolerance)
    torch.testing.assert_close(after.velocity, before.velocity, rtol=0, atol=1e-6)
    for column in range(3):  # as many places and times as before
        counts = [len(torch.unique(part.points[:, column])) for part in (before, after)]
        assert counts[0] == counts[1]


@pytest.mark.parametrize("offset", OFFSETS)
def test_results_are_in_the_coordinates_of_the_file(offset: str, tmp_path: Path) -> None:
    there = moved(FLOW, OFFSETS[offset])
    for values, own in zip((there.x, there.y, there.t), scales_of(there).origin, strict=True):
        assert own in (0.0, values[0])
    fields = predict(there, make_network("mixed", there))
    write_fields(fields, tmp_path / "fields.h5")
    again = read_fields(tmp_path / "fields.h5")
    for name in "xyt":
        np.testing.assert_array_equal(getattr(again, name), getattr(there, name))


@pytest.mark.parametrize("form", ["mixed", "strong"])
def test_predictions_do_not_depend_on_the_origin(form: str) -> None:
    """The same network at the same places: once around 0, once around 1e7 m and 1.7e9 s."""
    at_zero = moved(FLOW, (-FLOW.x[0], -FLOW.y[0], -FLOW.t[0]))
    there = moved(at_zero, OFFSETS["all"])
    assert scales_of(at_zero).origin == (0, 0, 0)
    assert scales_of(there).origin == OFFSETS["all"]
    found = [predict(f, make_network(form, f)) for f in (at_zero, there)]
    for name in ("u", "v", "p"):
        scale = np.abs(found[0].values[name]).max()
        error = np.abs(found[0].values[name] - found[1].values[name]).max()
        assert error <= 1e-4 * scale  # 1e-9 m and 2e-7 s of rounding, on steps of 0.05


@pytest.mark.parametrize("name", ["t", "x", "y"])
def test_values_that_float32_does_not_tell_apart_are_refused(name: str) -> None:
    values = getattr(FLOW, name).copy()
    values[3] = values[2] + 1e-10
    with pytest.raises(FlowFileError, match=f"^{name} must have steps of at least .*, got 1e-10"):
        check_flow(replace(FLOW, **{name: values}))


@pytest.mark.parametrize("name", ["t", "x", "y"])
def test_values_that_float64_has_rounded_are_refused(name: str) -> None:
    values = getattr(FLOW, name) + 1e14
    with pytest.raises(FlowFileError, match=f"^{name} must have steps of at least 1.5"):
        check_flow(replace(FLOW, **{name: values}))
