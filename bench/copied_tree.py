"""A copy of the repository that can be changed, built and tested without touching the original.

The compiled modules of a copy lie in its own `granpinn/`, and its tests import them: an editable
install of the original is switched off.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("granpinn", "csrc", "cmake", "tests", "bench", "docs", "examples", ".ci")
FILES = ("CMakeLists.txt", "pyproject.toml", "mkdocs.yml", "README.md", "CONTRIBUTING.md")

# Editable installs hook imports before the path is searched.
_PYTEST = (
    "import sys; "
    "sys.meta_path[:] = [f for f in sys.meta_path if 'Redirect' not in type(f).__name__]; "
    "import pytest; sys.exit(pytest.main(sys.argv[1:]))"
)


def copy_tree(to: Path) -> None:
    """Copies the repository to an empty folder, without compiled modules."""
    ignored = shutil.ignore_patterns("__pycache__", "build", "*.so")
    for name in FOLDERS:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, to / name, ignore=ignored)
    for name in FILES:
        if (ROOT / name).is_file():
            shutil.copy2(ROOT / name, to / name)


def build(tree: Path, folder: Path, options: Sequence[str] = ()) -> str:
    """Builds the modules of a copy in `folder`, again only what changed. The error, or "".

    Raises:
        OSError: the build tools are missing.
    """
    error = ""
    if not (folder / "build.ninja").is_file():
        command = ["cmake", "-S", str(tree), "-B", str(folder), "-G", "Ninja"]
        defined = [f"-DPython_EXECUTABLE={sys.executable}", "-DSKBUILD_PROJECT_VERSION=0.0.0"]
        error = _error([*command, *defined, *options])
    error = error or _error(["ninja", "-C", str(folder)])
    if not error:
        for module in folder.glob("*.so"):
            shutil.copy2(module, tree / "granpinn")
    return error


def _error(command: Sequence[str]) -> str:
    """The end of what a command wrote, if it fails; else ""."""
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    output = (run.stdout + run.stderr)[-2000:]
    return (output or f"exit code {run.returncode}") if run.returncode else ""


def pytest(
    tree: Path, arguments: Sequence[str], timeout: float, environment: dict[str, str] | None = None
) -> tuple[int, str]:
    """Exit code and output of the tests of a copy; 124 if they take longer than `timeout` s."""
    python_path = {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        run = subprocess.run(
            [sys.executable, "-c", _PYTEST, "-q", "-p", "no:cacheprovider", *arguments],
            cwd=tree,
            env={**os.environ, **python_path, **(environment or {})},
            capture_output=True,
            text=True,
            errors="replace",
            timeout=timeout,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return 124, ""
    return run.returncode, run.stdout + run.stderr
