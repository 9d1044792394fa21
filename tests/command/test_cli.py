"""The console command: its verbs, its help, and the completion of a shell."""

from __future__ import annotations

import importlib
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

import granpinn
from granpinn.command import cli, completion

FLAGS: dict[str, dict[str, list[str]]] = {
    "train": {"--out": [], "--level": ["V0", "V1", "V2"], "--network.widths": []},
    "report": {"--paraview": []},
}


def test_the_help_has_a_line_and_an_example_for_every_verb(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for argv in ([], ["--help"], ["-h"], ["help"]):
        assert cli.main(argv) == 0
        text = capsys.readouterr().out
        for name in cli.available():
            assert f"  {name:<12}{cli.VERBS[name].does}\n" in text
            assert cli.VERBS[name].example in text
        assert max(map(len, text.splitlines())) <= 100


def test_the_help_loads_no_command() -> None:
    code = (
        "import sys; from granpinn.command.cli import main; "
        "main(['--help']); print('torch' in sys.modules)"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.splitlines()[-1] == "False"


def test_every_verb_but_the_help_is_a_module_of_the_package() -> None:
    assert {"convert", "train", "report", "simulate", "doctor", "completion"} <= set(
        cli.available()
    )
    for name in cli.available():
        if name != "completion":
            module = importlib.import_module(f"granpinn.{name}")
            if hasattr(module, "__path__"):
                module = importlib.import_module(f"granpinn.{name}.__main__")
            assert "def main(" in Path(str(module.__file__)).read_text(encoding="utf-8")


def test_a_verb_gets_its_arguments_and_gives_its_exit_code(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["report", str(tmp_path)]) == 2
    assert "results.json does not exist" in capsys.readouterr().err


def test_a_verb_that_is_a_package_is_its_main_module(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "surveying"
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    (folder / "__main__.py").write_text("def main(argv):\n    return len(argv)\n")
    monkeypatch.setattr(granpinn, "__path__", [*granpinn.__path__, str(tmp_path)])
    monkeypatch.setitem(cli.VERBS, "surveying", cli.Verb("survey", "granpinn surveying"))
    assert "surveying" in cli.available()
    assert cli.main(["surveying", "a", "b", "c"]) == 3


def test_a_verb_that_is_not_installed_is_not_offered(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(cli.VERBS, "levitate", cli.Verb("up", "granpinn levitate"))
    assert "levitate" not in cli.available()
    assert cli.main(["levitate"]) == 2
    assert "levitate" in capsys.readouterr().err


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


def test_the_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out == f"granpinn {granpinn.__version__}\n"


def test_it_is_installed_as_a_command_and_as_a_module() -> None:
    program = Path(sys.executable).with_name("granpinn")
    for command in ([str(program)], [sys.executable, "-m", "granpinn"]):
        done = subprocess.run([*command, "--version"], capture_output=True, text=True, check=True)
        assert done.stdout == f"granpinn {granpinn.__version__}\n"


# ---- completion ----------------------------------------------------------------------------------


def complete(words: Sequence[str], cwd: Path) -> list[str]:
    """What bash offers for the last of `words`."""
    line = " ".join(f"'{word}'" for word in words)
    script = completion.script("bash", FLAGS)
    script += f"\nCOMP_WORDS=({line}); COMP_CWORD={len(words) - 1}; _granpinn"
    script += '\nprintf "%s\\n" "${COMPREPLY[@]}"'
    bash = shutil.which("bash")
    assert bash is not None
    done = subprocess.run([bash, "-c", script], capture_output=True, text=True, cwd=cwd, check=True)
    assert done.stderr == ""
    return done.stdout.split()


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (["granpinn", ""], ["train", "report", "completion"]),
        (["granpinn", "tr"], ["train"]),
        (["granpinn", "train", "--"], ["--out", "--level", "--network.widths"]),
        (["granpinn", "train", "flow.h5", "--net"], ["--network.widths"]),
        (["granpinn", "train", "--level", ""], ["V0", "V1", "V2"]),
        (["granpinn", "train", "--level", "V2"], ["V2"]),
        (["granpinn", "report", "--level", ""], []),
        (["granpinn", "report", "run", "--"], ["--paraview"]),
        (["granpinn", "train", "flo"], []),
        (["granpinn", "completion", "z"], ["zsh"]),
    ],
    ids=" ".join,
)
def test_bash_completes(words: list[str], offered: list[str], tmp_path: Path) -> None:
    assert complete(words, tmp_path) == offered


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("granpinn ", ["completion", "report", "train"]),
        ("granpinn tr", ["train"]),
        ("granpinn train --", ["--level", "--network.widths", "--out"]),
        ("granpinn train flow.h5 --net", ["--network.widths"]),
        ("granpinn train --level ", ["V0", "V1", "V2"]),
        ("granpinn train --level=V2", ["--level=V2"]),
        ("granpinn report --level ", []),
        ("granpinn report train --", ["--paraview"]),  # a folder with the name of a verb
        ("granpinn train flo", []),
        ("granpinn completion z", ["zsh"]),
    ],
    ids=str,
)
def test_fish_completes(line: str, offered: list[str], tmp_path: Path) -> None:
    fish = shutil.which("fish")
    if fish is None:
        pytest.skip("fish is not installed: its completion was not tried")
    code = f"{completion.script('fish', FLAGS)}\ncomplete -C {shlex.quote(line)}"
    argv, where = [fish, "--no-config", "-c", code], {"HOME": str(tmp_path)}
    done = subprocess.run(argv, capture_output=True, text=True, cwd=tmp_path, env=where, check=True)
    assert done.stderr == ""
    assert sorted(done.stdout.split()) == offered


