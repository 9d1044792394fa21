"""The four flows of bench.units_invariance are one flow, and the study compares the right ones."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from bench.units_invariance import PAIRS, cases, study, table
from granpinn import Config
from granpinn.config import Batch, Network
from granpinn.data import Flow, TrainingSet, training_set
from granpinn.scales import Scales

TILT = 3.0


@pytest.fixture(scope="module")
def flows() -> dict[str, Flow]:
    return cases(every=25, degrees=TILT)


def posed(flow: Flow) -> tuple[TrainingSet, float]:
    scales = Scales.from_flow(flow)
    return training_set(flow, scales, "V1", torch.float64), scales.material(flow).grain_diameter


@pytest.mark.parametrize(("ours", "theirs", "angle"), [(*PAIRS[0], 0.0), (*PAIRS[1], TILT)])
def test_the_training_sets_agree(
    flows: dict[str, Flow], ours: str, theirs: str, angle: float
) -> None:
    """To 1e-6, the rounding of float32 velocities, once the tilt is turned back."""
    (expected, d), (found, d_found) = posed(flows[ours]), posed(flows[theirs])
    assert d_found == pytest.approx(d, rel=1e-6)
    cos, sin = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    for name in ("points", "velocity", "surface_points"):
        a, b = getattr(found, name).numpy(), getattr(expected, name).numpy()
        assert len(a) > 100
        back = a.copy()
        back[:, 0], back[:, 1] = cos * a[:, 0] + sin * a[:, 1], cos * a[:, 1] - sin * a[:, 0]
        np.testing.assert_allclose(back, b, atol=1e-6 * np.abs(b).max(), err_msg=name)


def test_units_are_si_and_gravity_is_turned(flows: dict[str, Flow]) -> None:
    for name in ("grid_mm", "particles_mm_tilted"):
        assert (flows[name].length_unit, flows[name].time_unit) == ("m", "s")
    assert flows["particles_mm_tilted"].gravity[0] == pytest.approx(
        9.81 * math.sin(math.radians(TILT))
    )


def test_study_of_units(flows: dict[str, Flow]) -> None:
    """Few steps do not yet amplify rounding: the grids agree to 0.1 %."""
    config = Config(steps=4, network=Network(widths=(16, 16)), batch=Batch(64, 16))
    found = study(flows, config, [0, 1])
    difference = found["difference_percent"]["grid_mm against grid"]
    assert max(map(abs, difference["mu_s"] + difference["mu_2"])) < 0.1
    assert [len(row["mu_s"]) for row in found["values"].values()] == [2] * 4
    assert "spread over the seeds, particles_mm_tilted" in table(found)
