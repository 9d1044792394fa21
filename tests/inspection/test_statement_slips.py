"""Statements beyond what the flow bounds: a word in `inspect`, a reason in the verdict."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from granpinn.data import Flow, check_flow
from granpinn.data.symmetry import with_layer
from granpinn.inspection import quick
from granpinn.results.record import IMPROBABLE, UNUSUAL
from tests.flows import make_chute, make_flow

HEAP = make_flow()


def stating(**attributes: Any) -> Callable[[], Flow]:
    return lambda: make_flow(attributes=attributes)


def empty_frames() -> Flow:
    flow = make_flow()
    c = flow.c.copy()
    c[1::2] = 0
    return replace(flow, c=c)


def zeros_for_gaps() -> Flow:
    flow = make_flow()
    gaps = flow.valid & (np.arange(flow.u.size).reshape(flow.u.shape) % 50 == 0)
    return replace(flow, u=np.where(gaps, 0, flow.u), v=np.where(gaps, 0, flow.v))


ABSURD: dict[str, tuple[Callable[[], Flow], str, str]] = {
    "cell of the solver": (
        stating(grid_spacing_of_solver=20.0),
        IMPROBABLE,
        "grid_spacing_of_solver is 20, and the grains are 0.963 high: check its unit",
    ),
    "averaging length": (stating(averaging_length_of_solver=20.0), IMPROBABLE, "is 20, and the gr"),
    "error of the line": (stating(surface_sd=0.9), UNUSUAL, "surface_sd is 0.9, and the grains"),
    "side walls": (stating(wall_gap=1e-6), IMPROBABLE, "wall_gap is 1e-06, and a grain is 0.025"),
    "period": (stating(period_x=1e9), UNUSUAL, "period_x is 1e+09, and x spans 1.9"),
    "large sigma": (
        lambda: make_flow(sigma_u=1e6, sigma_v=1e6),
        UNUSUAL,
        "standard deviation of the velocity, 1e+06, is larger than the largest speed",
    ),
    "small sigma": (
        lambda: make_flow(sigma_u=1e-20, sigma_v=1e-20),
        UNUSUAL,
        "check the unit of sigma_u and sigma_v",
    ),
    "frames": (empty_frames, IMPROBABLE, "5 frames between others hold no grains"),
    "zeros": (zeros_for_gaps, UNUSUAL, "vectors are exactly zero: if there was no vector, write"),
    "level chute": (
        lambda: with_layer(make_chute(gravity=(0.0, -1.0))),
        IMPROBABLE,
        "gravity has no component along x, so that nothing drives it",
    ),
}


@pytest.mark.parametrize("what", ABSURD)
def test_an_absurd_statement_gets_a_word(what: str) -> None:
    make, severity, text = ABSURD[what]
    flow = make()
    check_flow(flow)
    found = [slip for slip in quick(flow).slips if text in slip.sentence]
    assert [slip.grade for slip in found] == [severity]


@pytest.mark.parametrize("flow", [make_flow(), make_chute()], ids=["heap", "chute"])
def test_sound_statements_get_none(flow: Flow) -> None:
    stated = {"grid_spacing_of_solver": 0.05, "averaging_length_of_solver": 0.04}
    stated |= {"surface_sd": 0.01, "wall_gap": 0.5} if flow.length_unit == "m" else {}
    assert quick(with_layer(replace(flow, attributes=flow.attributes | stated))).slips == ()
