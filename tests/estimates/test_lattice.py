"""Rounded vectors show their lattice, and count as noisy as their rounding."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from granpinn.data import Flow
from granpinn.data.scaling import scales_of
from granpinn.estimates.facts import Facts
from granpinn.estimates.lattice import ROUNDING, lattice_step
from granpinn.inspection import quick
from tests.flows import make_flow
from tests.inspection.falling import falling


def rounded(step: float, scatter: float = 0.0) -> Flow:
    """A flow with vectors on a lattice, and how far they scatter about it in steps."""
    flow, rng = make_flow(), np.random.default_rng(3)
    parts: dict[str, Any] = {}
    for name in ("u", "v"):
        values = np.rint(rng.normal(0, 0.4, flow.u.shape) / step) * step
        parts[name] = (values + scatter * step * rng.normal(size=values.shape)).astype(np.float32)
    return replace(flow, **parts)


@pytest.mark.parametrize("scatter", [0.0, 0.01])
@pytest.mark.parametrize("step", [0.2, 0.1, 0.02])
def test_the_step_is_found(step: float, scatter: float) -> None:
    flow = rounded(step, scatter)
    assert lattice_step(flow) == pytest.approx(step, rel=0.01)
    least = ROUNDING * step / scales_of(flow).velocity
    noise = Facts(flow, scales_of(flow)).noise.sigma
    assert noise is not None
    assert noise >= least * 0.99
    assert any("peak locking" in slip.sentence for slip in quick(flow).slips)


def sheared() -> Flow:
    """A flow whose vectors change by one step from row to row."""
    flow = make_flow()
    u = np.broadcast_to(np.arange(1.0, flow.y.size + 1)[:, None], flow.u.shape).astype(np.float32)
    return replace(flow, u=0.01 * u, v=-0.02 * u)


@pytest.mark.parametrize("flow", [make_flow(), falling(), falling(noise=0.01), sheared()])
def test_no_lattice_in_sound_data(flow: Flow) -> None:
    """Nor in a body that falls, whose frames have one velocity each, nor in an even shear."""
    assert lattice_step(flow) == 0
