"""Every CUDA source compiles without a warning, where nvcc is installed.

The build compiles them only if torch is a CUDA build; without one, only this test compiles them.
"""

import shutil
import subprocess
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = sorted((ROOT / "csrc" / "cuda").rglob("*.cu"))


@cache
def quickest(nvcc: str) -> list[str]:
    """The flags with which a compiler is quickest; warnings come before what they leave out."""
    known = subprocess.run([nvcc, "--help"], capture_output=True, text=True, check=True).stdout
    if "--Ofast-compile" in known:
        return ["--Ofast-compile", "max"]
    return ["-Xcicc", "-O1", "-Xptxas", "-O1"]


@pytest.mark.timeout(600)
@pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.stem)
def test_it_compiles(source: Path, tmp_path: Path) -> None:
    nvcc = shutil.which("nvcc")
    if nvcc is None:
        pytest.skip("nvcc is not installed")
    command = [nvcc, "-std=c++17", "--expt-relaxed-constexpr", "-arch=sm_90a", "-I", ROOT / "csrc"]
    # 128: a loop that one instance of a template never enters
    command += ["-diag-suppress", "128", "-Werror", "all-warnings", "-Xcompiler=-Wall,-Wextra"]
    command += quickest(nvcc)
    command += ["-c", source, "-o", tmp_path / "object.o"]
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_there_is_something_to_compile() -> None:
    assert SOURCES
