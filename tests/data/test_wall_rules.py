"""Walls in a flow file: every rule has one error that names the dataset and the remedy."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from granpinn.data import (
    FlowFileError,
    Walls,
    check_flow,
    read_flow,
    write_flow,
)
from granpinn.data.schema import arrays_of
from tests.data.walled import EVERYTHING, FLOOR, NAN, TWO, full, line, single
from tests.flows import make_flow

FLOW = make_flow()

RULES: dict[str, tuple[Walls, str]] = {
    "y alone is NaN": (line((0, 0), (1, NAN), (2, 0)), "must be NaN at the same points"),
    "infinite x": (line((0, 0), (np.inf, 0)), "wall_x must lie within x"),
    "other unit": (line((0, 0), (2000, 0)), "wall_x must lie within x"),
    "huge": (line((-1e308, 0), (1e308, 0)), "wall_x must lie within x"),
    "a piece of one point": (
        line((0, 0), (2, 0), (NAN, NAN), (0, 1)),
        "every piece of a wall must have at least two points, got one at index 3",
    ),
    "only NaN": (line((NAN, NAN), (NAN, NAN)), "at least two points, got none"),
    "no point": (Walls(np.empty(0), np.empty(0)), "wall_x must hold at least one point"),
    "one place": (line((1, 1), (1, 1)), "wall_x and wall_y must be lines"),
    "short": (Walls(np.zeros(2), np.zeros(3)), "wall_y must have as many points as wall_x, 2"),
    "u alone": (replace(FLOOR, u=full(1.0)), "wall_u and wall_v must come together"),
    "velocity of NaN": (replace(FLOOR, u=full(1.0), v=full(NAN)), "wall_v must be finite"),
    "half slip": (replace(FLOOR, slip=single(0, 0.5)), "wall_slip must be 0 where grains move"),
    "slip of NaN": (replace(FLOOR, slip=single(0, NAN)), "wall_slip must be finite"),
    "pull": (replace(FLOOR, p=single(1, -1)), "wall_p must be a stress of at least 0"),
    "infinite pressure": (replace(FLOOR, p=single(1, np.inf)), "wall_p must be a stress"),
    "signed": (replace(FLOOR, tau=single(1, -1)), "wall_tau must be a stress of at least 0"),
    "two times": (replace(FLOOR, t=np.array([0.1, 0.2])), "wall_t must be the same at all points"),
    "late": (replace(FLOOR, t=full(9.0)), "wall_t must lie near t"),
    "rounded": (replace(FLOOR, x=single(0, 2)), "wall_x must be float64 [m], got float32"),
}


@pytest.mark.parametrize(("walls", "message"), RULES.values(), ids=RULES.keys())
def test_broken_rule_is_named(walls: Walls, message: str) -> None:
    with pytest.raises(FlowFileError) as caught:
        check_flow(replace(FLOW, walls=walls))
    text = str(caught.value)
    assert message in text
    assert ": " in text
    assert "\n" not in text


@pytest.mark.parametrize("walls", [FLOOR, TWO, EVERYTHING], ids=["floor", "two", "everything"])
def test_round_trip_is_exact(walls: Walls, tmp_path: Path) -> None:
    path = tmp_path / "flow.h5"
    flow = replace(FLOW, walls=walls)
    write_flow(flow, path)
    again = read_flow(path)
    before, after = arrays_of(flow), arrays_of(again)
    assert before.keys() == after.keys()
    assert {"wall_x", "wall_y"} <= before.keys()
    for name, array in before.items():
        assert after[name].dtype == array.dtype, name
        assert after[name].tobytes() == array.tobytes(), name
    with h5py.File(path) as file:
        assert file["wall_x"].attrs["units"] == b"m"
