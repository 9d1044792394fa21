"""The memory of a training is estimated before it is taken: within a factor of 2 of the peak."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from granpinn import identify
from granpinn.config import Config, ConfigError
from granpinn.fit import case
from tests.flows import make_flow

ROOT = Path(__file__).parents[2]


# Prints the estimate and the peak of the memory above that of the imports.
MEASURED = """
import json, sys, warnings
from pathlib import Path
import torch
from granpinn import identify
from granpinn.config import Config
from granpinn.fit.case import need_of_case
from granpinn.training.room import total
from tests.flows import make_flow
warnings.simplefilter("ignore")
torch.set_num_threads(1)
settings, (frames, rows, columns) = json.loads(sys.argv[1]), json.loads(sys.argv[2])
flow, config = make_flow(frames=frames, rows=rows, columns=columns), Config(**settings)

def peak():  # of this program alone: getrusage begins with that of its parent
    status = Path("/proc/self/status").read_text()
    return 1024 * int(status.split("VmHWM:")[1].split()[0])

before = peak()
need = total(need_of_case(flow, config))
identify(flow, config, run_dir=sys.argv[3])
print(json.dumps([need, peak() - before]))
"""


SMALL = {
    "steps": 2,
    "network.widths": [16, 16],
    "batch.interior": 64,
    "batch.surface": 8,
    "device": "cpu",
}


# What each of them makes large: settings, and frames, rows and columns of the flow.
LARGE: dict[str, tuple[dict[str, Any], tuple[int, int, int]]] = {
    "members": ({"network.widths": [224, 224, 16], "members": 16}, (6, 12, 10)),
    "batches": ({"batch.interior": 1_500_000}, (6, 12, 10)),
    "points": ({"batch.collocation": 50}, (12, 40, 40)),
}


@pytest.mark.parametrize("what", LARGE)
def test_the_estimate_is_within_a_factor_of_2_of_the_peak(what: str, tmp_path: Path) -> None:
    changes, size = LARGE[what]
    words = [json.dumps(SMALL | changes), json.dumps(size), str(tmp_path / "run")]
    done = subprocess.run(
        [sys.executable, "-c", MEASURED, *words], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    need, used = json.loads(done.stdout.splitlines()[-1])
    assert used / 2 <= need <= 2 * used, f"{need / 1e6:.0f} MB estimated, {used / 1e6:.0f} used"


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({"network__widths": (20000, 20000)}, r"needs about .* GB of memory \(networks 1\d\d, .*"),
        ({"batch__interior": 2**31}, r"batches 120, .* choose a smaller batch.interior"),
        ({"members": 1024, "network__widths": (900, 900, 9)}, r"fewer members, or use a larger"),
        (
            {"batch__collocation": 100.0, "dtype": "float64"},
            r"smaller batch.collocation or fewer",
        ),
    ],
    ids=["network", "batches", "members", "points"],
)
def test_what_does_not_fit_is_refused_with_its_numbers(
    settings: dict[str, Any], expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    free = 5 * 10**8 if "batch__collocation" in settings else 16 * 10**9
    monkeypatch.setattr(case, "available", lambda: free)
    flow = make_flow(frames=20, rows=60, columns=50)
    with pytest.raises(ConfigError, match=expected) as refusal:
        identify(flow, Config(device="cpu", **settings))
    assert f"got {free / 1e9:.3g} GB" in str(refusal.value)
