"""Gates T-4 and T-3 on real processes: signals, and a disk that is full."""

from __future__ import annotations

import resource
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from granpinn.data import Flow
from granpinn.errors import Interrupted
from granpinn.signals import Signals, caught
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


def test_a_signal_just_before_the_last_layer_is_not_lost() -> None:
    signals = Signals()
    signals.handle(signal.SIGINT, None)
    with pytest.raises(Interrupted, match="here") as stop:
        signals.stop_at_once("here")
    assert stop.value.signum == signal.SIGINT


def test_handlers_are_put_back() -> None:
    before = [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)]
    with caught() as signals:
        signal.raise_signal(signal.SIGTERM)
        assert signals.received == signal.SIGTERM
    assert [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)] == before


def test_a_full_disk_ends_the_run_and_leaves_the_checkpoint_before(
    flow_file: Path, tmp_path: Path
) -> None:
    """No file may grow beyond 8 KiB: the history reaches that, the checkpoints do not."""
    folder = tmp_path / "run"
    code = (
        "import resource, signal, sys\n"
        "from granpinn.commands.train import main\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (8192, resource.RLIM_INFINITY))\n"
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


def test_the_limit_of_this_process_is_untouched() -> None:
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] == resource.RLIM_INFINITY


def test_outside_the_main_thread_nothing_is_caught() -> None:
    before = signal.getsignal(signal.SIGINT)
    received: list[int | None] = []

    def work() -> None:
        with caught() as signals:
            assert signal.getsignal(signal.SIGINT) is before
            received.append(signals.received)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert received == [None]


@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM])
def test_an_ignored_signal_stays_ignored(signum: signal.Signals) -> None:
    before = signal.signal(signum, signal.SIG_IGN)
    try:
        with caught() as signals:
            signal.raise_signal(signum)
            assert not signals.received
            other = signal.SIGTERM if signum == signal.SIGINT else signal.SIGINT
            signal.raise_signal(other)
            assert signals.received == other
        assert signal.getsignal(signum) is signal.SIG_IGN
    finally:
        signal.signal(signum, before)
