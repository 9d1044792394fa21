"""The command `python -m granpinn.tables --out DIR`: the paper's tables, beside its own numbers.

Exit codes: 0 done; 2 bad input; 1 the run could not go on; 129, 130, 143 stopped by
SIGHUP, SIGINT, SIGTERM.
"""

from __future__ import annotations

from granpinn.command import exit_codes

if __name__ == "__main__":
    exit_codes.guard_process("tables")

import argparse
import dataclasses
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from granpinn.command.arguments import metavar_of
from granpinn.command.parser import Parser, program
from granpinn.config import LEVELS, Config, ConfigError, settings_of
from granpinn.config.fields import flag_of
from granpinn.config.toml import read_toml
from granpinn.config.values import convert, number, whole
from granpinn.data import Flow
from granpinn.fit.case import choose_device
from granpinn.output import objection_to_folder, owned
from granpinn.tables import flows, output, study
from granpinn.tables.rows import TableCase
from granpinn.terminal import say
from granpinn.training import parallel, progress

PAPER_NOISE = (0.0, 0.2, 0.8)
SIMULATED_FRAMES = 10  # frames with a simulated pressure in a training, unless --config has others
EXAMPLES = """examples:
  python -m granpinn.tables --out tables
      tables 1 and 2 of the paper: six collapses are simulated, then everything is trained at once
  python -m granpinn.tables --out tables --level V0 V1 V2 --noise 0
      from the velocity alone, with the surface line, and with its pressure, as in the paper
  python -m granpinn.tables --out paper --recipe paper --steps 33000
      the paper's own method, with fewer steps
  python -m granpinn.tables cases --out own --noise 0 0.02 --seeds 20
      any folder of flow files"""
# Settings of granpinn.train that are flags here too.
PASSED = ("recipe", "device", "steps", "max_time", "dtype", "seed", "members")


