"""A build that was copied compiles only what changed in the copy."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from bench import movable_build

# A "compiler" that copies two files into one, and files of the form that CMake writes.
BUILD = """\
rule join
  command = cat $in > $out
build {0}/cmake/a.o: join {0}/tree/a.cpp {0}/tree/common.h
build {0}/cmake/b.o: join {0}/tree/b.cpp
build module.so: join a.o b.o
"""


def ninja(folder: Path) -> str:
    command = ["ninja", "-C", str(folder / "cmake"), "-v"]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


@pytest.mark.skipif(not shutil.which("ninja"), reason="needs ninja")
def test_a_copy_compiles_only_what_changed(tmp_path: Path) -> None:
    base, copy = tmp_path / "base", tmp_path / "elsewhere" / "copy"
    (base / "tree" / "granpinn").mkdir(parents=True)
    for name in ("a.cpp", "b.cpp", "common.h"):
        (base / "tree" / name).write_text(f"{name} of base\n")
    (base / "cmake").mkdir()
    (base / "cmake" / "build.ninja").write_text(BUILD.format(base))
    movable_build.make_relative(base)
    assert str(base) not in (base / "cmake" / "build.ninja").read_text()
    assert movable_build.rebuild(base) == ""

    movable_build.copy(base, copy)
    assert "no work to do" in ninja(copy)
    header = copy / "tree" / "common.h"
    header.write_text("common.h of copy\n")
    os.utime(header, (header.stat().st_mtime + 10,) * 2)  # whatever the steps of the clock
    commands = ninja(copy)
    assert "a.cpp" in commands
    assert "b.cpp" not in commands
    assert movable_build.rebuild(copy) == ""
    module = (copy / "tree" / "granpinn" / "module.so").read_text()
    assert module == "a.cpp of base\ncommon.h of copy\nb.cpp of base\n"
    assert "of copy" not in (base / "cmake" / "module.so").read_text()


@pytest.mark.skipif(not shutil.which("ninja"), reason="needs ninja")
def test_a_failed_build_is_told(tmp_path: Path) -> None:
    (tmp_path / "tree" / "granpinn").mkdir(parents=True)
    (tmp_path / "cmake").mkdir()
    rules = "rule fail\n  command = echo no such name; false\nbuild x.so: fail\n"
    (tmp_path / "cmake" / "build.ninja").write_text(rules)
    assert "no such name" in movable_build.rebuild(tmp_path)
    assert not list((tmp_path / "tree" / "granpinn").iterdir())
