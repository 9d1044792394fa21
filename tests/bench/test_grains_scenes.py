"""The grains study: the start of every scene, and LAMMPS as an outside program."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import KDTree

from bench.studies.experiment.commands import ExperimentError
from bench.studies.grains.lammps import Lammps, environment
from bench.studies.grains.materials import FRICTIONS, Material
from bench.studies.grains.packing import FREE
from bench.studies.grains.scenes import SCENES
from bench.studies.grains.scenes.scene import script


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("friction", FRICTIONS)
def test_a_scene_starts_without_contacts_inside_its_box(name: str, friction: float) -> None:
    material = Material(friction)
    scene = SCENES[name](material)
    parts = scene.packing(1)
    free = np.concatenate([part.centre for part in parts if part.kind[0] == FREE])
    assert KDTree(free).query(free, k=2)[0][:, 1].min() > 1.15
    low, high = scene.box[::2], scene.box[1::2]
    assert ((free > low) & (free < high)).all()
    text = script(scene, material)
    assert "WALL" not in text
    assert f"{friction:g} 1" in text
    assert text.rstrip().splitlines()[-1].startswith("run ")


def fake(tmp_path: Path, line: str) -> str:
    program = tmp_path / "lmp"
    program.write_text(f"#!/bin/sh\n{line}\n")
    program.chmod(0o755)
    return str(program)


def test_lammps_is_run_in_its_folder(tmp_path: Path) -> None:
    program = Lammps(fake(tmp_path, 'cat in.lammps; echo "$LD_LIBRARY_PATH"'))
    said = program.run("units lj\n", tmp_path / "work")
    assert "units lj" in said
    assert str(tmp_path.parent / "lib") in said
    assert (tmp_path / "work" / "lammps.log").read_text() == said
    kept = environment("/a/bin/lmp", {"LD_LIBRARY_PATH": "/b"})
    assert kept["LD_LIBRARY_PATH"] == os.pathsep.join(("/a/lib", "/b"))


def test_errors_of_lammps_are_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(ExperimentError, match="ERROR: Unknown command"):
        Lammps(fake(tmp_path, "echo 'ERROR: Unknown command'; exit 1")).run("x", tmp_path / "work")
    with pytest.raises(ExperimentError, match="pip install lammps mpich"):
        Lammps(str(tmp_path / "none"))
