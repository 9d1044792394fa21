"""Hostile arguments of `simulate`: one sentence before anything is computed, or a valid flow."""

from __future__ import annotations

import dataclasses
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from granpinn import _collapse
from granpinn.commands import simulate as command
from granpinn.simulation import Collapse, run

VALUES = ["0", "-1", "nan", "inf", "1e308", "5e-324", str(2**31), str(2**63), "", "text", "1,2"]
NAMES = [("collapse", field.name) for field in dataclasses.fields(Collapse)]
NAMES += [("chute", name) for name in ("slope", "g", "period", "cells", "stride", "height", "d")]
# Small enough to run where a value is accepted.
BASE = {"cells": "32", "frames": "2", "t_end": "0.02", "stride": "1", "threads": "1",
        "box_width": "10", "height": "5", "aspect": "2"}  # fmt: skip
CHUTE = {"cells": "8", "frames": "2", "t_end": "0.02", "threads": "1", "height": "5"}
BASES = {"collapse": BASE, "chute": CHUTE}
ACCEPTED = {  # whatever else is accepted, is wrong
    "cohesion": {"0", "5e-324", str(2**31), str(2**63)},
    "air_density": {str(2**31)},
    "mu_s": set(),
    "density": {str(2**31)},
    "wall_gap": {str(2**31)},
    "eta_max": {str(2**31), str(2**63)},
    "length_unit": set(VALUES) - {""},
    "time_unit": set(VALUES) - {""},
    "mu_2": {str(2**31), str(2**63)},
    "I0": {str(2**31), str(2**63)},
}
ACCEPTED_OF_CHUTE = {"slope": {"0", "5e-324"}, "g": {str(2**31)}, "height": {str(2**31)}}
ALL_ACCEPTED = {"collapse": ACCEPTED, "chute": ACCEPTED_OF_CHUTE}


def flags(base: dict[str, str] = BASE, **values: str) -> list[str]:
    return [f"--{name.replace('_', '-')}={value}" for name, value in (base | values).items()]


class Computed(Exception):
    """The simulation began."""


