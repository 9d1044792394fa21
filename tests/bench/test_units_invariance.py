"""The study units_invariance: its four flows are one flow, and it compares the right ones."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import torch

from bench.studies.units_invariance.run import PAIRS, cases, study, table
from granpinn import Config
from granpinn.config import Batch, Network
from granpinn.data import Flow, TrainingSet, read_flow, training_set, write_flow
from granpinn.data.scaling import scales_of
from granpinn.estimates.facts import Facts
from granpinn.training.problem import Problem, build

TILT = 3.0


@pytest.fixture(scope="module")
def flows() -> dict[str, Flow]:
    return cases(every=25, degrees=TILT)


def posed(flow: Flow) -> tuple[TrainingSet, Problem]:
    scales = scales_of(flow)
    data = training_set(flow, scales)
    return data, build(Facts(flow, scales), data, Config())


def require_same(found: TrainingSet, expected: TrainingSet) -> None:
    """The same bits in every array."""
    ours, theirs = found.arrays(), expected.arrays()
    assert ours.keys() == theirs.keys()
    for name, values in theirs.items():
        assert torch.equal(ours[name], values), name


@pytest.mark.parametrize(("ours", "theirs"), PAIRS)
def test_the_problems_are_the_same_bits(flows: dict[str, Flow], ours: str, theirs: str) -> None:
    """Also after a flow file; the original is off by no more than the resolution."""
    (expected, problem), (found, other) = posed(flows[ours]), posed(flows[theirs])
    require_same(found, expected)
    assert len(expected.velocity) > 100
    assert other.spec == problem.spec
    as_float32 = [torch.tensor(p.physics, dtype=torch.float32) for p in (other, problem)]
    assert torch.equal(*as_float32)


def test_a_flow_file_keeps_the_bits(flows: dict[str, Flow], tmp_path: Path) -> None:
    for name in ("grid_mm", "particles_mm_tilted"):
        write_flow(flows[name], tmp_path / "flow.h5")
        again, expected = posed(read_flow(tmp_path / "flow.h5"))[0], posed(flows[name])[0]
        require_same(again, expected)


def test_units_are_si_and_gravity_is_turned(flows: dict[str, Flow]) -> None:
    for name in ("grid_mm", "particles_mm_tilted"):
        assert (flows[name].length_unit, flows[name].time_unit) == ("m", "s")
    assert flows["particles_mm_tilted"].gravity[0] == pytest.approx(
        9.81 * math.sin(math.radians(TILT))
    )


def test_study_of_units(flows: dict[str, Flow]) -> None:
    """The same numbers train alike, whatever the units were."""
    small = {"network": Network(widths=(16, 16)), "batch": Batch(64, 16)}
    config = Config(steps=20, simulated_pressure__frames=0, **small)
    found = study(flows, config, [0, 1])
    for difference in found["difference_percent"].values():
        assert difference == {"mu_s": [0.0, 0.0], "mu_2": [0.0, 0.0]}
    one, other = found["values"]["grid"]["mu_s"]
    assert one != other
    assert [len(row["mu_s"]) for row in found["values"].values()] == [2] * 4
    assert "spread over the seeds, particles_mm_tilted" in table(found)
