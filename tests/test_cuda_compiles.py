"""Every CUDA source compiles without a warning, where nvcc is installed.

The build compiles them only if torch is a CUDA build; without one, only this test compiles them.
Every source is compiled to PTX, which has all warnings of device code, and two with inline assembly
to objects, which takes ten times as long for the largest; `-m long` makes objects of the others.
"""

import shutil
import subprocess
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = sorted((ROOT / "csrc" / "cuda").rglob("*.cu"))
# A source with instructions of one GPU alone has other code for the rest.
OTHERWISE = [source for source in SOURCES if "__CUDA_ARCH_FEAT_" in source.read_text()]
OBJECTS = {"step", "newton_schulz_cluster"}
CASES = [
    pytest.param(
        source,
        architecture,
        kind,
        id=f"{source.stem}-{architecture}{kind}",
        marks=[pytest.mark.long] if kind == "-c" and source.stem not in OBJECTS else [],
    )
    for architecture, sources in (("sm_90a", SOURCES), ("sm_80", OTHERWISE))
    for source in sources
    for kind in ("-ptx", "-c")
]


@cache
def quickest(nvcc: str) -> list[str]:
    """The flags with which a compiler is quickest; warnings come before what they leave out."""
    known = subprocess.run([nvcc, "--help"], capture_output=True, text=True, check=True).stdout
    if "--Ofast-compile" in known:
        return ["--Ofast-compile", "max"]
    return ["-Xcicc", "-O1", "-Xptxas", "-O1"]


@pytest.mark.timeout(600)
@pytest.mark.parametrize(("source", "architecture", "kind"), CASES)
def test_it_compiles(source: Path, architecture: str, kind: str, tmp_path: Path) -> None:
    nvcc = shutil.which("nvcc")
    if nvcc is None:
        pytest.skip("nvcc is not installed")
    command = [nvcc, "-std=c++17", "--expt-relaxed-constexpr", f"-arch={architecture}"]
    command += ["-I", ROOT / "csrc"]
    # 128: a loop that one instance of a template never enters
    command += ["-diag-suppress", "128", "-Werror", "all-warnings", "-Xcompiler=-Wall,-Wextra"]
    command += quickest(nvcc)
    command += [kind, source, "-o", tmp_path / "out"]
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_there_is_something_to_compile() -> None:
    assert SOURCES
    assert OTHERWISE
    assert {source.stem for source in SOURCES} >= OBJECTS
