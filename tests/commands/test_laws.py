"""Every friction law end to end: simulate, inspect, train, resume, report."""

from __future__ import annotations

import json
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import pytest

from granpinn.data import read_flow
from granpinn.physics.laws import LAWS
from granpinn.training.history import columns

COMMANDS = ("inspect", "simulate", "train")


inspect, simulate, train = (import_module(f"granpinn.commands.{name}") for name in COMMANDS)


SMALL = ("--steps", "50", "--network.widths", "16,16", "--batch.interior", "64")


COLUMN = ("--cells", "64", "--height", "1", "--aspect", "1", "--t-end", "1", "--frames", "12")


Simulate = Callable[[str], Path]


@pytest.fixture(scope="module")
def flow_of(tmp_path_factory: pytest.TempPathFactory) -> Simulate:
    """The file of a simulated collapse, by the name of its law."""
    made: dict[str, Path] = {}

    def of(law: str) -> Path:
        if law not in made:
            made[law] = tmp_path_factory.mktemp(law) / "flow.h5"
            words = ("--law", law, "--d", "0.05", "--stride", "2", "--out", str(made[law]))
            assert simulate.main([*words, *COLUMN]) == 0
        return made[law]

    return of


@pytest.mark.usefixtures("no_report")
@pytest.mark.parametrize("name", LAWS)
def test_every_law_from_the_simulation_to_the_results(
    name: str,
    flow_of: Simulate,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    law, flow, run = LAWS[name], flow_of(name), tmp_path / "run"
    truth = read_flow(flow).truth
    assert truth is not None
    assert truth.law == name
    # rho |g| H = 1 in this column
    assert truth.theta == tuple(p.typical for p in law.parameters)
    assert inspect.main([str(flow), "--law", name]) == 0

    words = [str(flow), "--out", str(run), "--law", name, *SMALL]
    assert train.main(words) == 0
    shown = capsys.readouterr().out
    for parameter in law.free:
        assert parameter in shown

    found = json.loads((run / "results.json").read_text())
    assert found["law"]["name"] == name
    assert list(found["parameters"]) == list(law.names)
    for p in law.parameters:
        of_result = found["parameters"][p.name]
        assert of_result["fixed"] == p.fixed
        assert of_result["value"] > 0
        if not p.fixed:
            assert p.bounds[0] <= of_result["value"] <= 2 * p.bounds[1]
            # the coefficients of a curve over another range of I have no error
            assert (found["error_percent"][p.name] is None) == (p.name in law.curve)
    header = (run / "history.csv").read_text().splitlines()[0]
    assert header == ",".join(columns(law))


@pytest.mark.usefixtures("no_report")
@pytest.mark.parametrize("name", ["coulomb", "free"])
def test_the_strong_form_and_a_resumed_run(name: str, flow_of: Simulate, tmp_path: Path) -> None:
    run, found = tmp_path / "run", []
    words = [str(flow_of(name)), "--out", str(run), "--law", name, "--form", "strong", *SMALL]
    for more in ((), ("--resume",)):
        assert train.main([*words, *more]) == 0
        found.append(json.loads((run / "results.json").read_text())["parameters"])
    assert found[0] == found[1]
    assert list(found[0]) == list(LAWS[name].names)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--law", "coulomb", "--rheology.fix", "mu_inf=1"), "the law coulomb holds no other"),
        (("--law", "cohesive", "--rheology.fix", "c=1"), "the law cohesive holds no other"),
        (("--law", "power", "--rheology.fix", "b=1"), "the law power holds n fixed, got b"),
        (("--law", "free", "--rheology.fix", "I_low"), "must be NAME=NUMBER"),
        (("--law", "free", "--rheology.fix", "c1=1"), "holds I_low, I_high fixed, got c1"),
        (
            ("--law", "free", "--rheology.fix", "I_low=-1"),
            "I_low must be in [1e-30, 1e+30], got -1",
        ),
        (("--law", "regularised", "--rheology.fix", "I0=0.2"), "give I0 by the flag --I0 0.2"),
        (("--law", "free", "--rheology.fix", "I_high=1e-6"), "I_high must be above I_low"),
        (("--law", "power", "--I0", "0.2"), "the friction law power has no I0"),
    ],
)
def test_impossible_fixed_values_are_refused(
    words: tuple[str, ...],
    message: str,
    flow_of: Simulate,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert train.main([str(flow_of("mu_of_i")), "--out", str(tmp_path / "run"), *words]) == 2
    shown = capsys.readouterr().err
    assert message in shown
    assert len(shown.strip().splitlines()) == 1
