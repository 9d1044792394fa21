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
    changes = {"weights.sigma_surface": float("inf"), "rheology.fix": ("n=0.5",)}
    config = Config(recipe=recipe, law="power", flow='a "b" ü\\.h5', out="x", **changes)
    path = tmp_path / "config.toml"
    path.write_text(to_toml(config), encoding="utf-8")
    assert Config(**read_toml(path)) == config
    assert parse(["--config", str(path)])[0] == config


@settings(
    max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    st.floats(1e-9, 1e9),
    st.integers(0, 2**63 - 1),
    st.lists(st.integers(1, 999), min_size=1),
)
def test_any_number_survives_toml_and_flags(
    tmp_path: Path, sigma: float, seed: int, widths: list[int]
) -> None:
    config = Config(
        weights__sigma_momentum=sigma,
        seed=seed,
        network__widths=tuple(widths),
        flow="f",
        out="o",
    )
    path = tmp_path / "config.toml"
    path.write_text(to_toml(config), encoding="utf-8")
    assert Config(**read_toml(path)) == config
    text = ",".join(map(str, widths))
    flags = [f"--weights.sigma_momentum={sigma!r}", f"--seed={seed}", f"--network.widths={text}"]
    assert parse(["f", "--out", "o", *flags])[0] == config


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
    assert "--rheology.fix NAME=X,..." in text


def test_flags_win_over_the_file_and_the_file_over_the_recipe(tmp_path: Path) -> None:
    path = tmp_path / "case.toml"
    path.write_text('recipe = "paper"\nsteps = 7\nseed = 5\n[network]\nwidths = [3]\n')
    config = parse([*REQUIRED, "--config", str(path), "--seed", "6", "--max-time", "60"])[0]
    assert (config.steps, config.seed, config.network.widths) == (7, 6, (3,))
    assert config.form == "strong"
    assert config.max_time == 60


def test_a_resumed_run_takes_its_settings_from_its_folder(tmp_path: Path) -> None:
    config = Config(recipe="paper", flow="flow.h5", out=str(tmp_path), seed=3)
    (tmp_path / "config.toml").write_text(to_toml(config))
    resumed = parse(["--out", str(tmp_path), "--resume"])[0]
    assert resumed == dataclasses.replace(config, resume=True)


def test_a_run_of_another_version_is_not_resumed(tmp_path: Path) -> None:
    (tmp_path / "config.toml").write_text("[weights]\nnoise_part = 1")
    with pytest.raises(
        ConfigError, match="another version, has the unknown setting weights.noise_part"
    ):
        parse(["--out", str(tmp_path), "--resume"])
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
    "nan": ([*REQUIRED, "--I0", "nan"], "--I0 must be positive and at most 1e+30, got nan"),
    "choice": ([*REQUIRED, "--level", "V3"], "--level must be one of V0, V1, V2, got 'V3'"),
    "widths words": ([*REQUIRED, "--network.widths", "a"], "whole number, got 'a'"),
    "endless": ([*REQUIRED, "--steps", "none"], "--max-time"),
    "no such file": ([*REQUIRED, "--config", "no.toml"], "no.toml does not exist"),
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
        ("[walls]\nfriction = 0.1", "did you mean side_walls.friction?"),
        ("[network]\nwidth = 3", "unknown setting network.width"),
        ('steps = "many"', "steps must be a whole number, got 'many'"),
        ("[network]\nwidths = 3", "network.widths must be a list, each item a whole number, got 3"),
    ],
)
def test_a_bad_file_is_refused_in_one_sentence(content: str, expected: str, tmp_path: Path) -> None:
    path = tmp_path / "case.toml"
    path.write_text(content)
    with pytest.raises(BadInput, match=re.escape(expected)) as error:
        parse([*REQUIRED, "--config", str(path)])
    assert "\n" not in str(error.value)
    assert str(path) in str(error.value)
