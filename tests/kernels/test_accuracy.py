"""K-1: every fused output and derivative, no worse than plain float32 autograd. See accuracy.py.

60 rows of the table run always, without those that take longest; all 500 with `-m long`. K-5: the
CUDA kernels, no worse than the CPU's, on 200 rows: 40 always, the others with `-m long`.
"""

from __future__ import annotations

from types import ModuleType

import pytest

from .accuracy import compare, is_void
from .configurations import OTHERS, Configuration, configuration

ROWS = [configuration(index) for index in range(500)]
SLOW = {5, 7, 9, 10, 13, 14, 18, 21, 23, 35, 37, 39, 50, 55, 59}
USUAL = [*[row for row in ROWS if row.index not in SLOW][:59], ROWS[290]]


@pytest.mark.parametrize(
    "row",
    [row if row in USUAL else pytest.param(row, marks=pytest.mark.long) for row in ROWS],
    ids=str,
)
def test_no_worse_than_float32_autograd(row: Configuration, ops: ModuleType) -> None:
    comparisons = compare(row, ops, most=3 if row in USUAL else 4)
    failed = [comparison for comparison in comparisons if not comparison.passed]
    assert not failed
    assert not [comparison.name for comparison in comparisons if is_void(comparison)]


@pytest.mark.parametrize(
    "row",
    [*ROWS[:40], *(pytest.param(row, marks=pytest.mark.long) for row in ROWS[40:200])],
    ids=str,
)
def test_cuda_no_worse_than_the_cpu(
    row: Configuration, cpu_ops: ModuleType, cuda_ops: ModuleType
) -> None:
    """With the CPU kernels in float64 for the truth: the rule of K-1, without nested autograd."""
    comparisons = compare(row, cuda_ops, cpu_ops)
    assert not [comparison for comparison in comparisons if not comparison.passed]


def test_the_table_covers_what_it_promises() -> None:
    rows = USUAL
    assert len(rows) == 60
    assert {row.points for row in rows} == {1, 31, 33, 65_537}
    assert {len(row.hidden) for row in rows} == set(range(1, 9))
    assert {1, 256} <= {width for row in rows for width in row.hidden}
    assert {row.regime for row in rows} == {"flowing", "low pressure", "slow"}
    assert {row.members for row in rows} == {None, 1, 2, 3}
    assert {row.threads for row in rows} == {1, 2}
    assert {row.form for row in rows if row.points == 65_537} == {"strong", "mixed"}
    assert {(row.form, row.law) for row in rows} >= {
        (form, law) for form in ("strong", "mixed") for law in ("mu_of_i", *OTHERS, "coulomb")
    }
    walls = {(row.form, row.regime) for row in rows if row.side_wall > 0}
    assert walls == {(row.form, row.regime) for row in rows if row.side_wall == 0}
    assert len(walls) == 6
    sources = {(row.form, row.regime) for row in rows if row.source}
    assert sources == walls
