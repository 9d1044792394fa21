"""The errors of trainings beyond their scatter, by mu_s: the knots of a table."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from bench.studies.coverage.judge import Case
from granpinn.uncertainty import calibration, error_bars
from granpinn.uncertainty.calibration import Calibration
from granpinn.uncertainty.center import center as center_of

Array = npt.NDArray[np.float64]

KNOTS = (0.2, 0.4, 0.5, 0.6)  # mu_s; above 0.5 the errors grow fast (ill-posedness)
POOLED = 30.0  # flows of all mu_s that count at each of the knots, which has few of its own


def with_discrepancy(table: Calibration, cases: Sequence[Case]) -> Calibration:
    """Second moments of z beyond the scatter, over s^2, averaged around each knot.

    Few flows near a knot may leave almost no error at one end of the range of I, which grows to
    next to nothing in other flows: so the mean of all flows counts too. No case has fewer steps
    than the table, so s is that of its residuals.
    """
    beyond, mu_s = [], []
    for case in cases:
        center = np.array(center_of(case.members))
        z = (center - case.mu) / center[0]
        scale = error_bars.unresolved(case.residuals, table, table.growth)
        scatter, _ = error_bars.scatter(case.members, table)
        beyond.append((np.outer(z, z) - scatter) / scale**2)
        mu_s.append(center[0])
    matrices, counts = [], []
    for at in np.eye(len(KNOTS)):
        weights = np.interp(mu_s, KNOTS, at) + POOLED / len(cases)
        matrices.append(matrix(np.tensordot(weights, np.array(beyond), 1) / weights.sum()))
        counts.append(weights.sum() ** 2 / np.sum(weights**2))
    return dataclasses.replace(
        table,
        mu_s=KNOTS,
        discrepancy=_not_falling(matrices),
        discrepancy_weight=float(min(counts)),
    )


def at_least(D: Array, usual: calibration.Matrix) -> calibration.Matrix:
    """D with variances of at least those of `usual`; with its correlation where D has none."""
    least = np.diag(usual)
    if (np.diag(D) <= 1e-3 * least).any():
        D = np.array(usual)
    factor = np.sqrt(np.maximum(1.0, least / np.maximum(np.diag(D), 1e-300)))
    return matrix(D * np.outer(factor, factor))


def _not_falling(matrices: Sequence[calibration.Matrix]) -> tuple[calibration.Matrix, ...]:
    """The discrepancies at the knots, with errors of mu_s that do not fall as mu_s grows.

    On 256 cells two errors of opposite sign cancel at mu_s above 0.5. On finer cells the negative
    one grows, that of shear bands.
    """
    least, found = 0.0, []
    for D in matrices:
        least = max(least, D[0][0])
        found.append(at_least(np.array(D), ((least, 0.0), (0.0, D[1][1]))))
    return tuple(found)


def matrix(values: Array) -> calibration.Matrix:
    """The nearest symmetric matrix without negative eigenvalues."""
    size, directions = np.linalg.eigh((values + values.T) / 2)
    a = directions * np.maximum(size, 0.0) @ directions.T
    return (float(a[0, 0]), float(a[0, 1])), (float(a[0, 1]), float(a[1, 1]))
