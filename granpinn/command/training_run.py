"""What `granpinn train` does with its settings: identification, second opinion, results, report."""

from __future__ import annotations

import dataclasses
from contextlib import AbstractContextManager, nullcontext, suppress
from pathlib import Path

from granpinn import report, results
from granpinn.command import flow_warnings
from granpinn.command.answer import Answer
from granpinn.command.next_step import require_flow_file
from granpinn.config import Config, ConfigError
from granpinn.data import Flow, add_noise, read_flow
from granpinn.data.large import spread
from granpinn.identification.bootstrap import bootstrap
from granpinn.identification.case import choose_device
from granpinn.identification.finish import require_kept
from granpinn.identification.inertial_profile import profile_I0, require_mu_of_i
from granpinn.identification.single import identify
from granpinn.output import OutputError, objection_to_folder, owned
from granpinn.report import early
from granpinn.report.painters import Painters, painters
from granpinn.report.prepared import Prepared
from granpinn.results import NotDone, findings
from granpinn.results.attempt import (
    BOOTSTRAP,
    PROFILE,
    REPORT,
    RESIMULATION,
    SIMULATOR_FIT,
    asked_for,
    attempt,
    having,
    lacking,
    pending,
)
from granpinn.second_opinion import comparison, resimulation, simulator_fit
from granpinn.second_opinion.law_runs import LawRuns
from granpinn.second_opinion.resimulation import Column
from granpinn.simulation import progress as simulation_progress
from granpinn.terminal import say
from granpinn.training import parallel, progress
from granpinn.uncertainty.unknown_I0 import with_unknown_I0


def run(config: Config) -> int:
    """Identify, write the results and the report; the exit code."""
    assert config.flow is not None
    assert config.out is not None
    require_flow_file(Path(config.flow))
    if objection := objection_to_folder(config.out):
        raise ConfigError(f"--out {objection}")
    with (
        parallel.joined() as rank,
        owned(None if rank else config.out),
        flow_warnings.in_one_line(),
        nullcontext() if rank else _painters(config) as painters,
    ):
        answer, drawn = Answer(), Drawn(Path(config.out), painters)
        result = _identify(config, rank, answer, drawn)
        if rank == 0:
            result = _conclude(config, result, answer, drawn)
    missing = asked_for(result)
    for part in missing if rank == 0 else ():
        say(f"granpinn.train: {part}; the other results are valid")
    return 1 if missing else 0


class Drawn:
    """The part of the page that is made while the pressure is simulated.

    The threads of the simulation leave Python alone, and the figures need nothing else.
    """

    def __init__(self, folder: Path, painters: Painters | None) -> None:
        self._folder, self._painters = folder, painters
        self.prepared = Prepared()

    def draw(self) -> None:
        """Draw the figures; what fails, fails again in its place, when the page is built."""
        with suppress(OutputError):
            made = attempt(REPORT, lambda: early.draw(self._folder, self._painters))
            self.prepared = Prepared() if isinstance(made, NotDone) else made


def _painters(config: Config) -> AbstractContextManager[Painters | None]:
    """The processes for the figures, if a GPU trains and leaves the cores of the CPU idle."""
    if choose_device(config.device).type == "cpu":
        return nullcontext()
    assert config.out is not None
    return painters(Path(config.out))


def _identify(config: Config, rank: int, answer: Answer, drawn: Drawn) -> results.Result:
    """The result with what --free-I0 and --calibrate ask for; every process takes part."""
    assert config.flow is not None
    assert config.out is not None
    folder = Path(config.out)
    if config.free_I0:
        require_mu_of_i(config)
    listener: progress.Progress = progress.automatic() if rank == 0 else progress.Silent()
    if config.tensorboard and rank == 0:
        listener = progress.TensorBoard(folder, listener)
    flow = config.flow

    def known(result: results.Result) -> None:
        answer.show(result)
        drawn.draw()

    result: results.Result = identify(
        flow, config, run_dir=folder, progress=listener, answered=answer.show, known=known
    )
    after = {
        PROFILE: config.free_I0,
        BOOTSTRAP: config.calibrate,
        RESIMULATION: config.resimulate,
    }
    result = pending(result, *(part for part, wanted in after.items() if wanted))
    if config.free_I0:
        _keep(result, folder, rank, answer)
        result = _with_profile(config, result, folder)
    if config.calibrate:
        _keep(result, folder, rank, answer)
        result = _with_bootstrap(config, result, folder, rank)
    return result


