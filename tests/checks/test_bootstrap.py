"""The parametric bootstrap: its arithmetic, its settings, its flows, and its place in a run."""

from __future__ import annotations

import dataclasses
import math
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from granpinn import identify_many, results
from granpinn.checks.bootstrap import (
    bootstrap,
    compared,
    recovery,
    simulated_flows,
)
from granpinn.commands import train
from granpinn.data import Flow, write_flow
from granpinn.physics.laws import mu_of_i
from granpinn.results import Parameter, Parameters, Result
from granpinn.simulation import Collapse, simulate
from granpinn.training.progress import Progress
from tests.examples import make_result
from tests.runs import tiny

FLAGS = ["--steps", "6", "--log-every", "2", "--network.widths", "6,5", "--batch.interior", "16"]
FLAGS += ["--simulated_pressure.frames", "0", "--calibration.flows", "2"]


@pytest.fixture(scope="module")
def flow() -> Flow:
    return simulate(Collapse(0.4, 0.64, cells=64, stride=2, frames=12, t_end=3.0, threads=1))


def planted(mu_s: float, mu_2: float, failure: str | None = None) -> Result:
    parameters = Parameters(
        mu_s=Parameter(mu_s, False), mu_2=Parameter(mu_2, False), I0=Parameter(0.3, True)
    )
    return make_result(parameters=parameters, failure=failure)


def test_bias_scatter_and_rms_of_planted_values() -> None:
    """Errors of 1, -1, 2 and 2 hundredths: mean 1, squares 1, 1, 4 and 4."""
    found = recovery(0.4, np.array([0.41, 0.39, 0.42, 0.42]), 0.02)
    assert found.bias == pytest.approx(0.01)
    assert found.scatter == pytest.approx(0.01 * math.sqrt(6 / 3))
    assert found.rms == pytest.approx(0.01 * math.sqrt(10 / 4))
    assert found.bias_error == pytest.approx(0.01 * math.sqrt(2) / 2)
    assert found.scatter_error == pytest.approx(0.01 * math.sqrt(2 / 6))
    # sd of the squares is 1e-4 sqrt(3); rms = sqrt(mean), so its error is this / (2 rms sqrt(4)).
    assert found.rms_error == pytest.approx(1e-4 * math.sqrt(3) / (2 * found.rms * 2))
    assert not found.exceeds
    assert not recovery(0.4, np.array([0.41, 0.39, 0.42, 0.42]), 0.015).exceeds  # by chance
    assert recovery(0.4, np.array([0.41, 0.39, 0.42, 0.42]), 0.004).exceeds
    assert not recovery(0.4, np.array([0.5, 0.6]), None).exceeds
    assert recovery(0.4, np.array([0.4, 0.4]), 0.0).rms_error == 0


def test_errors_of_the_law_against_its_error_bars() -> None:
    result = make_result()  # (0.41, 0.61): mu_s with std 0.012, mu_2 without
    found = compared(result, [planted(0.45, 0.6), planted(0.44, 0.62), planted(0.9, 2.0, "nan")])
    assert (found.flows, found.diverged, found.steps) == (2, 1, 4000)
    assert list(found.parameters) == ["mu_s", "mu_2"]
    assert found.parameters["mu_s"].bias == pytest.approx(0.035)
    assert found.parameters["mu_s"].std == 0.012
    assert found.parameters["mu_2"].std is None
    assert result.law.curve is not None
    assert found.I == result.law.curve.I == (0.01, 0.045, 0.2)
    for I, mu, of_mu in zip(found.I, result.law.curve.mu, found.friction, strict=True):
        laws = [mu_of_i.friction(I, 0.45, 0.6, 0.3), mu_of_i.friction(I, 0.44, 0.62, 0.3)]
        assert of_mu.bias == pytest.approx(np.mean(laws) - mu)
    # The band of +-0.02 is 1.86 standard deviations wide at each side.
    assert found.friction[0].std == pytest.approx(0.02 / 1.86)
    (reason, *_) = make_result(checks={"bootstrap": found}).assessment.reasons
    assert reason.startswith(
        "The error bars may be too narrow: the rms error of flows simulated with this law exceeds "
        "the stated standard deviation of mu_s (0.035 +- 0.005 against 0.012)"
    )
    close = compared(result, [planted(0.411, 0.61), planted(0.409, 0.61)])
    assert not close.parameters["mu_s"].exceeds