@pytest.mark.parametrize("value", VALUES)
@pytest.mark.parametrize(("scene", "name"), NAMES)
def test_every_option_refuses_or_accepts_before_the_simulation(
    scene: str,
    name: str,
    value: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def states(*arguments: object, **keywords: object) -> None:
        raise Computed

    monkeypatch.setattr(run, "states", states)
    settings = flags(BASES[scene], **{name: value})
    code = command.main([scene, *settings, "--out", str(tmp_path / "flow.h5")])
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    if "Computed" in err:
        assert value in ALL_ACCEPTED[scene].get(name, set()), f"--{name} {value} is accepted"
        return
    assert code == 2
    assert "this is a bug" not in err
    also = {"air_viscosity": "eta_min"}  # its default
    assert any(
        word in err
        for word in (
            name,
            name.replace("_", "-"),
            also.get(name, name),
            "column",
            "layer",
            "filling",
        )
    )
    assert list(tmp_path.iterdir()) == []


WORDS = {
    "": {
        "--mu-2 0.2": "mu_2 must be at least mu_s = 0.4, got 0.2",
        "--law coulomb --I0 0.3": "the law coulomb has the parameters mu_s, got I0",
        "--law sand": "law must be one of mu_of_i, coulomb, regularised, power, cohesive, free, go",
        "--d nan": "--d must be in [1e-12, 1e+12], got nan",
        "--cells 100": "cells must be a multiple of 8",
        "--cells 32": "at least 4 cells wide",
        "--aspect 0.1": "must fit into the box",
        "--gravity 0,1": "gravity must point down",
        "--cfl 0.9": "cfl must be in [0.01, 0.5]",
        "--frames 1": "frames must be in [2, 100000]",
        "--stride 100": "stride 100 leaves no points",
        "--mu-s -1": "mu_s must not be negative",
        "--nonsense": "unrecognized arguments: --nonsense",
        "--slope 20": "unrecognized arguments: --slope 20",
    },
    "drum": {"": "unrecognized arguments: drum"},
    "chute": {
        "--aspect 2": "unrecognized arguments: --aspect 2",
        "--slope 80": "slope must be in [0, 60], got 80",
        "--d 20": "must be smaller than the depth 10 of the layer, got 20",
        "--stride 5": "stride must leave two points",
        "--period 1e9": "period must be at most 16384 cells",
        "--cells 4": "cells must be in [8, 8192], got 4",
        "--t-end 1e9": "the free fall from the top of the layer",
    },
}
REFUSED = [
    (f"{scene} {w}".split(), text) for scene, rows in WORDS.items() for w, text in rows.items()
]
FOUND_BY_ATTACKS = [
    ({"threads": "10000"}, "threads must be in [1, 256], got 10000"),
    ({"cells": "2147483648"}, "cells must be in [32, 16384], got 2147483648"),
    ({"frames": "1e308"}, "frames must be"),
    ({"mu_s": "0"}, "true_mu_s must be from 1e-30"),
    ({"eta_min": "2e4"}, "eta_min must be below eta_max"),
    ({"eta_min": "1", "eta_max": "1"}, "eta_min must be below eta_max = 1, got 1"),
    ({"d": "3"}, "d, the grain diameter, must be smaller than the column"),
    ({"cells": "16384", "frames": "100000"}, "must fit into memory, got"),
    ({"box_height": "1e9"}, "at most 16384 cells high"),
    ({"t_end": "1e9"}, "t_end must be at most"),
    ({"length_unit": "m" * 65}, "length_unit must be the name of a unit"),
    ({"time_unit": "s\x1b[2J"}, "time_unit must be the name of a unit"),
    ({"wall_gap": "0"}, "--wall-gap must be in [1e-12, 1e+12], got 0"),
    ({"wall_friction": "0.1"}, "wall_friction needs the distance of the side walls"),
    ({"wall_gap": "1", "wall_friction": "-0.1"}, "--wall-friction must be in [0, 2], got -0.1"),
    ({"gravity": "0,-1,0"}, "gravity must be a list of 2"),
    ({"gravity": "0,-1e-300"}, "gravity must point down"),
    ({"gravity": "1e300,-1"}, "gravity must be in"),
]


@pytest.mark.parametrize(
    ("words", "message"),
    [*REFUSED, *((flags(**values), message) for values, message in FOUND_BY_ATTACKS)],
)
def test_nonsense_is_refused_in_one_sentence(
    words: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command.main([*words, "--out", str(tmp_path / "flow.h5")]) == 2
    err = capsys.readouterr().err
    assert message in err
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_the_solver_itself_refuses_what_it_cannot_count() -> None:
    for name, value in (("cells_x", 2**20), ("cells_y", 0), ("threads", 10000), ("chunk", 0)):
        parameters = _collapse.Parameters()
        parameters.cells_x = parameters.cells_y = 64
        setattr(parameters, name, value)
        with pytest.raises(ValueError, match=f"{name.partition('_')[0]} must be"):
            _collapse.Solver(parameters)
    with pytest.raises(TypeError):
        parameters.cells_x = 2**31


def test_threads_that_do_not_start_are_one_sentence(tmp_path: Path) -> None:
    """Address space for a few stacks of threads only."""
    code = (
        "import resource, sys, threading\n"
        "from granpinn.commands import simulate as command\n"
        "from granpinn.simulation.engine import Engine\n"
        "pages = int(open('/proc/self/statm').read().split()[0])\n"
        "limit = pages * resource.getpagesize() + 2**26\n"
        "resource.setrlimit(resource.RLIMIT_AS, (limit, limit))\n"
        "sys.exit(command.main(sys.argv[1:]))\n"
    )
    argv = [*flags(threads="256"), "--out", str(tmp_path / "flow.h5")]
    done = subprocess.run([sys.executable, "-c", code, *argv], capture_output=True, text=True)
    assert done.returncode == 1, done.stderr
    assert "threads: ask for fewer" in done.stderr or "not enough memory" in done.stderr
    assert "Traceback" not in done.stderr
    assert resource.getrlimit(resource.RLIMIT_AS)[0] == resource.RLIM_INFINITY
