"""Config: recipes, changes of single settings, ranges, and the settings that identify a run."""

from __future__ import annotations

import dataclasses
import pickle
import re
from typing import Any

import pytest

from granpinn.config import (
    RECIPES,
    Batch,
    Config,
    ConfigError,
    Rheology,
    flatten,
    identity,
    settings_of,
)
from granpinn.physics.terms import TERMS


def test_the_paper_recipe_is_the_section_training_of_the_paper() -> None:
    paper = Config(recipe="paper")
    assert (paper.form, paper.level, paper.epochs, paper.steps) == ("strong", "V2", 20000, None)
    assert paper.network.widths == (250, 250, 250)
    assert paper.batch.interior == 512
    assert paper.optimizer.method == "adam"
    assert paper.optimizer.learning_rate == 5e-4
    assert paper.optimizer.learning_rate * paper.optimizer.final_fraction == pytest.approx(1e-5)
    assert paper.rheology == Rheology(variables="sigmoid", random_start=True)
    assert paper.optimizer.prefit == 0
    assert paper.side_walls.friction == 0
    assert {paper.weights.sigma(term.name) for term in TERMS} == {1.0}


@pytest.mark.parametrize("recipe", RECIPES)
def test_a_config_has_the_settings_of_its_recipe(recipe: str) -> None:
    defaults = {key: stated.default for key, stated in settings_of(Config).items()}
    assert flatten(Config(recipe=recipe)) == defaults | {"recipe": recipe} | RECIPES[recipe]


@pytest.mark.parametrize(
    "given",
    [
        {"level": "V1"},
        {"batch": Batch(interior=256, surface=64)},
        {"batch.interior": 256},
        {"batch__interior": 256},
        {"batch": Batch(surface=64), "batch.interior": 256},
        {"network.widths": [8, 8], "noise": 1},
        {"batch": {"interior": 256, "surface": 64}},
        {"network": {"widths": [8, 8]}, "batch": {"interior": 256}, "batch__surface": 64},
    ],
    ids=str,
)
def test_what_is_given_changes_the_recipe_and_the_rest_stays(given: dict[str, Any]) -> None:
    found = flatten(Config(recipe="paper", **given))
    expected = flatten(Config(recipe="paper"))
    for name, value in given.items():
        key = name.replace("__", ".")
        if isinstance(value, dict):
            expected |= {f"{key}.{inner}": item for inner, item in value.items()}
        else:
            expected |= flatten(value, "batch.") if key == "batch" else {key: value}
    expected["batch.interior"] = given.get("batch.interior", expected["batch.interior"])
    expected["network.widths"] = tuple(expected["network.widths"])
    assert found == expected


def test_replace_changes_one_setting_and_keeps_the_others() -> None:
    config = Config(recipe="paper", level="V1", batch__interior=256)
    changed = dataclasses.replace(config, seed=3)
    assert flatten(changed) == flatten(config) | {"seed": 3}
    narrow = dataclasses.replace(config, **{"network.widths": (8,)})
    assert flatten(narrow) == flatten(config) | {"network.widths": (8,)}


def test_a_config_survives_pickling() -> None:
    config = Config(recipe="paper", seed=3)
    assert pickle.loads(pickle.dumps(config)) == config  # noqa: S301
    assert dataclasses.asdict(config).keys() == {f.name for f in dataclasses.fields(Config)}


BAD = {
    "choice": ({"form": "weak"}, "form must be one of mixed, strong, got 'weak'"),
    "recipe": ({"recipe": "best"}, "recipe must be one of default, paper, got 'best'"),
    "no recipe": ({"recipe": ["paper"]}, "recipe must be text, got"),
    "law": (
        {"law": "tresca"},
        "law must be one of mu_of_i, coulomb, regularised, power, cohesive, free, got 'tresca'",
    ),
    "unknown": ({"stepz": 3}, "unknown setting stepz: did you mean steps?"),
    "without its section": (
        {"learning_rates": 1e-3},
        "unknown setting learning_rates: did you mean optimizer.learning_rate?",
    ),
    "unknown in a section": ({"network__depth": 3}, "unknown setting network.depth"),
    "unknown in a dict": (
        {"network": {"width": (8,)}},
        "unknown setting network.width: did you mean network.widths?",
    ),
    "no name": ({"network": {3: (8,)}}, "unknown setting network.3"),
    "another section": ({"bach": {"interior": 3}}, "unknown setting bach: did you mean batch?"),
    "nothing like it": ({"qqqq": 3}, "unknown setting qqqq: granpinn train --help lists them"),
    "no section": ({"batch": 512}, "batch must be a granpinn.config.Batch or a dict, got 512"),
    "dict in a dict": (
        {"network": {"widths": {}}},
        "network.widths must be a list, each item a",
    ),
    "list": ({"level": ["V1"]}, "level must be one of V0, V1, V2, got ['V1']"),
    "text": ({"steps": "3"}, "steps must be a whole number, got '3'"),
    "fraction": ({"steps": 2.5}, "steps must be a whole number, got 2.5"),
    "none": ({"seed": None}, "seed must be a whole number, got None"),
    "truth value": ({"I0": True}, "I0 must be a number, got True"),
}


@pytest.mark.parametrize("case", BAD)
def test_an_impossible_setting_is_refused_in_one_sentence(case: str) -> None:
    given, expected = BAD[case]
    for make in (Config, lambda **changes: dataclasses.replace(Config(), **changes)):
        if "recipe" in given and make is not Config:
            continue
        with pytest.raises(ConfigError, match=re.escape(expected)) as error:
            make(**given)
        assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("changes", "same"),
    [
        ({"out": "elsewhere", "resume": True, "checkpoint_every": 1.0}, True),
        ({"seed": 1}, False),
        ({"law": "coulomb"}, False),
        ({"network__widths": (3,)}, False),
        ({"weights__sigma_surface": float("inf")}, False),
    ],
)
def test_the_identity_of_a_run_is_what_decides_its_numbers(
    changes: dict[str, Any], same: bool
) -> None:
    assert (identity(Config(**changes)) == identity(Config())) is same


def test_the_identity_has_every_setting_but_the_free_ones() -> None:
    missing = flatten(Config()).keys() - identity(Config()).keys()
    after_training = {
        "free_I0",
        "side_walls.friction_sd",
    }
    assert missing == after_training | {
        *("flow", "further_flows", "out", "checks", "resume"),
        *("checkpoint_every", "max_time"),
    }