def _keep(result: results.Result, folder: Path, rank: int, answer: Answer) -> None:
    """Write and show what is known before a part that takes long."""
    if rank == 0:
        results.write_results(result, folder / "results.json")
        answer.show(result)


def _with_profile(config: Config, result: results.Result, folder: Path) -> results.Result:
    """The result with the profile of I0, or why it has none."""
    assert config.flow is not None
    flow = config.flow
    profile = attempt(
        PROFILE,
        lambda: profile_I0(
            flow,
            config,
            steps=result.timing.steps,
            run_dir=folder / "profile",
            progress=progress.automatic(),
        ),
    )
    if isinstance(profile, NotDone):
        return lacking(result, profile)
    return having(result, PROFILE, profile=with_unknown_I0(profile, result))


def _with_bootstrap(
    config: Config, result: results.Result, folder: Path, rank: int
) -> results.Result:
    """The result with the errors in simulated flows, or why it has none."""
    assert config.flow is not None
    flow = config.flow
    listener = progress.automatic() if rank == 0 else progress.Silent()
    found = attempt(
        BOOTSTRAP,
        lambda: bootstrap(flow, result, config, run_dir=folder / "bootstrap", progress=listener),
    )
    if isinstance(found, NotDone):
        return lacking(result, found)
    return having(result, BOOTSTRAP, bootstrap=found)


def _conclude(
    config: Config, result: results.Result, answer: Answer, drawn: Drawn
) -> results.Result:
    """Add the second opinion if --resimulate is set; write the results and the report."""
    assert config.out is not None
    folder = Path(config.out)
    answer.show(result)
    if config.free_I0 or config.calibrate or config.resimulate:
        results.write_results(result, folder / "results.json")
    if config.resimulate:
        result = _resimulate(config, result, folder)
        results.write_results(result, folder / "results.json")
        answer.show(result)
    page = attempt(REPORT, lambda: report.build(folder, prepared=drawn.prepared))
    if isinstance(page, NotDone):
        result = lacking(result, page)
        results.write_results(result, folder / "results.json")
        answer.show(result)
    else:
        print(f"report: {page}")
    print(f"assessment: {result.assessment}")
    require_kept(folder)
    return result


def _resimulate(config: Config, result: results.Result, folder: Path) -> results.Result:
    """Simulate with the identified law, fit the simulator, and write resimulation.json."""
    assert config.flow is not None
    path, cells, law = config.flow, config.resimulation.cells, result.friction_law

    def again() -> tuple[Flow, findings.Resimulation, comparison.Comparison | None]:
        flow = spread(read_flow(path))
        listener = simulation_progress.automatic()
        return flow, *resimulation.resimulate(
            flow, law, result.theta, cells, listener, config.side_walls.friction
        )

    found = attempt(RESIMULATION, again)
    if isinstance(found, NotDone):
        return lacking(result, found)
    flow, summary, compared = found
    result = having(result, RESIMULATION, resimulation=summary)
    if summary.column is not None and simulator_fit.exists_for(law):
        column = Column(*summary.column)
        fitted = attempt(SIMULATOR_FIT, lambda: _fit(config, flow, column, result.theta))
        if isinstance(fitted, NotDone):
            result = lacking(result, fitted)
        else:
            summary = dataclasses.replace(summary, fit=fitted)
            result = having(result, SIMULATOR_FIT, resimulation=summary)
    comparison.write_comparison(summary, compared, folder / comparison.FILE)
    return result


def _fit(
    config: Config, flow: Flow, column: Column, theta: tuple[float, ...]
) -> findings.SimulatorFit:
    """Fit the simulator to the flow, from the identified mu(I) law."""
    seen = add_noise(flow, config.noise, config.seed)
    mu_s, mu_2, I0 = theta
    cells, friction = config.resimulation.cells, config.side_walls.friction
    runs = LawRuns(seen, column, I0, cells, config.free_I0, friction)
    try:
        return simulator_fit.fit(seen, runs, (mu_s, mu_2))
    finally:
        runs.stop()
