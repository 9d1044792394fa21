"""Gate T-6: every single bit of a checkpoint is flipped; the checkpoint before must be taken.

    python -m bench.studies.reliability.checkpoint_bits

The run is a small training with two members, so that the JSON has every kind of entry.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

from bench.studies.reliability import runs
from bench.studies.reliability.record import RESULTS, Record, recorded
from granpinn.config import Config
from granpinn.identification.single import identify
from granpinn.training import checkpoint
from granpinn.training.checkpoint import CheckpointError

SETTINGS: dict[str, Any] = {
    "steps": 40,
    "members": 2,
    "network__widths": (6, 5),
    "batch__interior": 32,
    "batch__surface": 8,
    "checkpoint_every": 0.0,
    "simulated_pressure__frames": 0,
}


def main() -> int:
    """Run the gate; 1 if a flipped bit was believed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--every", type=int, default=1, help="flip every so many bits")
    parser.add_argument("--out", type=Path, default=RESULTS / "checkpoint_bits.json")
    options = parser.parse_args()
    module = "bench.studies.reliability.checkpoint_bits"
    with recorded("T-6", module, options.out) as record, tempfile.TemporaryDirectory() as folder:
        flow = runs.make_flow(Path(folder) / "flow.h5")
        identify(flow, Config(**SETTINGS), run_dir=Path(folder) / "run")
        flip(Path(folder) / "run" / "checkpoint", options.every, record)
    return int(bool(record.failures))


def flip(folder: Path, every: int, record: Record) -> None:
    """Flip the bits of both files of the newest checkpoint, one at a time."""
    whole = checkpoint.newest(folder)
    assert whole is not None
    for path in (whole.path, whole.path.with_suffix(".safetensors")):
        content = path.read_bytes()
        record.details[f"bits of {path.suffix}"] = 8 * len(content)
        for bit in range(0, 8 * len(content), every):
            damaged = bytearray(content)
            damaged[bit // 8] ^= 1 << bit % 8
            path.write_bytes(damaged)
            outcome, step = "the checkpoint before was taken", None
            try:
                found = checkpoint.newest(folder)
                step = found.state.training.step if found else None
                if step != whole.state.training.step - 1:
                    outcome = "believed"
            except CheckpointError as error:
                outcome = f"refused: {error}"
            failure = {"file": path.suffix, "bit": bit, "step": step}
            record.add(outcome, failure if outcome != "the checkpoint before was taken" else None)
        path.write_bytes(content)


if __name__ == "__main__":
    raise SystemExit(main())
