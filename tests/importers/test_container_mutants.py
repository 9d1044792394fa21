"""Gate F-2: mutants of HDF5, zarr, MATLAB 5, VTK: read or refused, within 10 s and 3 GiB."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.importers import read_mutants
from tests.importers.test_hostile_containers import cells, matlab, netcdf, tracks
from tests.importers.test_hostile_meshes import grid
from tests.importers.test_pivlab_mat import all_frames, version_5
from tests.importers.test_simulation_files import dataset


def zarr(path: Path, version: int) -> None:
    dataset().to_zarr(path, zarr_format=version, consolidated=False)


# Format, name, writer, number of mutants, which is smaller where a crash costs seconds.
CONTAINERS: dict[str, tuple[str, str, Callable[[Path], Any], int]] = {
    "matlab": ("pivlab-mat", "a.mat", matlab, 150),
    "cells": ("pivlab-mat", "a.mat", cells, 150),
    "mat5": ("pivlab-mat", "a.mat", lambda path: version_5(path, all_frames()), 150),
    "netcdf": ("netcdf", "a.nc", netcdf, 125),
    "tracks": ("tracks", "a.h5", tracks, 150),
    "zarr 2": ("netcdf", "a.zarr", lambda path: zarr(path, 2), 40),
    "zarr 3": ("netcdf", "b.zarr", lambda path: zarr(path, 3), 40),
    "vtk": ("mesh", "a.vti", lambda path: grid().save(path), 40),
}


Outcomes = dict[str, list[str]]


def outcomes_of(folder: Path, factor: int) -> Outcomes:
    """Messages for all mutants of each container; the last is "died ..." if one killed the reader.

    One process reads all of them, as the imports take longer than the mutants.
    """
    jobs, names, found = {}, {}, Outcomes()
    for name, (kind, file, write, count) in CONTAINERS.items():
        path = folder / name.replace(" ", "_") / file
        path.parent.mkdir()
        write(path)
        jobs[name] = json.dumps([kind, str(path), 1000 * (factor - 1), count * factor])
        names[str(path)] = name
        found[name] = []
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    while jobs:
        command = [sys.executable, str(read_mutants.__file__), *jobs.values()]
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
        for path, _, message in map(json.loads, done.stdout.splitlines()):
            found[names[path]].append(message)
        for name in [*jobs]:
            complete = len(found[name]) == CONTAINERS[name][3] * factor
            if not complete:
                found[name].append(f"died with {done.returncode}: {done.stderr[-500:]}")
            del jobs[name]
            if not complete:
                break
    return found


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> Outcomes:
    return outcomes_of(tmp_path_factory.mktemp("mutants"), 1)


def check(messages: list[str], count: int) -> None:
    """All mutants have an outcome of one sentence; the last seed of a list that ends early died."""
    assert len(messages) == count, f"seed {len(messages) - 1}: {messages[-1]}"
    assert not [message for message in messages if "\n" in message or not message]
    refused = sum(message != "read" for message in messages)
    assert 0 < refused < count, "the mutants should be neither all fatal nor all harmless"


@pytest.mark.parametrize("container", CONTAINERS)
def test_mutants(container: str, outcomes: Outcomes) -> None:
    check(outcomes[container], CONTAINERS[container][3])


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_many_mutants(tmp_path: Path) -> None:
    found = outcomes_of(tmp_path, 40)
    for container, (*_, count) in CONTAINERS.items():
        check(found[container], 40 * count)
