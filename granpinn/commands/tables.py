"""The command `python -m granpinn.tables --out DIR`: the paper's tables, beside its own numbers.

Exit codes: 0 done; 2 bad input; 1 the run could not go on; 129, 130, 143 stopped by
SIGHUP, SIGINT, SIGTERM.
"""

from __future__ import annotations

if __name__ == "__main__":
    from granpinn.command import cli

    cli.start("tables")

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from granpinn.command.cli import Command
from granpinn.command.parser import Parser
from granpinn.config import LEVELS, Config, ConfigError, setting, settings_of
from granpinn.config.fields import flag_of
from granpinn.config.toml import read_toml
from granpinn.config.values import convert
from granpinn.data import Flow
from granpinn.output import objection_to_folder, owned
from granpinn.tables import flows, output, study
from granpinn.tables.rows import TableCase
from granpinn.terminal import say
from granpinn.training import parallel, progress

PAPER_NOISE = ("0", "0.2", "0.8")
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
PASSED = ("recipe", "device", "steps", "max_time", "dtype", "seed", "members", "resume")


@dataclass(frozen=True, kw_only=True)
class TablesSettings:
    """The settings that granpinn.train does not have, or has for one training only."""

    noise_on: Literal["reference", "all"] = setting(
        "reference", "noise on the paper's case (0.6, 0.84) alone, if there, or on all"
    )
    seeds: int = setting(5, "trainings of each case", low=1, high=1000)
    cells: int = setting(512, "cells across the box of a simulation; the paper has 512")
    stride: int | None = setting(
        None, "every how many cells a point is kept; none: the spacing of the paper's data", low=1
    )
    I0: float | None = setting(None, "I0 for all; none: that of each flow file", positive=True)


@dataclass(frozen=True, kw_only=True)
class TablesRequest(TablesSettings):
    """What a command line gives.

    Attributes:
        paths: flow files, or folders of them; (): the six regimes are simulated.
        noise, level: those of the tables, ascending.
    """

    out: Path
    paths: tuple[Path, ...]
    noise: tuple[float, ...]
    level: tuple[str, ...]
    config: Config


OWN = settings_of(TablesSettings)


def parser() -> Parser:
    made = Parser(
        "tables",
        "[FLOW...] --out DIR [settings]",
        "Run the tables of the paper again, all cases and seeds as one batch.",
        EXAMPLES,
    )
    made.add_argument(
        "paths",
        nargs="*",
        type=Path,
        metavar="FLOW",
        help="flow files or folders of them; none: the paper's six regimes, simulated",
    )
    made.add_argument(
        "--out", type=Path, metavar="DIR", help="folder of tables.html, tables.csv and the runs"
    )
    made.add_argument(
        "--config", type=Path, metavar="FILE.toml", help="settings of granpinn.train; flags win"
    )
    made.add_argument(
        "--noise",
        nargs="+",
        metavar="SD",
        help="levels of noise, relative to the largest speed (default 0 0.2 0.8 for the six "
        "regimes, 0 for flow files)",
    )
    made.add_argument(
        "--level",
        nargs="+",
        metavar="LEVEL",
        help=f"{', '.join(LEVELS)}: what is measured, a batch for each (default V1; V2 with "
        "--recipe paper)",
    )
    made.add_settings(OWN)
    made.add_settings({name: settings_of(Config)[name] for name in PASSED})
    return made


def parse(argv: Sequence[str]) -> TablesRequest:
    """The request of a command line; the message of ConfigError is one sentence."""
    given = vars(parser().parse_args(argv))
    if "out" not in given:
        raise ConfigError("--out, the folder of the tables, is missing: give --out DIR")
    values = {"simulated_pressure.frames": SIMULATED_FRAMES} | (
        read_toml(given["config"]) if "config" in given else {}
    )
    values |= {name: given[name] for name in PASSED if name in given} | {"noise": 0.0}
    for name in ("noise", "level"):
        if len(set(given.get(name, ()))) < len(given.get(name, ())):
            words = " ".join(given[name])
            raise ConfigError(f"--{name} must be levels that differ, got {words}")
    if "level" in given:
        values["level"] = given["level"][0]
    config = Config(**values)
    own: dict[str, Any] = {"I0": values.get("I0")} | {
        name: given[name] for name in OWN if name in given
    }
    for name, value in own.items():
        OWN[name].check(value, flag_of(name))
    paths = tuple(given.get("paths", ()))
    if paths and "stride" in own:
        raise ConfigError("--stride is for simulated flows, but flow files are given: leave it out")
    if objection := objection_to_folder(given["out"]):
        raise ConfigError(f"--out {objection}")
    return TablesRequest(
        out=given["out"],
        paths=paths,
        noise=tuple(
            sorted(_noise(word) for word in given.get("noise", ("0",) if paths else PAPER_NOISE))
        ),
        level=tuple(
            sorted(replace(config, level=word).level for word in given.get("level", [config.level]))
        ),
        config=config,
        **own,
    )


def _noise(word: str) -> float:
    stated = settings_of(Config)["noise"]
    value: float = convert(word, stated.kind, "--noise")
    stated.check(value, "--noise")
    return value


def run(argv: Sequence[str]) -> int:
    request = parse(argv)
    with parallel.joined() as rank, owned(None if rank else request.out):
        return _run(request, rank)


def _run(request: TablesRequest, rank: int) -> int:
    listener: progress.Progress = progress.automatic() if rank == 0 else progress.Silent()
    parallel.choose_device(request.config.device)
    found = _flows(request, rank)
    cases = [
        case
        for level in request.level
        for case in study.cases_of(
            [TableCase(flow, 0.0, level) for flow in found], request.noise, request.noise_on
        )
    ]
    if rank == 0:
        members, batches = len(cases) * request.seeds, study.batches(len(request.level))
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


def _flows(request: TablesRequest, rank: int) -> list[Flow]:
    """The flows; the first process simulates missing ones for all."""
    if request.paths:
        return flows.given(request.paths)
    # The name holds the grid, so flows of another grid keep their files.
    stride = "" if request.stride is None else f"-stride-{request.stride}"
    folder = request.out / f"flows-{request.cells}{stride}"
    together = parallel.processes(request.config.device)
    found = []
    if rank == 0:
        found = flows.six_regimes(folder, request.cells, request.stride, say)
    together.barrier()
    return found or flows.six_regimes(folder, request.cells, request.stride, say)


main = Command("tables", parser, run)