class Told(Progress):
    """Keeps the messages, and may act on each."""

    def __init__(self, act: Callable[[str], None] = lambda text: None) -> None:
        self.texts: list[str] = []
        self.act = act

    def message(self, text: str) -> None:
        self.texts.append(text)
        self.act(text)


def scenes(*cells: int) -> Sequence[Collapse]:
    return [
        Collapse(0.4 * (1 + 1e-6 * k), 0.64, cells=n, frames=12, t_end=3.0, threads=1)
        for k, n in enumerate(cells)
    ]


def test_the_flows_have_the_frames_and_the_noise_and_differ(flow: Flow) -> None:
    rough = np.random.default_rng(0).normal(0, 0.05, (2, *flow.u.shape)).astype(np.float32)
    noisy = dataclasses.replace(flow, u=flow.u + rough[0], v=flow.v + rough[1])
    told = Told()
    made, noise = simulated_flows(noisy, scenes(64, 64), tiny(), told)
    assert noise.sd == pytest.approx((0.05, 0.05), rel=0.2)  # from 12 frames
    for one in made:
        np.testing.assert_array_equal(one.t, flow.t)
        assert one.valid.sum() == pytest.approx(flow.valid.sum(), rel=0.01)
        off = (one.u - flow.u)[one.valid & flow.valid]
        assert off.std() == pytest.approx(noise.sd[0], rel=0.1)
    both = made[0].valid & made[1].valid
    between = (made[0].u - made[1].u)[both].std() / math.sqrt(2)
    assert between == pytest.approx(noise.sd[0], rel=0.1)
    assert told.texts[0] == "simulating 2 flows with the identified law, 64 cells"
    assert told.texts[-1].startswith("simulated 2 of 2 flows after ")


def test_an_interrupt_ends_the_simulations(flow: Flow) -> None:
    def stop(text: str) -> None:
        if text.startswith("simulated 1 of"):
            raise KeyboardInterrupt

    before = set(threading.enumerate())
    with pytest.raises(KeyboardInterrupt):  # the second one would take minutes
        simulated_flows(flow, scenes(64, 1024), tiny(), Told(stop))
    end = time.monotonic() + 30
    while (left := set(threading.enumerate()) - before) and time.monotonic() < end:
        time.sleep(0.05)
    assert not left


def late(flow: Flow) -> Flow:
    """The first frame is a second after the release."""
    assert flow.surface is not None
    surface = dataclasses.replace(flow.surface, t=flow.surface.t + 1)
    return dataclasses.replace(flow, t=flow.t + 1, surface=surface)


def test_a_flow_without_a_scene_has_the_reason(flow: Flow) -> None:
    found = bootstrap(late(flow), make_result(), tiny(), identify_many)
    assert found.objection is not None
    assert found.objection.startswith("the first frame is not the start: its time is 1.25")
    assert str(found) == f"no flows simulated with this law: {found.objection}"


def test_a_run_has_it_and_a_finished_run_gets_it(
    flow: Flow,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    figures: Callable[..., None],
) -> None:
    figures()
    write_flow(flow, tmp_path / "column.h5")
    out = tmp_path / "run"
    words = [str(tmp_path / "column.h5"), "--out", str(out)]
    assert train.main([*words, *FLAGS]) == 0
    assert "bootstrap" not in results.read_results(out / "results.json").checks
    assert "Found again" not in (out / "report.html").read_text()
    assert train.main([*words, "--resume", "--calibrate", *FLAGS]) == 0
    result = results.read_results(out / "results.json")
    found = result.checks["bootstrap"]
    assert (found.objection, found.flows, found.cells, found.steps) == (None, 2, 64, 6)
    assert result.not_done == {}
    printed = capsys.readouterr()
    assert found.words in printed.out
    assert "simulated 2 of 2 flows after" in printed.err
    values = [
        results.read_results(out / "bootstrap" / f"00{k}" / "results.json").theta for k in (0, 1)
    ]
    assert values[0] != values[1]
    errors = [theta[0] - result.theta[0] for theta in values]
    assert found.parameters["mu_s"].bias == pytest.approx(np.mean(errors))
    page = (out / "report.html").read_text()
    assert "Found again in simulated flows" in page
    assert found.parameters["mu_s"].texts[0].replace("+-", "±") in page
    assert "neither the departure of nature from the law" in page
    # Again, from what is there: nothing is trained anew.
    assert train.main([*words, "--resume", "--calibrate", *FLAGS]) == 0
    repeated = results.read_results(out / "results.json").checks["bootstrap"]
    assert dataclasses.replace(repeated, seconds=found.seconds) == found
