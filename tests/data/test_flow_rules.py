"""Every rule of the format has one error that names the dataset, the finding and the remedy."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from granpinn.data import (
    Flow,
    FlowFileError,
    Surface,
    Truth,
    Walls,
    check_flow,
    read_flow,
    write_flow,
)
from tests.data.walled import FLOOR, NAN, full, line, single
from tests.flows import make_flow

FLOW = make_flow()
SURFACE = FLOW.surface
assert SURFACE is not None


def changed(name: str, index: Any, value: float) -> dict[str, Any]:
    """The field `name` of the flow with some values replaced."""
    array = getattr(FLOW, name).copy()
    array[index] = value
    return {name: array}


def both(index: Any, value: float) -> dict[str, Any]:
    return {**changed("u", index, value), **changed("v", index, value)}


def surface(name: str, change: Any) -> dict[str, Any]:
    return {"surface": replace(SURFACE, **{name: change(getattr(SURFACE, name).copy())})}


def with_value(value: float) -> Any:
    def put(array: Any) -> Any:
        array[3] = value
        return array

    return put


NEGATIVE_SIGMA = np.full(FLOW.u.shape, 0.1, dtype=np.float32)
NEGATIVE_SIGMA[FLOW.valid] = -0.1

RULES: dict[str, tuple[dict[str, Any], str]] = {
    "subnormal density": ({"density": 5e-324}, "density must be from 1e-30 to 1e+30, got"),
    "huge density": ({"density": 1e308}, "density must be from 1e-30 to 1e+30, got"),
    "huge gravity": ({"gravity": (0.0, -1e308)}, "gravity must be two finite numbers"),
    "long unit": ({"length_unit": "m" * 65}, "length_unit must be the name of a unit, 1 to 64"),
    "empty unit": ({"time_unit": ""}, "time_unit must be the name of a unit, 1 to 64"),
    "u as integers": (
        {"u": np.zeros(FLOW.u.shape, int)},
        "u must be float32 or float64 [T, Y, X], got int64 [12",
    ),
    "p of other size": ({"p": FLOW.p[:, 1:]}, "p must be [T, Y, X] = [12, 24, 20], got [12, 23"),
    "x as float32": ({"x": FLOW.x.astype("f4")}, "x must be float64 [X], got float32 [20]"),
    "t in 2D": ({"t": FLOW.t[None]}, "t must be float64 [T], got float64 ["),
    "no frame": ({"t": FLOW.t[:0]}, "t must hold at least 1 value, got 0"),
    "one row": ({"y": FLOW.y[:1]}, "y must hold at least 2 values, got 1"),
    "u as a list": ({"u": [1.0]}, "Flow.u must be a NumPy array, got [1.0]"),
    "NaN in x": (changed("x", 3, np.nan), "x must be from -1e+30 to 1e+30, got nan at index 3"),
    "infinite t": (changed("t", 11, np.inf), "t must be from -1e+30 to 1e+30, got inf"),
    "times beyond all units": (
        {"t": np.linspace(1e307, 1.7e308, FLOW.t.size)},
        "t must be from -1e+30 to 1e+30, got 1e+307 at index 0",
    ),
    "y downwards": ({"y": FLOW.y[::-1].copy()}, "y must increase strictly, got"),
    "x twice": (changed("x", 4, FLOW.x[3]), "x must increase strictly"),
    "c of NaN": (changed("c", (3, 2, 1), np.nan), "c must be from -1e-06 to 1, got nan"),
    "c in percent": ({"c": FLOW.c * 100}, "c must be from -1e-06 to 1, got 100"),
    "c negative": (changed("c", (3, 2, 1), -0.1), "c must be from -1e-06 to 1, got -0.1"),
    "c never 1": ({"c": FLOW.c * np.float32(0.99)}, "got at most 0.99: set c to exactly 1"),
    "no grains at first": (changed("c", 0, 0.0), "c must be 1 at some point of the first frame"),
    "v infinite": (changed("v", (3, 2, 1), np.inf), "v must be from -1e+30 to 1e+30, or NaN"),
    "NaN in u alone": (changed("u", (3, 0, 0), np.nan), "same points, got 1 where only one"),
    "NaN where there are grains": (
        {
            "u": np.where(FLOW.c == 1, np.nan, 1).astype("f4"),
            "v": np.where(FLOW.c == 1, np.nan, 1).astype("f4"),
        },
        "only NaN in 12 of 12 frames",
    ),
    "p of NaN": (
        changed("p", (3, 0, 0), np.nan),
        "to 1e+30, got nan: give it everywhere in the grains",
    ),
    "sigma_u alone": ({"sigma_u": 0.1}, "got no sigma_v"),
    "sigma zero": ({"sigma_u": 0.1, "sigma_v": 0.0}, "sigma_v must be from 1e-30"),
    "sigma negative": (
        {"sigma_u": NEGATIVE_SIGMA, "sigma_v": 0.1},
        "sigma_u must be from 1e-30 to 1e+30, got -0.1",
    ),
    "sigma NaN": ({"sigma_u": np.nan, "sigma_v": 1.0}, "sigma_u must be from 1e-30"),
    "sigma of other size": (
        {"sigma_u": NEGATIVE_SIGMA[1:], "sigma_v": 0.1},
        "sigma_u must be [T, Y, X]",
    ),
    "empty surface": (
        {"surface": Surface(*(np.empty(0) for _ in range(3)))},
        "surface_t must hold at least 1 value",
    ),
    "surface of NaN": (surface("x", with_value(np.nan)), "surface_x must be from -1e+30"),
    "surface pressure of NaN": (surface("p", with_value(np.inf)), "surface_p must be from -1e+30"),
    "surface elsewhere": (surface("x", lambda x: x * 1000), "surface_x must lie within x"),
    "surface at another time": (surface("t", lambda t: t + 9), "surface_t must lie within t"),
    "no grain size": (
        {"grain_diameter": 0.0},
        "grain_diameter must be from 1e-30 to 1e+30, got 0",
    ),
    "density NaN": (
        {"density": np.nan},
        "density must be from 1e-30 to 1e+30, got nan",
    ),
    "no gravity": ({"gravity": (0.0, 0.0)}, "gravity must be two finite numbers"),
    "gravity upwards": ({"gravity": (0.1, 9.81)}, "(g_x, g_y), g_y < 0 as y points up, got"),
    "gravity NaN": ({"gravity": (0.0, np.nan)}, "gravity must be two finite numbers"),
    "eta_max": (
        {"eta_max": np.inf},
        "eta_max must be from 1e-30 to 1e+30, got inf",
    ),
    "eta_min": ({"eta_min": 2e4}, "eta_min must be below eta_max, 10000, got 20000"),
    "true friction": ({"truth": Truth(mu_s=-0.1)}, "true_mu_s must be from 1e-30"),
    "attribute": ({"attributes": {"list": [1, 2]}}, "attribute 'list' must be one number or text"),
    "attribute name": ({"attributes": {"a/b": 1}}, "attribute 'a/b' must be one number or text"),
}


WALLS: dict[str, tuple[Walls, str]] = {
    "y alone is NaN": (line((0, 0), (1, NAN), (2, 0)), "must be NaN at the same points"),
    "infinite x": (line((0, 0), (np.inf, 0)), "wall_x must be from"),
    "other unit": (line((0, 0), (2000, 0)), "wall_x must lie within x"),
    "huge": (line((-1e308, 0), (1e308, 0)), "wall_x must be from"),
    "a piece of one point": (
        line((0, 0), (2, 0), (NAN, NAN), (0, 1)),
        "at least two points that differ, got none in that at index 3",
    ),
    "only NaN": (
        line((NAN, NAN), (NAN, NAN)),
        "at least two points that differ, got none in that at index 0",
    ),
    "no point": (Walls(np.empty(0), np.empty(0)), "wall_x must hold at least 1 value"),
    "one place": (line((1, 1), (1, 1)), "at least two points that differ"),
    "short": (Walls(np.zeros(2), np.zeros(3)), "wall_y must be [m] = [2], got [3]"),
    "u alone": (replace(FLOOR, u=full(1.0)), "wall_u and wall_v must come together, got no wall_v"),
    "velocity of NaN": (
        replace(FLOOR, u=full(1.0), v=full(NAN)),
        "wall_v must be from",
    ),
    "half slip": (replace(FLOOR, slip=single(0, 0.5)), "wall_slip must be 0 where grains move"),
    "slip of NaN": (replace(FLOOR, slip=single(0, NAN)), "wall_slip must be from 0 to 1, got nan"),
    "pull": (replace(FLOOR, p=single(1, -1)), "wall_p must be from 0 to 1e+30, or NaN"),
    "infinite pressure": (
        replace(FLOOR, p=single(1, np.inf)),
        "wall_p must be from 0 to 1e+30, or NaN",
    ),
    "signed": (replace(FLOOR, p=single(1, -1)), "wall_p must be from 0 to 1e+30, or NaN"),
    "rounded": (replace(FLOOR, x=single(0, 2)), "wall_x must be float64 [m], got float32"),
}
RULES |= {f"walls: {name}": ({"walls": walls}, text) for name, (walls, text) in WALLS.items()}


def test_the_flow_for_tests_keeps_every_rule() -> None:
    check_flow(FLOW)
    assert FLOW.valid.sum() > 1000


@pytest.mark.parametrize(("changes", "message"), RULES.values(), ids=RULES.keys())
def test_broken_rule_is_named(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(FlowFileError) as caught:
        check_flow(replace(FLOW, **changes))
    text = str(caught.value)
    assert message in text
    assert ": " in text or "; " in text, "the sentence must end in what to do"
    assert "\n" not in text


def test_what_is_allowed() -> None:
    gaps = FLOW.valid & (np.arange(FLOW.u.size).reshape(FLOW.u.shape) % 7 == 0)
    rounding = FLOW.c.copy()
    rounding[FLOW.c == 0] = -4e-13
    allowed: Flow = replace(FLOW, **both(gaps, np.nan), c=rounding, eta_min=0.0)
    check_flow(allowed)
    check_flow(replace(FLOW, p=np.where(FLOW.c == 1, FLOW.p, np.nan).astype("f4")))


@pytest.mark.parametrize("value", [True, False])
def test_a_truth_value_of_h5py_is_a_number(value: bool, tmp_path: Path) -> None:
    """h5py writes it as an enumeration."""
    path = tmp_path / "flow.h5"
    write_flow(make_flow(), path)
    with h5py.File(path, "r+") as file:
        file.attrs["steady"] = value
        file.attrs["lit"] = value
    flow = read_flow(path)
    assert flow.attributes["steady"] == int(value)
    assert flow.attributes["lit"] == int(value)
    assert flow.steady is value


@pytest.mark.parametrize("columns", [2, 3, 5, 12])
def test_a_line_from_edge_to_edge_of_few_columns_is_accepted(columns: int) -> None:
    """The edges lie half a cell outside of the cell centers."""
    flow = make_flow(columns=columns, frames=2)
    width = 2.0 / columns
    line = Surface(np.repeat(flow.t, 2), np.tile([0.0, 2.0], 2), np.full(4, 0.9))
    check_flow(replace(flow, surface=line))
    far = replace(line, x=line.x + np.tile([-2 * width, 2 * width], 2))
    with pytest.raises(FlowFileError, match="surface_x must lie within x"):
        check_flow(replace(flow, surface=far))
