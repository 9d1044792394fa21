"""The answers of the study of several flows, from records of known errors."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bench.studies.one_law import table
from bench.studies.one_law.flows import I0, pair

TRUTH = [0.4, 0.6, 0.3]


def parameters(theta: list[float], half: float = 0.1) -> dict[str, Any]:
    pairs = zip(table.NAMES, theta, strict=True)
    return {
        name: {"value": v, "fixed": False, "interval_90": [v - half, v + half]} for name, v in pairs
    }


def record(theta: list[float]) -> dict[str, Any]:
    ranges = ((0.01, 0.1), (0.1, 0.6))
    flows = [
        {
            "I_range": list(I),
            "known": [[i / (i + 0.3) for i in I], TRUTH[:2]],
            "parameters": parameters([0.4, 0.66, 0.3]),
        }
        for I in ranges
    ]
    return {
        "truth": TRUTH,
        "joint": {"parameters": parameters(theta)},
        "flows": flows,
        "apart": flows,
        "shared_law": {"p_value": 0.002},
    }


def test_a_pair_is_judged_by_its_truth() -> None:
    found = list(table.of_pairs("pair", [record([0.4, 0.6, 0.32]), record([0.4, 0.9, 0.36])]))
    assert "I0 free in 2, within 10 % in 1" in found[0]
    assert "mu_s, mu_2, I0 hold 2/2, 1/2, 2/2" in found[0]
    assert "one law 25.0, 35.4; collapse alone 10.0, 10.0" in found[1]
    assert table.alarms([record(TRUTH)] * 3) == "3 of 3"


def test_errors_of_a_curve_are_those_over_the_ranges_of_all_flows() -> None:
    low, high, rms = table.of_curve(record(TRUTH), np.array([0.44, 0.66, 0.3]))
    assert (low, high, rms) == pytest.approx((10, 10, 10))


def test_the_best_fit_to_laws_that_agree_is_their_law() -> None:
    np.testing.assert_allclose(table.best(record([0.5, 0.8, 0.3])), TRUTH, rtol=1e-3)


def test_flows_of_a_pair_have_one_material() -> None:
    collapse, chute = (task.scene for task in pair(53, 4))
    material = [
        [getattr(s, name) for name in ("mu_s", "mu_2", "I0", "d")] for s in (collapse, chute)
    ]
    assert material[0] == material[1]
    assert I0[0] <= material[0][2] <= I0[1]
    assert pair(54, 4)[0].scene != collapse
