"""The console command: its verbs, its help, and the completion of a shell."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import granpinn
from granpinn.commands import completion
from granpinn.commands.shared import cli


def test_the_help_has_a_line_and_an_example_for_every_verb(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for argv in ([], ["--help"], ["-h"], ["help"]):
        assert cli.main(argv) == 0
        text = capsys.readouterr().out
        for name in cli.VERBS:
            assert f"  {name:<12}{cli.VERBS[name].does}\n" in text
            assert cli.VERBS[name].example in text
        assert max(map(len, text.splitlines())) <= 100


def test_a_verb_gets_its_arguments_and_gives_its_exit_code(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["report", str(tmp_path)]) == 2
    assert "results.json does not exist" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("word", "hint"), [("trian", "did you mean granpinn train?"), ("xyz", "granpinn --help")]
)
def test_an_unknown_verb_is_one_sentence(
    word: str, hint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main([word]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("granpinn: expected one of convert, ")
    assert f"got {word!r}: {hint}" in err
    assert err.count("\n") == 1


def test_it_is_installed_as_a_command_and_as_a_module() -> None:
    program = Path(sys.executable).with_name("granpinn")
    for command in ([str(program)], [sys.executable, "-m", "granpinn"]):
        done = subprocess.run([*command, "--version"], capture_output=True, text=True, check=True)
        assert done.stdout == f"granpinn {granpinn.__version__}\n"


@pytest.fixture(scope="module")
def scripts() -> dict[str, str]:
    """The script of each shell."""
    parsers = {verb: cli.command(verb).parser() for verb in ("train", "report", "completion")}
    return {shell: completion.script(shell, parsers) for shell in completion.SHELLS}


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (["granpinn", ""], ["train", "report", "completion"]),
        (["granpinn", "tr"], ["train"]),
        (["granpinn", "train", "--me"], ["--members"]),
        (["granpinn", "train", "flow.h5", "--network.w"], ["--network.widths"]),
        (["granpinn", "train", "--level", ""], ["V0", "V1", "V2"]),
        (["granpinn", "train", "--level", "V2"], ["V2"]),
        (["granpinn", "report", "run", "--ti"], ["--time"]),
        (["granpinn", "train", "flo"], ["flow.h5"]),
        (["granpinn", "train", "--out", "flo"], ["flow.h5"]),
        (["granpinn", "completion", "z"], ["zsh"]),
    ],
    ids=" ".join,
)
def test_bash_completes(
    words: list[str], offered: list[str], scripts: dict[str, str], tmp_path: Path
) -> None:
    (tmp_path / "flow.h5").write_text("")
    line = " ".join(f"'{word}'" for word in words)
    script = f"{scripts['bash']}\nCOMP_WORDS=({line}); COMP_CWORD={len(words) - 1}"
    script += f"\n_shtab_granpinn granpinn '{words[-1]}'\nprintf '%s\\n' \"${{COMPREPLY[@]}}\""
    bash = shutil.which("bash")
    assert bash is not None
    done = subprocess.run(
        [bash, "-c", script], capture_output=True, text=True, cwd=tmp_path, check=True
    )
    assert done.stderr == ""
    assert done.stdout.split() == offered


@pytest.mark.parametrize("shell", completion.SHELLS)
def test_the_script_is_valid(shell: str, scripts: dict[str, str], tmp_path: Path) -> None:
    for word in ("network.widths", "V0", "time", "fish"):
        assert word in scripts[shell]
    program = shutil.which(shell)
    if program is None:
        pytest.skip(f"{shell} is not installed: its completion was not parsed")
    path = tmp_path / "completion"
    path.write_text(scripts[shell])
    subprocess.run([program, "-n", str(path)], check=True)
