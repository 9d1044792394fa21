"""The command `python -m granpinn.train FLOW.h5 --out DIR`: from a flow file to a report.

flow file -> noise -> training set -> identification -> results.json, fields.h5 -> figures, report;
with --free-I0 and --resimulate between the results and the figures.

`torchrun --nproc-per-node K -m granpinn.train ...` lets K processes share every batch. If the
machine has GPUs, each process uses its own one.

Exit codes: 0 done; 2 bad input; 1 the run could not go on; 130, 143 stopped by SIGINT, SIGTERM.
"""

from __future__ import annotations

from granpinn.command import exit_codes

if __name__ == "__main__":
    exit_codes.guard_process("train")

import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path

from granpinn import report, results
from granpinn.command.arguments import parse
from granpinn.config import Config
from granpinn.data import add_noise, read_flow
from granpinn.identification.inertial_profile import profile_I0, require_mu_of_i
from granpinn.identification.single import identify
from granpinn.physics.laws import LAWS
from granpinn.results.findings import Resimulation
from granpinn.second_opinion import comparison, resimulation, simulator_fit
from granpinn.second_opinion.law_runs import LawRuns
from granpinn.second_opinion.resimulation import Column
from granpinn.simulation import progress as simulation_progress
from granpinn.training import parallel, progress


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; its exit code."""

    def run() -> int:
        config = parse(sys.argv[1:] if argv is None else argv)
        with parallel.joined() as rank:
            result = _identify(config, rank)
            if rank == 0:
                _conclude(config, result)
        return 0

    return exit_codes.exit_code("train", run)


def _identify(config: Config, rank: int) -> results.Result:
    """The result, with the profile of I0 if --free-I0 is set; every process takes part."""
    assert config.flow is not None
    assert config.out is not None
    folder = Path(config.out)
    if config.free_I0:
        require_mu_of_i(config)
    listener: progress.Progress = progress.automatic() if rank == 0 else progress.Silent()
    if config.tensorboard and rank == 0:
        listener = progress.TensorBoard(folder, listener)
    result = identify(config.flow, config, run_dir=folder, progress=listener)
    if not config.free_I0:
        return result
    profile = profile_I0(
        config.flow,
        config,
        steps=result.timing.steps,
        run_dir=folder / "profile",
        progress=progress.automatic(),
    )
    return dataclasses.replace(result, profile=profile)


def _conclude(config: Config, result: results.Result) -> None:
    """Add the second opinion if --resimulate is set; write the results and the report."""
    assert config.out is not None
    folder = Path(config.out)
    if config.resimulate:
        result = dataclasses.replace(result, resimulation=_resimulate(config, result, folder))
    if config.free_I0 or config.resimulate:
        results.write_results(result, folder / "results.json")
    print(result)
    print(f"report: {report.build(folder)}")


def _resimulate(config: Config, result: results.Result, folder: Path) -> Resimulation:
    """Simulate with the identified law, fit the simulator, and write resimulation.json."""
    assert config.flow is not None
    flow, cells, law = read_flow(config.flow), config.resimulation.cells, LAWS[result.law]
    summary, compared = resimulation.resimulate(
        flow, law, result.theta, cells, simulation_progress.automatic()
    )
    if summary.column is not None and simulator_fit.exists_for(law):
        seen = add_noise(flow, config.noise, config.seed)
        mu_s, mu_2, I0 = result.theta
        runs = LawRuns(seen, Column(*summary.column), I0, cells, config.free_I0)
        summary = dataclasses.replace(summary, fit=simulator_fit.fit(seen, runs, (mu_s, mu_2)))
    comparison.write_comparison(summary, compared, folder / comparison.FILE)
    return summary


if __name__ == "__main__":
    sys.exit(main())
