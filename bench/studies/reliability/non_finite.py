"""Gate T-5: NaN and infinities in every tensor of a training, at random steps.

    python -m bench.studies.reliability.non_finite --steps 5

A value is put once, or twice, into the data, the loss, the gradients, the parameters, the law or
the state of the optimiser. It must be noticed in the same step, or (parts that no step reads) in
the step before the state is copied or saved. A GPU makes a stretch of steps before the host looks:
there the value must be noticed at the end of its stretch. The first time the run goes back and on;
the second time it stops with a sentence that names the tensor. No checkpoint may ever hold the
value.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import torch

from bench.studies.reliability import runs
from bench.studies.reliability.record import RESULTS, recorded
from granpinn.config import Config
from granpinn.fit.case import pose
from granpinn.identification.start import start
from granpinn.training import checkpoint
from granpinn.training.guard import NonFiniteError
from granpinn.training.loop import TrainingLoop

TOTAL, EVERY = 40, 5  # steps of a run, and between the rows of its history
DATA = ("points", "velocity", "point_weights", "surface_points", "surface_pressure")
GRADIENTS = {"loss": "loss", "grad_params": "gradient of the network parameters"}
GRADIENTS |= {"grad_theta": "gradient of the friction law"}
VALUES = (math.nan, math.inf, -math.inf)
SETTINGS: dict[str, Any] = {
    "steps": TOTAL,
    "log_every": EVERY,
    "checkpoint_every": 0.0,
    "level": "V2",
    "network__widths": (9, 7),
    "batch__interior": 33,
    "batch__surface": 6,
    "optimizer__average": 0.8,
}


class Noticed(NamedTuple):
    """A value that was noticed: the first and last step of its stretch, and the step where."""

    first: int
    last: int
    seen: int


# A tensor of the state -> words of which the sentence must have one.
STATE = {
    "params": ("loss", "parameters", "gradient"),
    "q": ("friction law", "loss"),
    "optimizer.first": ("parameters", "tensor optimizer.first"),
    "optimizer.second": ("parameters", "tensor optimizer.second"),
    "optimizer.q.first": ("friction law",),
    "optimizer.q.second": ("friction law",),
    "average.params": ("tensor average.params",),
    "average.q": ("tensor average.q",),
}


def main() -> int:
    """Run the gate; 1 if a value was kept, or a run did not stop."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=5, help="random steps for each tensor")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu")
    parser.add_argument("--out", type=Path, help="default: results/non_finite-DEVICE.json")
    options = parser.parse_args()
    draw = Random(options.seed)
    out = options.out or RESULTS / f"non_finite-{options.device}.json"
    module = "bench.studies.reliability.non_finite"
    with recorded("T-5", module, out) as record, tempfile.TemporaryDirectory() as folder:
        flow = runs.make_flow(Path(folder) / "flow.h5")
        for name in (*DATA, *GRADIENTS, *STATE):
            for _ in range(options.steps):
                for value in VALUES:
                    for times in (1, 2):
                        step = draw.randrange(15, TOTAL)  # after the pre-fit
                        place = Path(tempfile.mkdtemp(dir=folder))
                        run = make(flow, place, options.device)
                        reason = one(run, place, name, value, step, times, draw.random())
                        case = {"tensor": name, "value": str(value), "step": step, "times": times}
                        outcome = reason or ("went back and on" if times == 1 else "stopped")
                        if name in DATA and not reason:
                            outcome = "stopped"
                        failure = case | {"reason": reason} if reason else None
                        record.add(outcome, failure)
    return int(bool(record.failures))


def make(flow: Path, folder: Path, device: str) -> TrainingLoop:
    """A small run that saves after every step."""
    config = Config(**SETTINGS | {"device": device})
    return start([pose(flow, config)], config, folder, None, time.monotonic())


def one(
    run: TrainingLoop, folder: Path, name: str, value: float, step: int, times: int, place: float
) -> str:
    """What is wrong after a value was put into a tensor at a step; "" for nothing."""
    noticed = inject(run, name, value, step, times, place)
    lasting = name in DATA  # bad data stay bad after a rollback
    message = ""
    try:
        run.train()
    except NonFiniteError as error:
        message = str(error)
    found = checkpoint.newest(folder / "checkpoint")
    if found is None or not all(t.isfinite().all() for t in found.tensors.values()):
        return "saved"
    if not noticed:
        return "not noticed"
    if any(n.seen > n.last for n in noticed) and not lasting:
        return f"noticed late: {noticed}"
    if times == 1 and not lasting:
        return "" if run.trainer.finished and not message else f"did not go on: {message}"
    if "again, after a rollback" not in message:
        return f"did not stop: {message}"
    words = STATE.get(name) or (GRADIENTS.get(name, "became NaN or infinite"),)
    return "" if any(word in message for word in words) else f"another name: {message}"


def inject(
    run: TrainingLoop, name: str, value: float, step: int, times: int, place: float
) -> list[Noticed]:
    """Put a value into a tensor, in the stretch of steps that has the step.

    The loss and the gradients exist on the device alone, inside of a captured step. They get the
    value there, in the step itself; all else gets it before the stretch.
    """
    trainer, objective = run.trainer, run.trainer.objective
    put: list[tuple[int, int]] = []
    noticed: list[Noticed] = []
    advance, recover, evaluate = trainer.advance, run._recover, objective.evaluate
    armed = torch.full_like(trainer.control.counter[0], -1)  # step of the value, on the device

    def spoil(tensor: torch.Tensor) -> None:
        flat = tensor.view(-1)
        flat[int(place * len(flat))] = value

    def advanced() -> None:
        stretch = range(trainer.step, trainer.step + trainer._stretch())
        due = step in stretch and len(put) < times
        armed.fill_(step if due and name in GRADIENTS else -1)
        if due:
            put.append((stretch[0], stretch[-1]))
            if name in STATE:
                spoil(trainer.tensors()[name])
            elif name in DATA:
                getattr(objective.pool, name).fill_(value)
        advance()

    def evaluated(*args: Any) -> Any:
        found = evaluate(*args)
        if name in GRADIENTS:
            sound = getattr(found, name)
            spoilt = sound.clone()
            spoil(spoilt)
            now = trainer.control.counter[0] == armed
            return replace(found, **{name: torch.where(now, spoilt, sound)})
        return found

    def recovered(error: NonFiniteError) -> None:
        # A part that no step reads is found after its stretch.
        noticed.append(Noticed(*put[-1], max(put[-1][0], trainer.step - 1)))
        recover(error)

    patches: dict[str, tuple[Any, Callable[..., Any]]] = {
        "advance": (trainer, advanced),
        "evaluate": (objective, evaluated),
        "_recover": (run, recovered),
    }
    for method, (owner, replacement) in patches.items():
        setattr(owner, method, replacement)
    return noticed


if __name__ == "__main__":
    raise SystemExit(main())
