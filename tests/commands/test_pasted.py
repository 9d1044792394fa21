"""A command line that is shown can be pasted: a file name is one word of it, and runs nothing."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from granpinn.commands import convert, inspect
from granpinn.commands.shared.exit_codes import fail
from granpinn.commands.shared.flow_files import require_flow_files
from granpinn.data import Flow
from granpinn.errors import BadInput
from granpinn.importers.series import detect

NAMES = {
    "command": "x$(touch PWNED)",
    "backticks": "x`touch PWNED`",
    "several commands": "x;touch PWNED;",
    "quotes": 'it\'s "x"',
    "blanks": "a  b",
    "flag": "-x",
    "glob": "*",
    "home": "~",
    "end of line": "x\ntouch PWNED\n",
    "terminal": "x\x1b[31m",
    "accents": "é",
}
NO_UTF_8 = os.fsdecode(b"\xe9")  # a command escapes it, the captured stdout of a test cannot


def words(line: str, folder: Path) -> list[str]:
    """The arguments that a command line in `folder` gives to its program."""
    show = "() { printf '%s\\0' \"$@\"; }\n"
    script = "".join(f"{name}{show}" for name in ("granpinn", "python")) + line
    done = subprocess.run(["bash", "-c", script], cwd=folder, capture_output=True, check=True)
    assert not (folder / "PWNED").exists()
    return [os.fsdecode(word) for word in done.stdout.split(b"\0")]


@pytest.mark.parametrize("name", [*NAMES.values(), NO_UTF_8], ids=[*NAMES, "no UTF-8"])
def test_commands_about_a_flow_file(
    name: str,
    flow_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    no_balance: None,
) -> None:
    monkeypatch.chdir(tmp_path)
    path = Path(f"{name}.h5")
    shutil.copy(flow_file, path)
    assert inspect.main(["--", str(path)]) == 0
    _, _, shown = capsys.readouterr().out.rpartition("next: ")
    with pytest.raises(BadInput, match="is a flow file already") as refused:
        detect(path)
    fail("convert", 2, str(refused.value))
    _, _, told = capsys.readouterr().err.rpartition("already: ")
    for line in (shown, told):
        found = words(line, tmp_path)
        assert str(path) in [str(Path(word)) for word in found], line
        assert "-x.h5" not in found


@pytest.mark.parametrize("name", NAMES.values(), ids=list(NAMES))
def test_commands_about_the_files_of_an_instrument(
    name: str,
    flow: Flow,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    path, out = Path(f"{name}.npz"), Path(f"{name}.h5")
    units = {"length_unit": "m", "time_unit": "s", "velocity_unit": "m/s"}
    np.savez(path, t=flow.t, y=flow.y, x=flow.x, u=flow.u, v=flow.v, **units)
    with pytest.raises(BadInput, match="convert it first") as refused:
        require_flow_files([path], "train on")
    fail("train", 2, str(refused.value))
    _, _, told = capsys.readouterr().err.rpartition("convert it first, ")
    material = ["--grain-diameter=25 mm", "--grain-density=2500 kg/m^3", "--solid-fraction=0.6"]
    assert convert.main([*material, f"--out={out}", "--", str(path)]) == 0
    _, _, shown = capsys.readouterr().out.rpartition("next: ")
    for line, file in ((told.partition(" (with")[0], path), (shown, out)):
        found = words(line, tmp_path)
        assert str(file) in [str(Path(word)) for word in found], line
        assert not {"-x.npz", "-x.h5"} & set(found)
