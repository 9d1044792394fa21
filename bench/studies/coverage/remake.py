"""All simulated populations of the coverage study.

python -m bench.studies.coverage.remake --flows FLOWS --out RESULTS --device cuda
python -m bench.studies.coverage.table RESULTS/*.json
python -m bench.studies.coverage.fit --write

The first command simulates the flows of a population on all cores and trains it, one after the
other. A population whose results are in `--out` is not made again, so a run that was stopped goes
on; `--only NAME ...` makes some. The films, which need a PIV program, are made by films.py. The
other commands put the results into one table and fit the error model to it. Settings that are not
its own go to every identification.

Defends: a change of the training comes with error bars of its own.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from bench.studies.coverage import run

USUAL, VARIED = "--truths 90 --controls 2 --draw 0", "--truths 60 --controls 0 --varied"
OTHERS = "--truths 48 --controls 0 --draw 7"
CONTROLS = "--truths 0 --controls 4 --draw 3"
# By the name of its results: the words of coverage.run.
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
    "chutes": "--truths 60 --controls 0 --chutes --draw 54",
    "chutes_noisy": "--truths 60 --controls 0 --chutes --noisy --draw 54",
    "cells_512": f"{VARIED} --draw 10 --cells 512",
}


def words_of(name: str, out: Path, flows: Path, settings: Sequence[str]) -> list[str]:
    """The words of coverage.run for a population."""
    own = POPULATIONS[name].split()
    one = [] if "--members" in own else ["--members", "1"]
    return [*own, *one, "--flows", str(flows), "--json", str(results_of(name, out)), *settings]


def results_of(name: str, out: Path) -> Path:
    return out / f"{name}.json"


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--flows", type=Path, required=True, help="folder that keeps the flows")
    parser.add_argument("--out", type=Path, required=True, help="folder of the results")
    parser.add_argument("--only", nargs="+", choices=POPULATIONS, default=POPULATIONS)
    own, settings = parser.parse_known_args(arguments)
    for name in own.only:
        if not results_of(name, own.out).exists():
            begin = time.monotonic()
            words = words_of(name, own.out, own.flows, settings)
            subprocess.run([sys.executable, "-m", run.__name__, *words], check=True)
            print(f"{name}: {time.monotonic() - begin:.0f} s", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
