"""The comparison of the laws on halves of the data, and its words."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from granpinn.config import Config
from granpinn.physics.laws import DEFAULT, LAWS, Law
from granpinn.results import Timing
from granpinn.results.parts import SPLITS, Part, Parts, Split
from granpinn.results.records import Verdict
from granpinn.training.parts import HalfLaws
from granpinn.uncertainty import calibration
from granpinn.uncertainty.of_parts import (
    LEVEL,
    TELLING,
    Place,
    compared,
    error_of_collapses,
    judged,
    of_halves,
    verdict,
)
from tests.examples import make_result

TABLE = calibration.load()
THETA = (0.4, 0.64, 0.3)


def halves(
    name: str = "time",
    factor: float = 1.0,
    sd: float = 0.01,
    boxes: int = 200,
    ranges: tuple[tuple[float, float], ...] = ((0.01, 0.2), (0.02, 0.3)),
    generator: np.random.Generator | None = None,
    law: tuple[float, float, float] = THETA,
) -> HalfLaws:
    """Halves whose friction differs by a factor, with errors of both parameters in every box."""
    draw = generator or np.random.default_rng(3)
    theta = np.array([law, law])
    theta[1, :2] *= factor
    sizes = []
    for count in (boxes, boxes // 4):
        # Each half has the variance sd^2 / 2 in relative friction.
        common = draw.standard_normal((count, 2)) * sd / np.sqrt(2 * count)
        sizes.append(torch.as_tensor(common[:, :, None] * np.array(law[:2])))
    return HalfLaws(
        name,
        torch.as_tensor(theta),
        tuple(sizes),
        torch.tensor(ranges, dtype=torch.float64),
        torch.tensor([0.5, 0.5], dtype=torch.float64),
    )


def test_more_friction_in_one_half_is_named() -> None:
    parts = compared([halves(factor=1.15), halves("side")], DEFAULT, TABLE, None)
    assert [split.name for split in parts.different] == ["time"]
    (split,) = parts.different
    assert split.percent == pytest.approx(15, abs=1e-6)
    assert "late times need 15 % more friction than early times" in str(parts)
    less = compared([halves("height", factor=1 / 1.25)], DEFAULT, TABLE, None)
    assert "grains near the floor need 25 % more friction than grains near" in str(less)


def test_curves_are_compared_where_both_are_known() -> None:
    (split,) = compared([halves()], DEFAULT, TABLE, None).splits
    assert split.I is not None
    assert 0.02 <= split.I <= 0.2
    apart = halves(factor=2.0, ranges=((0.01, 0.02), (0.05, 0.3)))
    parts = compared([apart], DEFAULT, TABLE, None)
    assert parts.splits[0].percent is None
    assert not parts.different
    assert "hold no common I" in str(parts.splits[0])


@pytest.mark.parametrize("kind", [None, "collapse", "steady"])
def test_the_error_of_the_law_is_no_violation(kind: str | None) -> None:
    assert TABLE.halves is not None
    (split,) = compared([halves(sd=1e-6)], DEFAULT, TABLE, kind).splits
    assert split.std_percent is not None
    assert split.model_percent is not None
    assert split.std_percent == pytest.approx(split.model_percent, rel=1e-2)
    grains = TABLE.model_error.get(kind or "")
    # Each half has half of the data.
    square = 0.0 if grains is None else 4 * grains.level**2
    square += 0.0 if kind == "steady" else TABLE.halves.sd["time"] ** 2
    assert split.std_percent > 99 * np.sqrt(square)


def test_without_halves_in_the_table_the_error_of_the_whole_law_counts_twice() -> None:
    table = dataclasses.replace(TABLE, halves=None)
    (split,) = compared([halves(sd=1e-6)], DEFAULT, table, None).splits
    assert split.I is not None
    of_law = error_of_collapses(TABLE, place(split.I, slow=0.4))
    assert split.model_percent == pytest.approx(200 * np.sqrt(of_law[0]), rel=0.3)


def test_trainings_unlike_those_of_the_study_have_no_smaller_error() -> None:
    """In a table whose errors at mu_s = 0.6 cross zero at I = 0.03."""
    crossing = ((9.03e-6, -8.53e-5), (-8.53e-5, 8.16e-4))
    last = (*TABLE.discrepancy[:-1], crossing)
    table = dataclasses.replace(TABLE, discrepancy=last)
    law, at = (0.6, 0.84, 0.3), place(0.03, slow=0.6)
    assert 100 * np.sqrt(error_of_collapses(table, at)[0]) < 0.1
    narrow = halves(factor=1.006, sd=1e-6, law=law, ranges=((0.01, 0.06), (0.02, 0.09)))
    alone = dataclasses.replace(table, halves=None)
    (split,) = compared([narrow], DEFAULT, alone, None).splits
    assert split.differs
    (split,) = compared([narrow], DEFAULT, table, None, alike=False).splits
    assert not split.differs
    for I, larger in ((0.03, "halves"), (0.3, "whole law")):  # noqa: E741
        at, residuals = place(I, slow=0.4), np.ones(1)
        (like,), (unlike,), (whole,) = (
            of_halves(own, None, at, "side", residuals, 4.0, alike) or ()
            for own, alike in ((table, True), (table, False), (alone, False))
        )
        assert unlike.value == max(like.value, whole.value), larger


def test_the_error_of_halves_counts_in_trainings_like_those_of_its_study() -> None:
    assert TABLE.halves is not None
    result = make_result(timing=Timing(wall_s=1.0, steps=40_000, steps_per_s=1.0))

    def error(noise: float, steps: int = 40_000, **settings: object) -> float:
        timing = dataclasses.replace(result.timing, steps=steps)
        config = Config(**settings)  # type: ignore[arg-type]
        given = dataclasses.replace(result, timing=timing)
        found = judged(given, [halves(sd=1e-6)], config, None, noise)
        assert found.parts is not None
        return found.parts.splits[0].model_percent or 0.0

    own = pytest.approx(100 * TABLE.halves.sd["time"], rel=1e-3)
    assert error(0.06) == own
    for other in (error(0.0), error(0.3), error(0.06, 5000), error(0.06, form="strong")):
        assert other > own.expected


def test_drums_of_grains_differ_by_more() -> None:
    steady = compared([halves(factor=1.15)], DEFAULT, TABLE, "steady")
    assert not steady.different  # drums of grains were 5 % wrong


def place(*numbers: float, slow: float = 0.6) -> Place:
    I = np.array(numbers)  # noqa: E741
    mu = slow + 0.2 * I / (I + 0.3)
    return Place(I, mu, np.linspace(-1, 1, len(I)), slow, 0.3)


def test_the_error_of_friction_is_not_that_of_mu_s() -> None:
    """Errors of mu_s and mu_2 cancel within the I of a collapse; of steep materials above all."""
    D = ((5e-4, -1.7e-3), (-1.7e-3, 6.7e-3))
    table = dataclasses.replace(TABLE, discrepancy=(D,) * len(TABLE.mu_s))
    below, within = error_of_collapses(table, place(1e-6, 0.08))
    assert below == pytest.approx(D[0][0], rel=1e-3)
    assert within < below / 4


def test_grains_have_a_level_and_a_tilt() -> None:
    entry = TABLE.model_error["layer"]
    made = of_halves(TABLE, "layer", place(0.01, 0.02, 0.3), "time", np.ones(3), 4.0)
    assert made is not None
    (found,) = made
    assert found.value[1] == pytest.approx(4 * entry.level**2)
    assert found.value[0] == found.value[2] == pytest.approx(4 * (entry.level**2 + entry.tilt**2))


def test_curves_of_other_slopes_differ() -> None:
    """The same friction in the middle of I, and 20 % less at its end."""
    made = halves(sd=0.01, ranges=((0.01, 0.3), (0.01, 0.3)))
    theta = made.theta.clone()
    x = 0.06 / 0.36  # there both have the same friction
    theta[1, 1] -= 0.15
    theta[1, 0] += 0.15 * x / (1 - x)
    parts = compared([dataclasses.replace(made, theta=theta)], DEFAULT, TABLE, None)
    (split,) = parts.different
    assert pytest.approx(0.3) == split.I or pytest.approx(0.01) == split.I


def test_nothing_is_called_different_where_the_error_of_the_law_is_not_known() -> None:
    assert "carried" not in TABLE.model_error
    parts = compared([halves(factor=1.5)], DEFAULT, TABLE, "carried")
    assert parts.splits[0].percent == pytest.approx(50)
    assert parts.splits[0].limit_percent is None
    assert not parts.different
    before = Verdict(None, "no verdict", {})
    assert verdict(before, parts, DEFAULT, resolved=True) is before


def test_one_law_is_rarely_called_different() -> None:
    """The share of flows of one law with any difference, over 4 splits and 100 draws."""
    draw = np.random.default_rng(11)
    exact = dataclasses.replace(TABLE.halves, sd=dict.fromkeys(SPLITS, 0.0))  # type: ignore[type-var]
    table = dataclasses.replace(TABLE, halves=exact)
    sd, alarms = 0.03, 0
    for _ in range(100):
        every = []
        for name in SPLITS:
            factor = 1 + sd * float(draw.standard_normal())
            every.append(halves(name, factor, sd, generator=draw))
        alarms += bool(compared(every, DEFAULT, table, None).different)
    assert alarms / 100 < LEVEL + 3 * np.sqrt(LEVEL * (1 - LEVEL) / 100)


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
def test_every_law_is_compared(law: Law) -> None:
    theta = torch.tensor([[p.typical for p in law.parameters]] * 2, dtype=torch.float64)
    boxes = torch.full((50, 2, len(law.free)), 1e-5, dtype=torch.float64)
    boxes[::2] *= -1
    boxes[:, 1] *= 2
    made = dataclasses.replace(halves(), theta=theta, influence=(boxes, boxes[:16]))
    (split,) = compared([made], law, TABLE, None).splits
    assert split.percent == pytest.approx(0)
    assert split.std_percent is not None
    assert set(split.parts[0].theta) == set(law.names)


def test_verdict_has_the_answer_of_the_parts() -> None:
    agree = compared([halves(sd=0.02)], DEFAULT, TABLE, None)
    differ = compared([halves(factor=1.2)], DEFAULT, TABLE, None)
    ratios: dict[str, float | None] = {"momentum": 1.2, "constitutive": 0.9}
    good, none = Verdict(True, "nothing contradicts", ratios), Verdict(None, "no answer", ratios)

    contradicted = verdict(good, differ, DEFAULT, resolved=True)
    assert contradicted is not None
    assert contradicted.follows is False
    assert contradicted.words.startswith("these data do not follow one law: no single law: late")
    assert contradicted.ratios == ratios

    noisy = verdict(none, agree, DEFAULT, resolved=False)
    assert noisy is not None
    assert noisy.follows is True
    assert "nothing contradicts mu(I): one law on all parts" in noisy.words

    other = verdict(none, agree, DEFAULT, resolved=True)  # another reason for no answer
    assert other is not None
    assert other.follows is None
    assert other.words.startswith("no answer; one law on all parts")


def test_parts_that_say_little_are_no_answer() -> None:
    vague = compared([halves(sd=TELLING)], DEFAULT, TABLE, None)
    before = Verdict(None, "no answer", {})
    found = verdict(before, vague, DEFAULT, resolved=False)
    assert found is not None
    assert found.follows is None


def test_records_refuse_what_makes_no_sense() -> None:
    part = Part("early times", {"mu_s": 0.4}, 0.01, 0.2, 0.5)
    with pytest.raises(ValueError, match="name must be one of time, rate, height, side"):
        Split("colour", (part, part))
    with pytest.raises(ValueError, match="belong together"):
        Split("time", (part, part), I=0.1)
    assert str(Parts(0.05, ())) == "parts of the data are not compared"