@dataclass(frozen=True)
class Request:
    """The settings of the command line."""

    paths: list[Path]
    out: Path
    noise: list[float]
    noise_on: str
    levels: list[str]
    seeds: int
    cells: int
    stride: int | None
    I0: float | None
    config: Config


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; its exit code."""

    def run() -> int:
        request = parse(sys.argv[1:] if argv is None else argv)
        with parallel.joined() as rank, owned(None if rank else request.out):
            return _run(request, rank)

    return exit_codes.exit_code("tables", run)


def parse(argv: Sequence[str]) -> Request:
    """The request of a command line; the message of ConfigError is one sentence."""
    parser = Parser(
        prog=program("tables"),
        description="Run the tables of the paper again, all cases and seeds as one batch.",
        epilog=EXAMPLES.replace("python -m granpinn.tables", program("tables")),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    add = parser.add_argument
    add("paths", nargs="*", type=Path, metavar="FLOW", help="flow files or folders of them; "
        "none: the paper's six regimes, simulated")  # fmt: skip
    add("--out", type=Path, metavar="DIR", help="folder of tables.html, .json, .csv and the runs")
    add("--noise", type=number, nargs="+", metavar="SD", help="levels of noise, relative to the "
        "largest speed (default 0 0.2 0.8 for the six regimes, 0 for flow files)")  # fmt: skip
    add("--noise-on", choices=("reference", "all"), default="reference", help="noise on the "
        "paper's case (0.6, 0.84) alone, if there, or on all (default reference)")  # fmt: skip
    add("--level", nargs="+", metavar="LEVEL", help=f"{', '.join(LEVELS)}: what is measured, a "
        "batch for each (default V1; V2 with --recipe paper)")  # fmt: skip
    add("--seeds", type=whole, default=5, metavar="N", help="trainings of each case (default 5)")
    add("--cells", type=whole, default=512, metavar="N", help="cells across the box of a "
        "simulation (default 512, as in the paper)")  # fmt: skip
    add("--stride", type=whole, metavar="N", help="every how many cells a point is kept (default: "
        "the spacing of the paper's data)")  # fmt: skip
    add("--I0", type=number, metavar="X", help="I0 for all (default: that of each flow file)")
    add("--config", type=Path, metavar="FILE.toml", help="settings of granpinn.train; flags win")
    add("--resume", action="store_true", help="continue the run in --out")
    for name in PASSED:
        metavar = metavar_of(settings_of(Config)[name])
        add(flag_of(name), dest=name, metavar=metavar, help="as in granpinn.train")
    return _request(parser.parse_args(argv))


def _request(given: argparse.Namespace) -> Request:
    values = {"simulated_pressure.frames": SIMULATED_FRAMES} | (
        read_toml(given.config) if given.config else {}
    )
    for name in PASSED:
        if (text := getattr(given, name)) is not None:
            values[name] = convert(text, settings_of(Config)[name].kind, flag_of(name))
    I0 = values.get("I0") if given.I0 is None else given.I0
    values |= {"resume": given.resume, "noise": 0.0}
    if given.level is not None:
        values["level"] = given.level[0]
    config = Config(**values)
    levels = [dataclasses.replace(config, level=name).level for name in given.level or ()]
    if len(set(levels)) < len(levels):
        raise ConfigError(f"--level must be levels that differ, got {' '.join(levels)}")
    noise = given.noise or ([0.0] if given.paths else list(PAPER_NOISE))
    if not all(math.isfinite(sd) and 0 <= sd <= 100 for sd in noise):
        raise ConfigError(f"--noise must be numbers from 0 to 100, got {_listed(noise)}")
    if len(set(noise)) < len(noise):
        raise ConfigError(f"--noise must be levels that differ, got {_listed(noise)}")
    if not 1 <= given.seeds <= 1000:
        raise ConfigError(f"--seeds must be a number of trainings, 1 to 1000, got {given.seeds}")
    if I0 is not None and not (math.isfinite(I0) and I0 > 0):
        raise ConfigError(f"--I0 must be positive, got {I0}")
    if given.out is None:
        raise ConfigError("--out, the folder of the tables, is missing: give --out DIR")
    if objection := objection_to_folder(given.out):
        raise ConfigError(f"--out {objection}")
    if given.paths and given.stride is not None:
        raise ConfigError("--stride is for simulated flows, but flow files are given: leave it out")
    return Request(
        given.paths,
        given.out,
        sorted(noise),
        given.noise_on,
        sorted(levels) or [config.level],
        given.seeds,
        given.cells,
        given.stride,
        I0,
        config,
    )


def _listed(values: Sequence[Any]) -> str:
    return " ".join(f"{value:g}" for value in values)


def _run(request: Request, rank: int) -> int:
    listener: progress.Progress = progress.automatic() if rank == 0 else progress.Silent()
    choose_device(request.config.device)
    found = _flows(request, rank)
    cases = [
        case
        for level in request.levels
        for case in study.cases_of(
            [TableCase(flow, 0.0, level) for flow in found], request.noise, request.noise_on
        )
    ]
    if rank == 0:
        members, batches = len(cases) * request.seeds, study.batches(len(request.levels))
        say(f"{len(cases)} cases x {request.seeds} seeds = {members} trainings as {batches}")
    done = study.run(
        cases, request.config, request.seeds, request.I0, request.out / "runs", listener
    )
    if rank > 0:
        return 0
    page = output.write(done, request.out)
    print(output.text(done))
    print(f"tables: {page}")
    return 0


def _flows(request: Request, rank: int) -> list[Flow]:
    """The flows; the first process simulates missing ones for all."""
    if request.paths:
        return flows.given(request.paths)
    # The name holds the grid, so flows of another grid keep their files.
    stride = "" if request.stride is None else f"-stride-{request.stride}"
    folder = request.out / f"flows-{request.cells}{stride}"
    together = parallel.processes(choose_device(request.config.device))
    found = []
    if rank == 0:
        found = flows.six_regimes(folder, request.cells, request.stride, say)
    together.barrier()
    return found or flows.six_regimes(folder, request.cells, request.stride, say)


if __name__ == "__main__":
    sys.exit(main())
