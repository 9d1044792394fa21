"""The coverage study on flows of every shape, and what the table says of other data."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from bench.studies.coverage import judge, materials, other_data
from bench.studies.coverage.judge import Case
from granpinn.arrays import Float64
from granpinn.results.records import Members
from granpinn.uncertainty import calibration, error_bars, held
from granpinn.uncertainty.misfit_growth import MisfitGrowth
from tests.examples import residuals_with

MU = (0.4, 0.64)


def moment(
    base: calibration.Calibration, at: held.Held, reach: held.ReachError, noise: held.NoiseError
) -> Float64:
    """The second moment [2, 2] of z of a flow of the law `MU` by these entries."""
    C = held.carried(np.array(base.discrepancy[0]), MU, at.x, reach)
    return C + held.by_noise(MU, at, noise) if at.noise else C


def sd_of_ends(
    base: calibration.Calibration, at: held.Held, reach: held.ReachError, noise: held.NoiseError
) -> Float64:
    """The standard deviations of mu at the ends of the range of I [2]."""
    T = held.relative(at.x, MU)
    return np.asarray(np.sqrt(np.diag(T @ moment(base, at, reach, noise) @ T.T)))


def test_errors_on_other_data_are_recovered() -> None:
    """Flows with errors of known size at the ends of their range of I, without and with noise."""
    generator = np.random.default_rng(5)
    usual = (0.015, 0.28)
    base = dataclasses.replace(
        calibration.load(),
        widening=(1.0, 1.0),
        mu_s=(0.4,),
        discrepancy=(((4e-5, 0.0), (0.0, 9e-4)),),
        scatter=((1e-12, 0.0), (0.0, 1e-12)),
        discrepancy_weight=1e6,
        shorter=(),
        misfit=1.0,
    )

    of_reach = held.ReachError(usual, (1.0, 1.0), (0.0, 1.5), 1, "here")
    of_noise = held.NoiseError((0.02, 0.04), (1.0, 0.8), -0.6, 60_000.0, 1, "here")

    def flows(count: int, noise: float) -> list[Case]:
        made = []
        for _ in range(count):
            x = (0.01, float(generator.uniform(0.2 if noise else 0.1, 0.28)))
            at = held.Held(x, noise, 60_000.0)
            C = moment(base, at, of_reach, of_noise)
            z = generator.multivariate_normal([0, 0], C)
            residuals = residuals_with(noise or 1e-3, noise, momentum=1e-3, constitutive=1e-3)
            members = Members((0,), {"mu_s": (0.4,), "mu_2": (0.64,)}, (False,))
            true = np.array(MU) - 0.4 * z
            made.append(Case(materials.LAW, true, members, residuals, 10**6, at))
        return made

    at_usual = [flows(1, 0.0)[0]._replace(held=held.Held(usual))]
    noisy = [case for noise in (0.05, 0.2, 0.6) for case in flows(80, noise)]
    table = other_data.fit(at_usual, flows(150, 0.0), noisy, [], base, "made up")
    assert table.reach is not None
    assert table.noise is not None
    np.testing.assert_allclose(table.reach.power[1], 1.5, atol=0.4)
    np.testing.assert_allclose(table.reach.size, 1, atol=0.25)
    for noise in (0.05, 0.2, 0.6):  # the whole errors at the ends of the range, with their noise
        at = held.Held((0.01, 0.25), noise, 60_000.0)
        found, true = (
            sd_of_ends(base, at, *entries)
            for entries in ((table.reach, table.noise), (of_reach, of_noise))
        )
        np.testing.assert_allclose(found, true, rtol=0.3)
    assert -0.75 < table.noise.correlation < -0.3
    scores = [judge.score(case, table) for case in flows(200, 0.1)]
    assert 0.84 < np.mean([s.covered for s in scores]) < 0.97

    known = dataclasses.replace(table.noise, size=(1e-3, 1e-3), power=(0.9, 0.9))
    again = other_data.fit(at_usual, flows(150, 0.0), noisy, [], base, "here", known)
    assert again.noise is not None
    assert again.noise.power == known.power
    assert min(again.noise.size) > 5 * known.size[0]
    assert again.noise.provenance == "made up; sizes: here"
    kept = other_data.fit(at_usual, flows(150, 0.0), [], [], base, "here", known)
    assert kept.noise == known


def test_the_growth_with_the_misfit_is_recovered() -> None:
    """Films whose errors grow with the root of the part of their misfit that is not noise.

    Their residuals imply 2 to 8 times the misfit of the table, a quarter of their own.
    """
    generator = np.random.default_rng(6)
    base = dataclasses.replace(
        calibration.load(),
        widening=(1.0, 1.0),
        mu_s=(0.4,),
        discrepancy=(((4e-5, 0.0), (0.0, 4e-5)),),
        scatter=((1e-12, 0.0), (0.0, 1e-12)),
        discrepancy_weight=1e6,
        shorter=(),
        noise=None,
        reach=None,
    )
    made = []
    for _ in range(400):
        shown = float(generator.uniform(2, 8)) * base.misfit
        least = error_bars.LEAST_RESIDUAL
        own = {n: least * 10**r.intercept * shown**r.slope for n, r in base.residuals.items()}
        residuals = residuals_with(4 * shown, **own)
        limits = {n: dataclasses.replace(r, limit=1e9) for n, r in base.residuals.items()}
        base = dataclasses.replace(base, residuals=limits)
        s = error_bars.unresolved(residuals, base, MisfitGrowth(0.5, 10.0, 0.3, 1, "made up"))
        z = generator.multivariate_normal([0, 0], s**2 * np.array(base.discrepancy[0]))
        members = Members((0,), {"mu_s": (0.4,), "mu_2": (0.64,)}, (False,))
        true = np.array([0.4, 0.64]) - 0.4 * z
        made.append(Case(materials.LAW, true, members, residuals, 10**6, None))
    found = other_data.growth_with_misfit(made, base, "made up")
    assert found is not None
    assert found.power == pytest.approx(0.5, abs=0.1)
    assert found.largest == pytest.approx(8, rel=0.02)
    assert found.implied == pytest.approx(0.25)
    for mu, power in (((0.4, 0.64), 0.0), ((0.3, 0.64), 1.0)):  # no errors, and hopeless ones
        cases = [case._replace(mu=np.array(mu)) for case in made]
        found = other_data.growth_with_misfit(cases, base, "made up")
        assert found is not None
        assert found.power == power


def test_a_varied_study_draws_the_flows_too() -> None:
    first, second = (
        materials.draw(8, 0, 3, varied=True, noisy=True, cells=256, threads=1) for _ in range(2)
    )
    usual = materials.draw(8, 0, 3, cells=256, threads=1)
    assert first == second
    assert [t.scene.mu_s for t in first] == [t.scene.mu_s for t in usual]
    for task in first:
        c = task.scene
        assert materials.I0[0] <= c.I0 <= materials.I0[1]
        assert materials.ASPECT[0] <= c.aspect <= materials.ASPECT[1]
        assert task.noise is not None
        assert materials.NOISE[0] <= task.noise <= materials.NOISE[1]
    assert len({(t.scene.stride, t.scene.frames, t.noise) for t in first}) == 8
