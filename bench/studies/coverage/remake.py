"""All simulated populations of the coverage study.

python -m bench.studies.coverage.remake --flows FLOWS --out RESULTS --device cuda
python -m bench.studies.coverage.table RESULTS/*.json
python -m bench.studies.coverage.fit --write

The first command simulates the flows, each on one core, and trains every population as soon as its
flows are there, one on each GPU. A population whose results are in `--out` is not made again, so a
run that was stopped goes on. `--until 500` begins none after 500 s, and `--only NAME ...` makes
some. The films, which need a PIV program, are made by films.py. The other commands put the results
into one table and fit the error model to it. Settings that are not its own go to every
identification.

Defends: a change of the training comes with error bars of its own.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue

import torch

from bench.studies.cores import processes
from bench.studies.coverage import run
from bench.studies.coverage.materials import make, path_of

USUAL, VARIED = "--truths 90 --controls 2 --draw 0", "--truths 60 --controls 0 --varied"
OTHERS = "--truths 48 --controls 0 --draw 7"
CONTROLS = "--truths 0 --controls 4 --draw 3"
# By the name of its results: the words of coverage.run, those with the same flows side by side.
POPULATIONS = {
    "varied": f"{VARIED} --draw 9",
    "varied_0.02": f"{VARIED} --draw 9 --noise 0.02",
    "varied_0.05": f"{VARIED} --draw 9 --noise 0.05",
    "varied_0.2": f"{VARIED} --draw 9 --noise 0.2",
    "varied_V0": f"{VARIED} --draw 9 --level V0",
    "coverage": USUAL,
    "coverage_V0": f"{USUAL} --level V0",
    "noisy": f"{VARIED} --noisy --draw 11",
    "controls": CONTROLS,
    "controls_0.05": f"{CONTROLS} --noise 0.05",
    "controls_0.2": f"{CONTROLS} --noise 0.2",
    "steps_1000": f"{OTHERS} --steps 1000",
    "steps_3000": f"{OTHERS} --steps 3000",
    "steps_6000": f"{OTHERS} --steps 6000",
    "steps_10000": f"{OTHERS} --steps 10000",
    "usual_V0": f"{OTHERS} --level V0",
    "noisy_13": f"{VARIED} --noisy --draw 13",
    "noisy_V0_13": f"{VARIED} --noisy --draw 13 --level V0",
    "varied_V0_test": f"{VARIED} --draw 12 --level V0",
    "varied_V0_15": f"{VARIED} --draw 15 --level V0",
    "noisy_40": f"{VARIED} --noisy --draw 40",
    "noisy_V0_41": f"{VARIED} --noisy --draw 41 --level V0",
    "noisy_members_8_22": "--truths 20 --controls 0 --varied --noisy --draw 22 --members 8",
    "noisy_512": f"{VARIED} --noisy --draw 20 --cells 512",
    "cells_512": f"{VARIED} --draw 10 --cells 512",
}


def words_of(name: str, out: Path, flows: Path, settings: Sequence[str]) -> list[str]:
    """The words of coverage.run for a population."""
    own = POPULATIONS[name].split()
    one = [] if "--members" in own else ["--members", "1"]
    return [*own, *one, "--flows", str(flows), "--json", str(results_of(name, out)), *settings]


def results_of(name: str, out: Path) -> Path:
    return out / f"{name}.json"


def remake(
    out: Path, flows: Path, settings: Sequence[str], until: float, only: Sequence[str] = ()
) -> list[str]:
    """Make the populations without results; the names of those that are left after the time.

    Raises:
        CalledProcessError: a training failed.
    """
    begin = time.monotonic()
    names = [n for n in only or POPULATIONS if not results_of(n, out).exists()]
    flows.mkdir(parents=True, exist_ok=True)
    gpus = max(1, torch.cuda.device_count())
    with processes(initializer=_give_way) as pool, ThreadPoolExecutor(gpus) as trainers:
        made: dict[Path, Future[Path]] = {}  # the flows that were not there
        free = SimpleQueue[int]()
        for gpu in range(gpus):
            free.put(gpu)

        def simulated(name: str) -> Iterator[Future[Path]]:
            for task in run.options(words_of(name, out, flows, settings)).tasks:
                path = path_of(task, flows)
                if path not in made and not path.exists():
                    made[path] = pool.submit(make, task, flows)
                if path in made:
                    yield made[path]

        def train(name: str, waiting: Sequence[Future[Path]]) -> bool:
            for future in waiting:
                future.result()
            if time.monotonic() - begin > until:
                return False
            gpu = free.get()
            _train(words_of(name, out, flows, settings), gpu, gpus)
            free.put(gpu)
            print(f"{name}: {time.monotonic() - begin:.0f} s since the start", flush=True)
            return True

        try:
            running = {n: trainers.submit(train, n, list(simulated(n))) for n in names}
            return [name for name, done in running.items() if not done.result()]
        finally:  # also where a population fails: the other flows are not waited for
            pool.shutdown(cancel_futures=True)


def _train(words: Sequence[str], gpu: int, gpus: int) -> None:
    """Run coverage.run on one of the GPUs, with its part of the cores."""
    cores = sorted(os.sched_getaffinity(0))
    own = set(cores[gpu::gpus] or cores)
    subprocess.run(
        [sys.executable, "-m", run.__name__, *words],
        env=os.environ | {"CUDA_VISIBLE_DEVICES": str(gpu)},
        preexec_fn=lambda: os.sched_setaffinity(0, own),
        check=True,
    )


def _give_way() -> None:
    """The processes that simulate leave the processor to those that train."""
    os.nice(10)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument(
        "--flows", type=Path, required=True, help="folder that keeps the flow files"
    )
    parser.add_argument("--out", type=Path, required=True, help="folder of the results")
    parser.add_argument("--until", type=float, default=float("inf"), help="s, of the last start")
    parser.add_argument("--only", nargs="+", choices=POPULATIONS, default=[], help="populations")
    own, settings = parser.parse_known_args(arguments)
    left = remake(own.out, own.flows, settings, own.until, own.only)
    if left:
        print(f"not made: {', '.join(left)}; the same command goes on", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
