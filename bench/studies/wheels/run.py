"""Do the wheels work without a compiler, under every torch, and give the numbers of the source?

    python distribution/wheels.py cpu --python python3.11 python3.12
    python -m bench.studies.wheels.run --wheels dist --json OUT.json ENV/bin/python ...

Each ENV is a virtual environment with one torch and without granpinn. The wheel for its Python is
installed there. Neither the installation nor the runs see a compiler. Then the doctor, a training
of the demonstration with few steps, the three notebooks of examples/ with fewer, and the sentence
for other torches. `--source PYTHON` names environments with granpinn built from source: the same
training there must give the same bits under the same torch.

Defends: `pip install` of a wheel is all that a user needs.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from bench.studies import raw
from granpinn.data import read_flow, write_flow
from granpinn.simulation import demo_path
from tests.notebooks import NOTEBOOKS, program
from tests.runs import TINY

COMPILERS = ("cc", "c++", "gcc", "g++", "clang", "clang++", "nvcc", "cmake", "ninja", "ld")
FACTS = """
import json, platform, torch
print(json.dumps({"python": platform.python_version(), "torch": torch.__version__,
                  "tag": "cp" + "".join(platform.python_version_tuple()[:2])}))
"""
DEMO = "from granpinn.simulation import demo_path; print(demo_path())"
# The sentence of a wrong torch: the version is changed before granpinn asks for it.
WRONG = """
import torch
torch.__version__ = "{version}"
import granpinn.kernels.ops
"""


class Environment:
    """A virtual environment whose programs find no compiler.

    Args:
        python: its interpreter.
        folder: an empty folder for the work.
        compilers: whether there may be some beside the interpreter, from a build from source.
    """

    def __init__(self, python: Path, folder: Path, compilers: bool = False) -> None:
        self.python = python
        self.folder = folder
        (folder / "home").mkdir(parents=True)
        self.variables = {
            "PATH": str(python.parent),
            "HOME": str(folder / "home"),
            "CC": "/bin/false",
            "CXX": "/bin/false",
            "OMP_NUM_THREADS": "1",
            "MPLBACKEND": "agg",
        }
        kept = ("PIP_", "SSL_", "REQUESTS_")  # where pip finds packages
        self.variables |= {k: v for k, v in os.environ.items() if k.startswith(kept)}
        seen = [name for name in COMPILERS if shutil.which(name, path=self.variables["PATH"])]
        if seen and not compilers:
            raise SystemExit(f"{python.parent} must have no compiler, found {', '.join(seen)}")

    def run(self, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [self.python, *arguments],
            cwd=self.folder,
            env=self.variables,
            capture_output=True,
            text=True,
            check=False,
        )

    def output(self, *arguments: str | Path) -> str:
        """What a program that must succeed writes."""
        done = self.run(*arguments)
        if done.returncode:
            raise SystemExit(f"{self.python} {arguments}: {done.stderr[-2000:]}")
        return done.stdout

    def facts(self) -> dict[str, str]:
        facts: dict[str, str] = json.loads(self.output("-c", FACTS))
        return facts

    def training(self, steps: int) -> dict[str, Any]:
        """The law that a short training of the demonstration finds, and a digest of its network."""
        demo = self.output("-c", DEMO).strip()
        options = ("--steps", str(steps), "--device", "cpu", "--simulated_pressure.frames", "0")
        run = self.folder / "run"
        self.output("-m", "granpinn.train", demo, "--out", run, *options)
        parameters = json.loads((run / "results.json").read_text())["parameters"]
        network = (run / "network.safetensors").read_bytes()
        values = {name: found["value"] for name, found in parameters.items() if found}
        return {"steps": steps, "network": hashlib.sha256(network).hexdigest()[:16]} | values


def wheel_for(folder: Path, tag: str) -> Path:
    found = sorted(folder.glob(f"granpinn-*-{tag}-*.whl"))
    if len(found) != 1:
        raise SystemExit(f"{folder} must have one wheel for {tag}, has {len(found)}")
    return found[0]


def contents(wheel: Path) -> dict[str, Any]:
    """Size of a wheel and of its compiled parts, MiB."""
    with zipfile.ZipFile(wheel) as archive:
        parts = {
            Path(part.filename).name: round(part.file_size / 2**20, 2)
            for part in archive.infolist()
            if part.filename.endswith(".so")
        }
    return {
        "wheel": wheel.name,
        "MiB": round(wheel.stat().st_size / 2**20, 2),
        "parts_MiB": dict(sorted(parts.items())),
    }


def notebooks(place: Environment) -> dict[str, str]:
    """The notebooks with a small flow and a tiny network: done, or the last line of the error."""
    flow = read_flow(demo_path())
    some = slice(None, None, 4)
    parts = {name: getattr(flow, name)[some] for name in "tyx"}
    parts |= {name: getattr(flow, name)[some, some, some] for name in "uvcp"}
    write_flow(replace(flow, **parts), place.folder / "small.h5")
    said = {}
    for path in NOTEBOOKS:
        tiny = TINY | {"simulated_pressure__frames": 0}
        settings = {"flow_file": "small.h5", "run_dir": f"run-{path.stem}", "settings": tiny}
        (place.folder / f"{path.stem}.py").write_text(program(path, settings | {"members": 2}))
        done = place.run(f"{path.stem}.py")
        said[path.stem] = done.stderr.strip().splitlines()[-1] if done.returncode else "done"
    return said


def from_wheel(python: Path, wheels: Path, steps: int, folder: Path) -> dict[str, Any]:
    """What one environment shows of the wheel for its Python."""
    place = Environment(python, folder)
    facts = place.facts()
    wheel = wheel_for(wheels, facts["tag"])
    place.output("-m", "pip", "install", "--quiet", "--force-reinstall", "--no-deps", wheel)
    place.output("-m", "pip", "install", "--quiet", wheel)
    report = json.loads(place.output("-m", "granpinn.doctor", "--json"))
    row: dict[str, Any] = {key: facts[key] for key in ("python", "torch")} | {
        "wheel": wheel.name,
        "works": report["works"],
        "operators_for": report["build"]["torch_version"],
    }
    row["training"] = place.training(steps)
    row["notebooks"] = notebooks(place)
    row["other_torch"] = {
        version: place.run("-c", WRONG.format(version=version)).stderr.strip().splitlines()[-1]
        for version in ("2.10.0", "2.99.0")
    }
    return row


def from_source(python: Path, steps: int, folder: Path) -> dict[str, Any]:
    """The same training with granpinn built from source."""
    place = Environment(python, folder, compilers=True)
    facts = place.facts()
    return {"python": facts["python"], "torch": facts["torch"]} | place.training(steps)


def compared(rows: Sequence[dict[str, Any]], sources: Sequence[dict[str, Any]]) -> None:
    """Adds to each row whether its training has the bits of the source under the same torch."""
    for row in rows:
        same = [s["network"] for s in sources if s["torch"] == row["torch"]]
        row["bits_of_source"] = row["training"]["network"] in same if same else None


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("environments", nargs="*", type=Path, help="interpreters with a torch")
    parser.add_argument("--source", nargs="*", type=Path, default=[], help="with a source build")
    parser.add_argument("--wheels", type=Path, default=Path("dist"), help="folder of the wheels")
    parser.add_argument("--steps", type=int, default=20, help="of the training")
    parser.add_argument("--json", type=Path, help="file for the raw results")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        sources = [
            from_source(python.absolute(), options.steps, Path(folder) / f"source{i}")
            for i, python in enumerate(options.source)
        ]
        rows = []
        for i, python in enumerate(options.environments):
            work = Path(folder) / f"wheel{i}"
            wheels = options.wheels.absolute()
            rows.append(from_wheel(python.absolute(), wheels, options.steps, work))
            print(json.dumps(rows[-1], indent=1), flush=True)
    compared(rows, sources)
    made = [contents(path) for path in sorted(options.wheels.glob("*.whl"))]
    raw.write(options.json, {"wheels": made, "source": sources, "environments": rows})


if __name__ == "__main__":
    main()
