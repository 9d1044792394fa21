"""A flow between side walls gives its law with their friction, and a wrong one without it."""

from __future__ import annotations

import numpy as np
import pytest

from granpinn import identify
from granpinn.results import Result
from granpinn.training.progress import Silent
from tests.flows import make_channel
from tests.runs import tiny

FRICTION = 0.3
RANGE = np.array([0.05, 0.1, 0.2])  # I of the flow: 0.04 to 0.3


def identified(friction: float) -> Result:
    settings = {
        "steps": 4000,
        "network__widths": (32, 32),
        "batch__interior": 256,
        "batch__surface": 16,
        "walls__friction": friction,
    }
    return identify(make_channel(friction=FRICTION, rows=120), tiny(**settings))


def mu(mu_s: float, mu_2: float, I0: float) -> np.ndarray:
    return mu_s + (mu_2 - mu_s) / (1 + I0 / RANGE)


class Notes(Silent):
    """Keeps the messages of a run."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    def message(self, text: str) -> None:
        self.texts.append(text)


@pytest.mark.parametrize(("friction", "said"), [(FRICTION, True), (0.0, False)])
def test_a_training_says_what_friction_it_takes(friction: float, said: bool) -> None:
    notes = Notes()
    identify(make_channel(rows=14), tiny(walls__friction=friction), progress=notes)
    assert ("side walls: their friction 0.3 is in the equations" in notes.texts) == said


def test_the_friction_of_the_walls_is_told_from_that_of_the_grains() -> None:
    truth = mu(0.3, 0.7, 0.3)
    with_walls = identified(FRICTION)
    np.testing.assert_allclose(mu(*with_walls.theta), truth, rtol=0.02)
    assert with_walls.settings["walls"] == {"friction": FRICTION, "friction_sd": 0.035}
    assert with_walls.baseline is not None
    assert with_walls.baseline.wall_friction == FRICTION
    # without the term, the walls count as friction between grains: mu_w z / W = 0.12 on average
    without = identified(0.0)
    assert (mu(*without.theta) - truth)[:2].min() > 0.06
    assert without.theta[0] == pytest.approx(0.5, abs=0.05)  # the slope, at every depth
