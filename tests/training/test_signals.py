"""Gates T-4 and T-3 on real processes: signals, and a disk that is full."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from granpinn.data import Flow, write_flow
from granpinn.errors import Interrupted
from granpinn.signals import caught
from granpinn.simulation import Collapse, simulate
from granpinn.training import checkpoint
from tests.runs import make_run, tiny

ENDLESS = ["--steps", "1000000", "--log-every", "10", "--network.widths", "6,5"]


def start(flow_file: Path, folder: Path, *flags: str) -> subprocess.Popen[str]:
    argv = [sys.executable, "-m", "granpinn.train", str(flow_file), "--out", str(folder)]
    return subprocess.Popen(
        [*argv, *ENDLESS, *flags], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )


def wait_for_rows(process: subprocess.Popen[str], folder: Path) -> None:
    history = folder / "history.csv"
    for _ in range(600):
        if history.exists() and history.read_text().count("\n") > 3:
            return
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)
    pytest.fail("the run did not begin")


@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_saves_and_stops_within_ten_seconds(
    signum: signal.Signals, flow_file: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    process = start(flow_file, folder)
    wait_for_rows(process, folder)
    process.send_signal(signum)
    _, err = process.communicate(timeout=10)
    assert process.returncode == 128 + signum
    last = err.splitlines()[-1]
    assert last.startswith("granpinn.train: stopped at step ")
    assert "--resume" in last
    assert "Traceback" not in err
    found = checkpoint.newest(folder / "checkpoint")
    assert found is not None
    assert f"stopped at step {found.state.training.step};" in last
    assert found.state.training.step > 0


def test_a_second_hangup_does_not_end_the_process() -> None:
    """A terminal that closes may send two."""
    with caught() as signals:
        for _ in range(2):
            signal.raise_signal(signal.SIGHUP)
    assert signals.received == signal.SIGHUP


def test_a_second_signal_ends_the_process_at_once() -> None:
    code = (
        "import time\nfrom granpinn.signals import caught\n"
        "with caught() as signals:\n"
        "    print('ready', flush=True)\n"
        "    while not signals.received: time.sleep(0.01)\n"
        "    print('first', flush=True)\n"
        "    time.sleep(100)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    for expected in ("ready", "first"):
        assert process.stdout.readline().strip() == expected
        process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=5) == 143
    process.stdout.close()


def test_a_signal_in_the_last_layer_step_stops_the_run(
    flow: Flow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = make_run(tiny(), flow, tmp_path)

    def last_layer(until: float) -> None:
        signal.raise_signal(signal.SIGTERM)
        pytest.fail("the signal was not noticed")

    monkeypatch.setattr(run.trainer, "solve_last_layer", last_layer)
    with pytest.raises(Interrupted, match="stopped at step 40; .*--resume") as stop:
        run.train()
    assert stop.value.signum == signal.SIGTERM
    again = make_run(tiny(resume=True), flow, tmp_path)
    again.train()
    assert again.trainer.solved


def test_a_full_disk_ends_the_run_and_leaves_the_checkpoint_before(
    flow_file: Path, tmp_path: Path
) -> None:
    """No file may grow beyond 64 KiB: the history reaches that, the checkpoints do not."""
    folder = tmp_path / "run"
    code = (
        "import resource, signal, sys\n"
        "from granpinn.commands.train import main\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (65536, resource.RLIM_INFINITY))\n"
        "sys.exit(main(sys.argv[1:]))\n"
    )
    argv = [
        str(flow_file),
        "--out",
        str(folder),
        *ENDLESS,
        "--log-every",
        "1",
        "--checkpoint-every",
        "0",
    ]
    done = subprocess.run(
        [sys.executable, "-c", code, *argv], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert str(folder / "history.csv") in done.stderr.splitlines()[-1]
    found = checkpoint.newest(folder / "checkpoint")
    assert found is not None
    assert found.state.training.step > 0


# Where a phase of a training begins: a function, and for steps the number of those before.
PHASES = {
    "pre-fit": ("granpinn.training.trainer:Trainer.advance", 50),
    "training": ("granpinn.training.trainer:Trainer.advance", 200),
    "last layer": ("granpinn.training.trainer:Trainer.solve_last_layer", 0),
    "copies": ("granpinn.uncertainty.sensitivity:continued", 0),
    "a check": ("granpinn.fit.case:baseline", 0),
    "figures": ("granpinn.figures.page:build", 0),
}
# A training that announces a phase and stays in it; if it is slow, it takes long to clean up.
CHILD = """
import importlib, sys, time
from granpinn.commands.shared import exit_codes
exit_codes.guard_process("train")
from granpinn.commands import train
from granpinn.training import checkpoint
place, before, slow = sys.argv[1], int(sys.argv[2]), sys.argv[3] == "slow"
module, _, path = place.partition(":")
owner, reached = importlib.import_module(module), []
*classes, name = path.split(".")
for part in classes:
    owner = getattr(owner, part)
real, save = getattr(owner, name), checkpoint.save
def clean_up():
    if slow:
        print("cleaning up", flush=True)
        time.sleep(60)
def announced(*args, **kwargs):
    if reached or before and args[0].step <= before:
        return real(*args, **kwargs)
    reached.append(name)
    try:
        print("reached", flush=True)
        end = time.monotonic() + 0.5
        while time.monotonic() < end:
            time.sleep(0.01)
        return real(*args, **kwargs)
    except KeyboardInterrupt:
        clean_up()
        raise
def saved(*args):
    if reached and before:
        clean_up()
    return save(*args)
setattr(owner, name, announced)
checkpoint.save = saved
sys.exit(train.main(sys.argv[4:]))
"""
SHORT = ["--network.widths", "16,16", "--batch.interior", "64", "--batch.surface", "16"]
SHORT += ["--steps", "400", "--log-every", "20"]


@pytest.fixture(scope="module")
def collapse(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small simulated collapse with an uncertain surface line, whose training has copies."""
    path = tmp_path_factory.mktemp("flow") / "flow.h5"
    exact = simulate(Collapse(0.4, 0.64, cells=64, frames=12, stride=2))
    write_flow(replace(exact, attributes={**exact.attributes, "surface_sd": 0.01}), path)
    return path


@pytest.mark.long
@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("twice", [False, True])
def test_a_signal_in_any_phase_stops_the_command(
    phase: str, signum: signal.Signals, twice: bool, collapse: Path, tmp_path: Path
) -> None:
    """Within 10 s; a second one while the process saves or cleans up, within a second."""
    place, before = PHASES[phase]
    words = [place, str(before), "slow" if twice else "", str(collapse), "--out", str(tmp_path)]
    process = subprocess.Popen(
        [sys.executable, "-c", CHILD, *words, *SHORT],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    for line in ("reached", "cleaning up")[: 1 + twice]:
        assert any(found.strip() == line for found in process.stdout)
        process.send_signal(signum)
    _, err = process.communicate(timeout=1 if twice else 10)
    assert process.returncode == 128 + signum
    assert "Traceback" not in err
    assert twice or err.splitlines()[-1].startswith("granpinn.train: stopped")
    assert checkpoint.newest(tmp_path / "checkpoint") is not None
