"""Two processes of torchrun on one CPU: they share a batch, or a list of members."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
import torch

from granpinn import identify, identify_many, results
from granpinn.commands.train import parse
from granpinn.config import Config, ConfigError
from granpinn.data import Flow, write_flow
from granpinn.errors import CannotGoOn
from granpinn.training import checkpoint, parallel
from granpinn.training.objective import Objective
from tests.command import pageless
from tests.flows import make_flow
from tests.runs import make_objective, tiny

FLAGS = ["--steps", "30", "--network.widths", "9,7", "--batch.interior", "34", "--batch.surface"]
FLAGS += ["6", "--log-every", "5", "--dtype", "float64", "--optimizer.average", "0.2"]


@pytest.fixture
def flow_file(tmp_path: Path) -> Path:
    path = tmp_path / "heap.h5"
    write_flow(make_flow(rows=12, columns=10), path)
    return path


def torchrun(*command: object) -> subprocess.Popen[str]:
    launcher = [sys.executable, "-m", "torch.distributed.run", "--standalone"]
    return subprocess.Popen(
        [*launcher, "--nproc-per-node", "2", *map(str, command)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )


def test_two_processes_make_the_steps_of_one(flow_file: Path, tmp_path: Path) -> None:
    one = tmp_path / "one"
    identify(flow_file, parse([str(flow_file), "--out", str(one), *FLAGS]).config, run_dir=one)
    process = torchrun(pageless.__file__, flow_file, "--out", tmp_path / "two", *FLAGS)
    out, err = process.communicate(timeout=100)
    assert process.returncode == 0, err
    assert out.count("report: ") == 1
    assert "2 processes" in err
    alone, shared = (checkpoint.newest(tmp_path / name / "checkpoint") for name in ("one", "two"))
    assert alone is not None
    assert shared is not None
    for name, tensor in alone.tensors.items():
        torch.testing.assert_close(shared.tensors[name], tensor, rtol=1e-6, atol=1e-9)
    assert len((tmp_path / "two" / "history.csv").read_text().splitlines()) == 7


def test_a_signal_to_one_process_stops_both(flow_file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    endless = [*FLAGS, "--steps", "1000000", "--max-time", "500"]
    process = torchrun(pageless.__file__, flow_file, "--out", folder, *endless)
    history = folder / "history.csv"
    while not (history.exists() and history.read_text().count("\n") > 3):
        assert process.poll() is None, process.communicate()
        time.sleep(0.1)
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    os.kill(int(children[-1]), signal.SIGTERM)
    _, err = process.communicate(timeout=60)
    assert err.count("granpinn.train: stopped at step ") == 2
    found = checkpoint.newest(folder / "checkpoint")
    assert found is not None
    assert f"stopped at step {found.state.training.step};" in err


SPREAD = """
import json, sys
from pathlib import Path
from granpinn import identify_many
from granpinn.training import parallel
from granpinn.config import Config
if __name__ == "__main__":
    flow, folder, changes = sys.argv[1:]
    with parallel.joined() as rank:
        found = identify_many([flow] * 3, Config(**json.loads(changes)), [0, 1, 2], run_dir=folder)
        values = [result.parameters.mu_s.value for result in found]
        Path(f"{folder}.{rank}").write_text(json.dumps(values))
"""


def test_members_are_spread_over_processes(flow_file: Path, tmp_path: Path) -> None:
    changes: dict[str, Any] = {"steps": 20, "network__widths": (9, 7), "batch__interior": 33}
    script = tmp_path / "spread.py"
    script.write_text(SPREAD)
    process = torchrun(script, flow_file, tmp_path / "run", json.dumps(changes))
    _, err = process.communicate(timeout=100)
    assert process.returncode == 0, err
    before = torch.get_num_threads()
    torch.set_num_threads(1)  # as in the processes: the last-layer step adds up in their order
    try:
        alone = identify_many([flow_file] * 3, Config(**changes), [0, 1, 2])
    finally:
        torch.set_num_threads(before)
    expected = [result.parameters.mu_s.value for result in alone]
    for rank in (0, 1):
        assert json.loads((tmp_path / f"run.{rank}").read_text()) == expected
    for e, value in enumerate(expected):
        written = results.read_results(tmp_path / "run" / f"{e:03d}" / "results.json")
        assert written.parameters.mu_s.value == value
    assert (tmp_path / "run" / "process-1" / "checkpoint").is_dir()


def test_shares_are_the_parts_of_one_batch(flow: Flow) -> None:
    config = tiny(batch__interior=34, batch__surface=6)
    members = make_objective(config, flow).members
    device = torch.device("cpu")
    counter, table = torch.tensor([7, 7, 0]), torch.ones(1, 3, dtype=torch.float64)
    drawn = []
    for share in ((0, 1), (0, 2), (1, 2)):
        o = Objective(members, config.batch, device, share)
        *data, _ = o.pool
        sizes = (o.batch.interior, o.batch.surface, o.share)
        drawn.append(
            torch.ops.granpinn.draw_batch(
                counter, table, o.seeds, o.places, *data, o.term_weights, *sizes
            )
        )
    for whole, first, second in zip(*(d[:5] for d in drawn), strict=True):
        assert torch.equal(whole, torch.cat([first, second], 1))


@pytest.mark.parametrize(
    ("environment", "expected"),
    [
        ({"WORLD_SIZE": "x"}, "WORLD_SIZE must be a whole number from 1 to 65536, got x"),
        ({"WORLD_SIZE": "-2"}, "WORLD_SIZE must be a whole number"),
        ({"WORLD_SIZE": "2"}, "RANK must be a whole number from 0 to 1, got nothing"),
        ({"WORLD_SIZE": "2", "RANK": "x"}, "RANK must be a whole number from 0 to 1, got x"),
        ({"WORLD_SIZE": "2", "RANK": "2"}, "RANK must be a whole number from 0 to 1, got 2"),
        ({"WORLD_SIZE": "2", "RANK": "0"}, "MASTER_PORT must be a whole number from 0 to 65535"),
        ({"WORLD_SIZE": "2", "RANK": "0", "MASTER_PORT": "1"}, "MASTER_ADDR must be the first"),
    ],
)
def test_an_environment_that_is_not_of_torchrun_is_refused(
    environment: dict[str, str], expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("WORLD_SIZE", "RANK", "LOCAL_RANK", "MASTER_ADDR", "MASTER_PORT"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    with pytest.raises(ConfigError, match=expected), parallel.joined():
        pass


def test_processes_that_cannot_join_say_so(monkeypatch: pytest.MonkeyPatch) -> None:
    environment = {"WORLD_SIZE": "2", "RANK": "1", "MASTER_ADDR": "no host", "MASTER_PORT": "1"}
    for name, value in environment.items():
        monkeypatch.setenv(name, value)

    def unreachable(backend: str) -> None:
        raise torch.distributed.DistNetworkError("the host cannot be reached\nsecond line")

    monkeypatch.setattr(torch.distributed, "init_process_group", unreachable)
    with (
        pytest.raises(CannotGoOn, match=r"cannot join \(the host cannot be reached\): check"),
        parallel.joined(),
    ):
        pass
