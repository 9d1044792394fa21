"""A copy of the repository with its build, which can be copied once more and built on there.

CMake writes absolute paths, so a build that is copied would compile everything again. Here the
paths inside the folder are made relative before the first build: `folder/tree` has the repository
and `folder/cmake` the objects. Ninja then compiles in a copy only what changed there.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

from bench import copied_tree


def build(folder: Path, options: Sequence[str] = (), jobs: int = 1) -> str:
    """Copies the repository to a folder and builds it there. The error, or "".

    Raises:
        OSError: the build tools are missing.
    """
    folder = folder.resolve()
    tree, objects = folder / "tree", folder / "cmake"
    copied_tree.copy_tree(tree, compiled=False)
    # CMake must not run again: it would restore the absolute paths.
    error = copied_tree.configure(tree, objects, ["-DCMAKE_SUPPRESS_REGENERATION=ON", *options])
    if error:
        return error
    make_relative(folder)
    return copied_tree.make(tree, objects, jobs)


def make_relative(folder: Path) -> None:
    """Makes the paths of the build files relative to `folder/cmake`, where Ninja runs."""
    for path in (folder / "cmake").rglob("*.ninja"):
        text = path.read_text().replace(f"{folder}/cmake", ".").replace(f"{folder}/", "../")
        path.write_text(text)


def copy(folder: Path, to: Path) -> None:
    """Copies a folder to a new place, with the times of the files: Ninja compares them."""
    shutil.copytree(folder, to)


def rebuild(folder: Path, jobs: int = 1) -> str:
    """Builds what changed in a copy. The error, or ""."""
    return copied_tree.make(folder / "tree", folder / "cmake", jobs)
