"""The message of a failed build names the missing part and the remedy."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import torch

ROOT = Path(__file__).parents[1]
OLD_TORCH = """
__version__ = "2.6.0+cu124"
def compiled_with_cxx11_abi(): return True
class version: cuda = "12.4"
"""
ABSENT = "raise ImportError('it is not there')"


def configure(folder: Path, code: int = 1, **environment: str) -> str:
    """What CMake says to a configuration with this exit code, without its line breaks."""
    tools = {name: shutil.which(name) for name in ("cmake", "ninja")}
    if None in tools.values():
        pytest.skip("cmake and ninja are needed; pip install cmake ninja")
    command = [tools["cmake"], "-S", ROOT, "-B", folder / "build", "-G", "Ninja"]
    command += [f"-DCMAKE_MAKE_PROGRAM={tools['ninja']}", f"-DPython_EXECUTABLE={sys.executable}"]
    command += ["-DSKBUILD_PROJECT_VERSION=0.1.0"]
    done = subprocess.run(
        [str(word) for word in command],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
    )
    assert done.returncode == code
    return " ".join((done.stderr if code else done.stdout).split())


def shadow(folder: Path, package: str, text: str) -> str:
    """A folder for PYTHONPATH in which `package` is the given text."""
    (folder / package).mkdir()
    (folder / package / "__init__.py").write_text(text)
    return str(folder)


@pytest.mark.parametrize(
    ("package", "text", "message"),
    [
        ("torch", OLD_TORCH, "granpinn needs torch >= 2.11, found 2.6.0+cu124 in"),
        ("torch", ABSENT, "granpinn needs torch >= 2.11 to build, and Python cannot import torch."),
        ("pybind11", ABSENT, "granpinn needs pybind11 to build, and Python cannot import it."),
    ],
    ids=["old torch", "no torch", "no pybind11"],
)
def test_missing_or_old_packages(tmp_path: Path, package: str, text: str, message: str) -> None:
    said = configure(tmp_path, PYTHONPATH=shadow(tmp_path, package, text))
    assert message in said
    assert "pip install 'torch>=2.11' scikit-build-core pybind11 cmake ninja" in said


def test_cuda_that_is_wanted_and_cannot_be(tmp_path: Path) -> None:
    if torch.version.cuda is None:
        missing = f"torch {torch.__version__} is a build without CUDA, install one with it."
    else:
        missing = "no CUDA compiler found, install CUDA"
    said = configure(tmp_path, GRANPINN_CUDA="on", CUDACXX=str(tmp_path / "no-such-compiler"))
    assert f"GRANPINN_CUDA=on: {missing}" in said


def test_operators_for_several_torches(tmp_path: Path) -> None:
    """As in a wheel: from unpacked packages, none of which is imported."""
    folders = []
    for minor, cuda in (("2.11", "None"), ("2.12", "'13.0'")):
        folders.append(tmp_path / minor)
        folders[-1].mkdir()
        (folders[-1] / "version.py").write_text(f"__version__ = '{minor}.1+x'\ncuda = {cuda}\n")
    said = configure(tmp_path, code=0, GRANPINN_TORCH=";".join(map(str, folders)))
    assert "for torch 2.11.1+x, 2.12.1+x; CPU kernels for" in said
    assert "no CUDA kernels (torch 2.11.1+x is a build without CUDA, install one with it)" in said
