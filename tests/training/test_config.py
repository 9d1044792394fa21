"""Settings: recipes, ranges, and the same values as flags, as TOML and as dataclasses."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from granpinn.command.arguments import flag_of, parse
from granpinn.config import FREE_SECTIONS, Config, ConfigError, flatten, identity, kinds_of, recipes
from granpinn.config.toml import read_toml, to_toml

REQUIRED = ["flow.h5", "--out", "run"]


def test_the_default_recipe_is_what_config_alone_gives() -> None:
    assert recipes.make() == Config()


def test_the_noisy_recipe_costs_half_of_the_default_one() -> None:
    """Multiplications of a step, of the hidden layers."""
    default, noisy = (
        len(c.network.widths[1:]) * c.network.widths[0] ** 2 * c.batch.interior
        for c in (recipes.make(), recipes.make("noisy"))
    )
    assert 2 * noisy == default


def test_the_paper_recipe_is_the_section_training_of_the_paper() -> None:
    paper = recipes.make("paper")
    assert (paper.form, paper.level, paper.epochs, paper.steps) == ("strong", "V2", 20000, None)
    assert paper.network.widths == (250, 250, 250)
    assert paper.batch.interior == 512
    assert paper.optimizer.method == "adam"
    assert paper.optimizer.learning_rate == 5e-4
    assert paper.optimizer.learning_rate * paper.optimizer.final_fraction == pytest.approx(1e-5)
    assert (paper.rheology.variables, paper.rheology.mu_s) == ("sigmoid", None)
    assert paper.optimizer.prefit == 0


@pytest.mark.parametrize("recipe", recipes.RECIPES)
def test_a_config_survives_toml_exactly(recipe: str, tmp_path: Path) -> None:
    config = recipes.make(recipe, weights__sigma_surface=float("inf"), flow='a "b" ü\\.h5', out="x")
    path = tmp_path / "config.toml"
    path.write_text(to_toml(config), encoding="utf-8")
    assert recipes.build(read_toml(path)) == config
    assert parse(["--config", str(path)]) == config


@settings(
    max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.floats(1e-9, 1e9), st.integers(0, 2**63 - 1), st.lists(st.integers(1, 999), min_size=1))
def test_any_number_survives_toml_and_flags(
    tmp_path: Path, sigma: float, seed: int, widths: list[int]
) -> None:
    config = recipes.make(
        weights__sigma_momentum=sigma,
        seed=seed,
        network__widths=tuple(widths),
        flow="f",
        out="o",
    )
    path = tmp_path / "config.toml"
    path.write_text(to_toml(config), encoding="utf-8")
    assert recipes.build(read_toml(path)) == config
    text = ",".join(map(str, widths))
    flags = [f"--weights.sigma_momentum={sigma!r}", f"--seed={seed}", f"--network.widths={text}"]
    assert parse(["f", "--out", "o", *flags]) == config


def test_every_setting_is_a_flag_with_a_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        parse(["--help"])
    assert stop.value.code == 0
    text = capsys.readouterr().out
    for key in kinds_of(Config):
        assert key == "flow" or f"--{flag_of(key)}" in text
    assert "FLOW" in text
    assert "python -m granpinn.train collapse.h5 --out run" in text


def test_flags_win_over_the_file_and_the_file_over_the_recipe(tmp_path: Path) -> None:
    path = tmp_path / "case.toml"
    path.write_text('recipe = "paper"\nsteps = 7\nseed = 5\n[network]\nwidths = [3]\n')
    config = parse([*REQUIRED, "--config", str(path), "--seed", "6", "--max-time", "60"])
    assert (config.steps, config.seed, config.network.widths) == (7, 6, (3,))
    assert config.form == "strong"
    assert config.max_time == 60


def test_a_resumed_run_takes_its_settings_from_its_folder(tmp_path: Path) -> None:
    config = recipes.make("paper", flow="flow.h5", out=str(tmp_path), seed=3)
    (tmp_path / "config.toml").write_text(to_toml(config))
    resumed = parse(["--out", str(tmp_path), "--resume"])
    assert resumed == recipes.replace(config, resume=True)


def test_none_is_a_value_of_optional_settings() -> None:
    config = parse([*REQUIRED, "--steps", "none", "--max-time", "60"])
    assert config.steps is None


BAD = {
    "no flow": (["--out", "run"], "FLOW"),
    "no out": (["flow.h5"], "--out"),
    "unknown flag": ([*REQUIRED, "--stepz", "3"], "--stepz"),
    "no abbreviations": ([*REQUIRED, "--step", "3"], "--step"),
    "value missing": ([*REQUIRED, "--steps"], "--steps"),
    "fraction of a step": ([*REQUIRED, "--steps", "1.5"], "whole number, got '1.5'"),
    "word for a number": ([*REQUIRED, "--I0", "x"], "--I0 must be a number, got 'x'"),
    "nan": ([*REQUIRED, "--I0", "nan"], "--I0 must be a number"),
    "no steps": ([*REQUIRED, "--steps", "0"], "--steps must be at least 1, got 0"),
    "choice": ([*REQUIRED, "--level", "V3"], "--level must be one of V0, V1, V2, got 'V3'"),
    "negative sigma": ([*REQUIRED, "--weights.sigma_velocity", "-1"], "sigma_velocity must be"),
    "noise": ([*REQUIRED, "--noise", "-0.1"], "--noise must be in"),
    "part": ([*REQUIRED, "--optimizer.prefit", "2"], "--optimizer.prefit must be in [0, 1]"),
    "I0": ([*REQUIRED, "--I0", "0"], "--I0 must be positive, got 0.0"),
    "widths": ([*REQUIRED, "--network.widths", "8,0"], "one positive width"),
    "widths words": ([*REQUIRED, "--network.widths", "a"], "whole number, got 'a'"),
    "order": ([*REQUIRED, "--rheology.mu_s", "0.7"], "mu_2 must be larger"),
    "half random": ([*REQUIRED, "--rheology.mu_s", "none"], "or both none"),
    "sigmoid": (
        [*REQUIRED, "--rheology.variables", "sigmoid", "--rheology.mu_2", "1.5"],
        "below 1 for a sigmoid",
    ),
    "exponential": ([*REQUIRED, "--optimizer.decay", "exponential"], "must be positive"),
    "endless": ([*REQUIRED, "--steps", "none"], "--max-time"),
    "no such file": ([*REQUIRED, "--config", "no.toml"], "no.toml does not exist"),
    "seed": ([*REQUIRED, "--seed", "-1"], "--seed must be"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_command_line_is_refused_in_one_sentence(case: str) -> None:
    argv, expected = BAD[case]
    with pytest.raises(ConfigError, match=re.escape(expected)) as error:
        parse(argv)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("steps = ", "could not be read as TOML"),
        ("stepz = 3", "unknown setting stepz"),
        ("[network]\nwidth = 3", "unknown setting network.width"),
        ('steps = "many"', "steps must be a whole number, got 'many'"),
        ("resume = 1", "resume must be true or false, got 1"),
        ("flow = 1", "flow must be text, got 1"),
        ("I0 = true", "I0 must be a number, got True"),
        ("[network]\nwidths = 3", "whole numbers separated by commas, such as 128,128, got 3"),
        ("level = 1", "level must be one of V0, V1, V2, got 1"),
    ],
)
def test_a_bad_file_is_refused_in_one_sentence(content: str, expected: str, tmp_path: Path) -> None:
    path = tmp_path / "case.toml"
    path.write_text(content)
    with pytest.raises(ConfigError, match=re.escape(expected)) as error:
        parse([*REQUIRED, "--config", str(path)])
    assert "\n" not in str(error.value)
    assert str(path) in str(error.value)


def test_a_recipe_flag_does_not_relabel_a_file_of_another_recipe(tmp_path: Path) -> None:
    path = tmp_path / "config.toml"
    path.write_text(to_toml(Config()))
    with pytest.raises(ConfigError, match="contradicts"):
        parse([*REQUIRED, "--config", str(path), "--recipe", "paper"])


def test_config_refuses_what_the_command_line_refuses() -> None:
    with pytest.raises(ConfigError, match="--form must be one of mixed, strong, got 'weak'"):
        recipes.make(form="weak")
    with pytest.raises(ConfigError, match="--recipe must be one of"):
        recipes.make("best")
    with pytest.raises(ConfigError, match="unknown setting network.depth"):
        recipes.make(network__depth=3)


@pytest.mark.parametrize(
    ("changes", "same"),
    [
        ({"out": "elsewhere", "resume": True, "checkpoint_every": 1.0}, True),
        ({"seed": 1}, False),
        ({"network__widths": (3,)}, False),
        ({"weights__sigma_surface": float("inf")}, False),
    ],
)
def test_the_identity_of_a_run_is_what_decides_its_numbers(
    changes: dict[str, Any], same: bool
) -> None:
    assert (identity(recipes.make(**changes)) == identity(Config())) is same


def test_the_identity_has_every_setting_but_the_free_ones() -> None:
    missing = flatten(Config()).keys() - identity(Config()).keys()
    after_training = {key for key in missing if key.split(".")[0] in FREE_SECTIONS}
    assert after_training >= {"free_I0", "profile.reach", "resimulate", "resimulation.cells"}
    assert missing - after_training == {
        *("flow", "out", "resume", "tensorboard", "checkpoint_every", "max_time")
    }
