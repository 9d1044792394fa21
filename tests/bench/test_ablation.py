"""The ablation: its variants change what they name, and its rows are errors against known laws."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from bench.studies.ablation import run
from bench.studies.ablation.flows import NOISES, Known, known_file
from bench.studies.ablation.variants import VARIANTS
from granpinn.config import Config
from granpinn.data import Truth, write_flow
from tests.flows import make_flow

LAW = {"mu_s": 0.3, "mu_2": 0.6, "I0": 0.3}
KNOWN = Known("clean", "made", make_flow(), 0.1, LAW, np.array([0.01, 0.1]))
TINY = Config(**{"steps": 10, "network.widths": (8, 8), "batch.interior": 16, "device": "cpu"})


@pytest.mark.parametrize("name", VARIANTS)
def test_a_variant_is_another_training(name: str) -> None:
    variant = VARIANTS[name]
    assert dataclasses.replace(TINY, **variant.settings).steps == TINY.steps
    before = [getattr(place, attribute) for place, attribute, _ in variant.replaced]
    with variant.made():
        for place, attribute, value in variant.replaced:
            assert getattr(place, attribute) == value
            assert value not in before
    assert before == [getattr(place, attribute) for place, attribute, _ in variant.replaced]
    assert variant.settings or variant.replaced or name == "default"


def test_errors_are_those_of_friction_at_the_inertial_numbers() -> None:
    x = np.array([0.01, 0.1]) / (np.array([0.01, 0.1]) + 0.3)
    truth = 0.3 + 0.3 * x
    assert KNOWN.errors(0.33, 0.6, (1, 1)) == pytest.approx((0.33 + 0.27 * x) / truth - 1)


@pytest.mark.parametrize("name", ["default", "momentum_0.03"])
def test_rows_of_a_variant(name: str) -> None:
    (row,) = run.rows_of(name, VARIANTS[name], [KNOWN], [0], TINY)
    low, high = KNOWN.errors(0.3 * (1 + row["mu_s"] / 100), 0.6 * (1 + row["mu_2"] / 100), (1, 1))
    assert (row["low"], row["high"]) == pytest.approx((100 * low, 100 * high), abs=0.05)


def test_the_table_has_every_variant_of_the_raw_rows() -> None:
    rows = run.read_rows(Path(run.__file__).with_name("results") / "rows.csv")
    printed = run.table(rows)
    for name in {row["variant"] for row in rows}:
        assert f"\n{name} " in printed


def test_a_file_of_stated_law_is_one_flow_with_each_noise(tmp_path: Path) -> None:
    path, truth = tmp_path / "flow.h5", Truth(**LAW)
    write_flow(dataclasses.replace(make_flow(), truth=truth, eta_max=1e4), path)
    known = list(known_file(path))
    assert [k.noise for k in known] == list(NOISES.values())
    assert all(k.law == LAW and k.flow.eta_max is None for k in known)


def test_a_file_without_a_law_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "flow.h5"
    write_flow(dataclasses.replace(make_flow(), truth=None), path)
    with pytest.raises(ValueError, match="must state the law"):
        next(known_file(path))