def test_the_script_of_fish_has_a_line_for_the_verbs_and_for_each_flag() -> None:
    text = completion.script("fish", FLAGS)
    lines = [shlex.split(line) for line in text.splitlines() if not line.startswith("#")]
    assert all(words[:4] == ["complete", "-c", "granpinn", "-n"] for words in lines)
    train, report, shells = (
        f"contains -- {verb} (commandline -opc)[2]" for verb in ("train", "report", "completion")
    )
    assert [words[4:] for words in lines] == [
        ["__fish_use_subcommand", "-f", "-a", "train report completion"],
        [train, "-l", "out"],
        [train, "-l", "level", "-x", "-a", "V0 V1 V2"],
        [train, "-l", "network.widths"],
        [report, "-l", "paraview"],
        [shells, "-f", "-a", "bash zsh fish"],
    ]


def test_flags_and_choices_come_from_the_help() -> None:
    flags = completion.flags_of(cli.command("train"))
    assert flags["--level"] == ["V0", "V1", "V2"]
    assert {"--help", "--out", "--max-time", "--network.widths"} <= set(flags)
    assert flags["--out"] == []


@pytest.mark.parametrize("shell", completion.SHELLS)
def test_the_script_is_valid(shell: str, tmp_path: Path) -> None:
    program = shutil.which(shell)
    if program is None:
        pytest.skip(f"{shell} is not installed: its completion was not parsed")
    path = tmp_path / "completion"
    path.write_text(completion.script(shell, FLAGS))
    subprocess.run([program, "-n", str(path)], check=True)


def test_the_command_prints_the_script(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(completion, "flags_of", lambda command: {"--flag": []})
    assert cli.main(["completion", "zsh"]) == 0
    text = capsys.readouterr().out
    assert "bashcompinit" in text
    assert "--flag" in text
    assert "complete -o default -F _granpinn granpinn" in text
    assert cli.main(["completion", "--help"]) == 0
    assert "usage: granpinn completion {bash,zsh,fish}" in capsys.readouterr().out


@pytest.mark.parametrize("argv", [[], ["powershell"], ["bash", "zsh"]], ids=str)
def test_another_shell_is_refused(argv: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["completion", *argv]) == 2
    err = capsys.readouterr().err
    assert err.startswith("granpinn.completion: the shell must be one of bash, zsh, fish, got ")
    assert err.count("\n") == 1
