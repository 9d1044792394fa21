"""Settings as text: flags, TOML files, and errors for wrong ones."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from granpinn.commands.train import parse
from granpinn.config import RECIPES, Config, ConfigError, settings_of
from granpinn.config.fields import flag_of
from granpinn.config.toml import read_toml, to_toml
from granpinn.errors import BadInput
from granpinn.physics.laws import LAWS

REQUIRED = ["flow.h5", "--out", "run"]


@pytest.mark.parametrize("recipe", RECIPES)
def test_a_config_survives_toml_exactly(recipe: str, tmp_path: Path) -> None:
    changes = {"weights.sigma_surface": float("inf"), "rheology.start": (0.25, 0.5)}
    config = Config(recipe=recipe, flow='a "b" ü\\.h5', out="x", **changes)
    path = tmp_path / "config.toml"
    path.write_text(to_toml(config), encoding="utf-8")
    assert Config(**read_toml(path)) == config
    assert parse(["--config", str(path)]).config == config


@settings(
    max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    st.floats(1e-9, 1e9),
    st.integers(0, 2**63 - 1),
    st.lists(st.integers(1, 999), min_size=1),
    st.floats(0.01, 0.4),
)
def test_any_number_survives_toml_and_flags(
    tmp_path: Path, sigma: float, seed: int, widths: list[int], mu_s: float
) -> None:
    config = Config(
        weights__sigma_momentum=sigma,
        seed=seed,
        network__widths=tuple(widths),
        rheology__start=(mu_s, 2 * mu_s),
        flow="f",
        out="o",
    )
    path = tmp_path / "config.toml"
    path.write_text(to_toml(config), encoding="utf-8")
    assert Config(**read_toml(path)) == config
    text = ",".join(map(str, widths))
    flags = [f"--weights.sigma_momentum={sigma!r}", f"--seed={seed}", f"--network.widths={text}"]
    flags.append(f"--rheology.start={mu_s!r},{2 * mu_s!r}")
    assert parse(["f", "--out", "o", *flags]).config == config


def test_every_setting_is_a_flag_with_a_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        parse(["--help-all"])
    assert stop.value.code == 0
    text = capsys.readouterr().out
    for key in settings_of(Config):
        assert key in ("flow", "further_flows") or flag_of(key) in text
    assert "FLOW" in text
    assert "granpinn train collapse.h5 --out run" in text
    assert f"--law {{{','.join(LAWS)}}}" in text
    assert "--rheology.start X,X,..." in text


def test_flags_win_over_the_file_and_the_file_over_the_recipe(tmp_path: Path) -> None:
    path = tmp_path / "case.toml"
    path.write_text('recipe = "paper"\nsteps = 7\nseed = 5\n[network]\nwidths = [3]\n')
    config = parse([*REQUIRED, "--config", str(path), "--seed", "6", "--max-time", "60"]).config
    assert (config.steps, config.seed, config.network.widths) == (7, 6, (3,))
    assert config.form == "strong"
    assert config.max_time == 60


def test_a_resumed_run_takes_its_settings_from_its_folder(tmp_path: Path) -> None:
    config = Config(recipe="paper", flow="flow.h5", out=str(tmp_path), seed=3)
    (tmp_path / "config.toml").write_text(to_toml(config))
    resumed = parse(["--out", str(tmp_path), "--resume"]).config
    assert resumed == dataclasses.replace(config, resume=True)


@pytest.mark.parametrize(
    ("content", "what"),
    [
        ("[walls]\nfriction = 0.1", "the section [walls]"),
        ("[weights]\nnoise_part = 1", "the unknown setting weights.noise_part"),
    ],
)
def test_a_run_of_another_version_is_not_resumed(content: str, what: str, tmp_path: Path) -> None:
    (tmp_path / "config.toml").write_text(content)
    with pytest.raises(ConfigError) as error:
        parse(["--out", str(tmp_path), "--resume"])
    assert str(error.value) == (
        f"{tmp_path} holds a run of another version of granpinn (its config.toml has {what}): "
        "resume it with that version, or begin anew with another folder"
    )
    (tmp_path / "config.toml").write_text("steps = ")
    with pytest.raises(ConfigError, match="could not be read as TOML"):
        parse(["--out", str(tmp_path), "--resume"])


BAD = {
    "no flow to resume": (["--out", "run", "--resume"], "FLOW"),
    "no out": (["flow.h5"], "--out"),
    "unknown flag": ([*REQUIRED, "--stepz", "3"], "--stepz"),
    "no abbreviations": ([*REQUIRED, "--step", "3"], "--step"),
    "value missing": ([*REQUIRED, "--steps"], "--steps"),
    "fraction of a step": ([*REQUIRED, "--steps", "1.5"], "whole number, got '1.5'"),
    "word for a number": ([*REQUIRED, "--I0", "x"], "--I0 must be a number, got 'x'"),
    "nan": ([*REQUIRED, "--I0", "nan"], "--I0 must be a number"),
    "no steps": ([*REQUIRED, "--steps", "0"], "--steps must be in [1, 1e+12], got 0"),
    "choice": ([*REQUIRED, "--level", "V3"], "--level must be one of V0, V1, V2, got 'V3'"),
    "law": (
        [*REQUIRED, "--law", "mu"],
        "--law must be one of mu_of_i, coulomb, regularised, power, cohesive, free, got 'mu'",
    ),
    "negative sigma": ([*REQUIRED, "--weights.sigma_velocity", "-1"], "sigma_velocity must be"),
    "noise": ([*REQUIRED, "--noise", "-0.1"], "--noise must be in"),
    "part": ([*REQUIRED, "--optimizer.prefit", "2"], "--optimizer.prefit must be in [0, 0.99]"),
    "I0": ([*REQUIRED, "--I0", "0"], "--I0 must be positive and at most 1e+30, got 0.0"),
    "widths": (
        [*REQUIRED, "--network.widths", "8,0"],
        "--network.widths must be in [1, 65536], got 8, 0",
    ),
    "widths words": ([*REQUIRED, "--network.widths", "a"], "whole number, got 'a'"),
    "order": ([*REQUIRED, "--rheology.start", "0.7,0.6"], "mu_2 must be larger"),
    "one start": ([*REQUIRED, "--rheology.start", "0.7"], "one value for each free parameter"),
    "start words": ([*REQUIRED, "--rheology.start", "0.7,a"], "must be a number, got 'a'"),
    "sigmoid": (
        [*REQUIRED, "--rheology.variables", "sigmoid", "--rheology.start", "0.3,1.5"],
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
    with pytest.raises(BadInput) as error:
        parse(argv)
    assert expected in error.value.for_commands
    assert "\n" not in error.value.for_commands


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("steps = ", "could not be read as TOML"),
        ("stepz = 3", "unknown setting stepz"),
        ("[walls]\nfriction = 0.1", "has the section [walls], which is now [side_walls]"),
        ("[network]\nwidth = 3", "unknown setting network.width"),
        ('steps = "many"', "steps must be a whole number, got 'many'"),
        ("resume = 1", "resume must be true or false, got 1"),
        ("flow = 1", "flow must be text, got 1"),
        ("I0 = true", "I0 must be a number, got True"),
        ("[network]\nwidths = 3", "whole numbers separated by commas, such as 128,128, got 3"),
        ("[rheology]\nstart = 3", "numbers separated by commas, such as 0.3,0.6, got 3"),
        ("level = 1", "level must be one of V0, V1, V2, got 1"),
    ],
)
def test_a_bad_file_is_refused_in_one_sentence(content: str, expected: str, tmp_path: Path) -> None:
    path = tmp_path / "case.toml"
    path.write_text(content)
    with pytest.raises(BadInput, match=re.escape(expected)) as error:
        parse([*REQUIRED, "--config", str(path)])
    assert "\n" not in str(error.value)
    assert str(path) in str(error.value)
