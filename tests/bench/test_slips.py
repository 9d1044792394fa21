"""The planted slips: each is named in the data of the tutorial, and sound data are silent."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from bench.studies.slips.plants import HIDDEN, PLANTS, Plant, some_frames
from bench.studies.slips.run import answer, sound, table, tutorial
from granpinn.data import Flow
from granpinn.inspection.slips import slips
from tests.flows import make_channel, make_chute

# What the sentence of a slip names, by the group of the slip.
NAMES = {
    "scale": ("scale",),
    "rate": ("frame rate",),
    "unit": ("units of", "same unit"),
    "direction": ("upside down", "wrong sign", "turned", "gravity", "swapped", "backward"),
    "frames": ("backward", "repeat", "frames are doubled or lost", "frames are missing"),
    "material": ("grain_diameter", "grain diameter", "grain_density", "gravity"),
    "surface": ("surface",),
}


@pytest.fixture(scope="module")
def film() -> Flow:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return tutorial()


def test_there_are_30() -> None:
    assert len({plant.name for plant in PLANTS}) == len(PLANTS) >= 30
    assert {plant.group for plant in PLANTS} == set(NAMES)


@pytest.mark.parametrize("plant", PLANTS, ids=lambda plant: plant.name)
def test_a_slip_is_named(film: Flow, plant: Plant) -> None:
    found = answer(film, plant)
    assert found is not None
    assert found["severity"] != "silent"
    assert any(name in found["text"] for name in NAMES[plant.group]), found["text"]
    assert "\n" not in found["text"]


@pytest.mark.parametrize("plant", HIDDEN, ids=lambda plant: plant.name)
def test_what_physics_cannot_show_is_silent(film: Flow, plant: Plant) -> None:
    found = answer(film, plant)
    assert found is not None
    assert found["severity"] == "silent"


def test_two_lost_frames_of_a_hundred_are_named(film: Flow) -> None:
    fewer = some_frames(np.delete(np.arange(100), [20, 21]), film)
    (found,) = slips(fewer)
    assert "between frames 20 and 21" in found.text
    assert "times as far as its velocity takes it" in found.text


def test_sound_flows_are_silent(film: Flow) -> None:
    for flow in (film, make_chute(), make_channel()):
        assert sound(flow) == []


def test_the_table_has_a_row_for_each_slip(film: Flow) -> None:
    plant = PLANTS[0]
    found = {
        "named": {plant.name: {"tutorial": answer(film, plant)}},
        "hidden": {},
        "false_alarms": {"tutorial": ["improbable: nothing"]},
    }
    lines = table(found).splitlines()
    assert lines[0].endswith("tutorial")
    assert lines[2].split() == ["scale", "x", "10", "i"]
    assert lines[3] == "false alarm, tutorial: improbable: nothing"


def test_a_slip_without_sense_has_no_answer() -> None:
    steady = make_chute(frames=1, surface=None)
    senseless = [plant for plant in PLANTS if plant.group in ("frames", "surface")]
    assert len(senseless) == 9
    assert all(answer(steady, plant) is None for plant in senseless)
