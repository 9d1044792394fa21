"""One law from several flows: I0, error bars, and the test that flows have one law.

python -m bench.studies.one_law.run --make --flows flows
python -m bench.studies.one_law.run --run --flows flows --scenes scenes --out results --part 0/4

Each case trains its flows with one law and one by one, and adds one row to OUT/rows.csv. A second
call goes on with the missing cases; `--part i/n` takes every n-th case. Settings that are not its
own go to the identification (`--steps 200`).

- pair: a collapse and a steep chute of one simulated material, flows.py.
- long: the same flows with more steps, without the test that they have one law.
- noisy: the same with 5 % of noise.
- grains: scenes of grains with one friction (bench/studies/grains), one flow file each in SCENES.
- foreign: three scenes of one friction and one of another.
- same: four scenes of one friction, with another collapse for one of the four.
- twice: a flow with noise and itself; once with its noise over sqrt(2).
- cost: pairs and scenes again, for the time alone; give each process a GPU of its own.

Defends: I0 within 10 % in 80 % of the pairs, intervals that hold 85 to 97 %, mu_2 at most half as
wrong as from one flow; foreign scenes are found, and no others.
"""

from __future__ import annotations

import argparse
import csv
import dataclasses
import fcntl
import io
import json
import sys
import time
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench.machine import describe
from bench.studies import raw
from bench.studies.coverage.materials import as_measured, path_of
from bench.studies.one_law.flows import make_pairs, pair
from granpinn import identify, identify_many, read_flow
from granpinn.config import Config
from granpinn.data import Flow
from granpinn.fit.case import Case as Posed
from granpinn.fit.case import pose
from granpinn.fit.one_law import known_of
from granpinn.results import Result, plain
from granpinn.results.decoding import encode

SEED, PAIRS, NOISY, TWICE, COST = 53, 20, 8, 8, 4
NOISE, LONG = 0.05, 100_000
QUICK = ("long", "twice", "cost")  # without the test that the flows have one law
FRICTIONS = ("0.2", "0.4", "0.7")
SCENES = ("collapse_2", "chute_fast", "chute_fast_steady", "drum_filmed")
OTHER_COLLAPSE = "collapse_6"
COLUMNS = ("case", "kind", "seconds", "joint_s", "apart_s", "failure", "record")


@dataclasses.dataclass(frozen=True)
class Case:
    """Flows that are identified with one law, and each by itself.

    Attributes:
        number: the seed of its trainings.
        paths: of the flow files.
        noise: that is added.
        steps: of the training; None: those of the settings.
    """

    kind: str
    name: str
    number: int
    paths: tuple[Path, ...]
    noise: float = 0.0
    steps: int | None = None


def cases(flows: Path, scenes: Path, seed: int) -> list[Case]:
    """All cases, the most important first; `seed` is that of the simulated materials."""

    def simulated(number: int) -> tuple[Path, ...]:
        return tuple(path_of(task, flows) for task in pair(seed, number))

    def grains(friction: str, names: Sequence[str] = SCENES) -> tuple[Path, ...]:
        return tuple(scenes / f"{scene}-{friction}.h5" for scene in names)

    found = [Case("pair", f"{seed}-{n:02d}", n, simulated(n)) for n in range(PAIRS)]
    found += [Case("grains", f, k, grains(f)) for k, f in enumerate(FRICTIONS)]
    for k, f in enumerate(FRICTIONS):
        for other in FRICTIONS[:k] + FRICTIONS[k + 1 :]:
            for scene in SCENES:
                rest = [name for name in SCENES if name != scene]
                paths = grains(f, rest) + grains(other, [scene])
                found.append(Case("foreign", f"{f}-{other}-{scene}", k, paths))
    for k, f in enumerate(FRICTIONS):
        for scene in SCENES:
            rest = [OTHER_COLLAPSE if name == scene else name for name in SCENES]
            found.append(Case("same", f"{f}-{scene}", k, grains(f, rest)))
    found += [Case("long", f"{seed}-{n:02d}", n, simulated(n), steps=LONG) for n in range(PAIRS)]
    found += [Case("noisy", f"{seed}-{n:02d}", n, simulated(n), NOISE) for n in range(NOISY)]
    found += [
        Case("twice", f"{seed}-{n}", n, simulated(n // 2)[n % 2 : n % 2 + 1] * 2, NOISE)
        for n in range(TWICE)
    ]
    found += [Case("cost", f"{seed}-{n:02d}", n, simulated(n)) for n in range(COST)]
    found += [Case("cost", f, k, grains(f)) for k, f in enumerate(FRICTIONS)]
    return found


def made(case: Case, config: Config) -> dict[str, Any]:
    """The row of a case."""
    begin = time.monotonic()
    config = dataclasses.replace(
        config,
        seed=config.seed + case.number,
        noise=case.noise,
        steps=case.steps or config.steps,
    )
    flows: list[Flow] = [read_flow(path) for path in case.paths]
    truth = flows[0].truth
    flows = [as_measured(flow) if flow.of_solver else flow for flow in flows]
    checks = "momentum_balance" if case.kind in QUICK else "shared_law"
    if case.kind == "cost":  # the first call of a process loads libraries
        identify_many(flows, config, checks="momentum_balance", keep_fields=False)
    joint = identify(flows, dataclasses.replace(config, checks=checks), one_law=True)
    alone = dataclasses.replace(config, checks="momentum_balance")
    posed = [pose(flow, config) for flow in flows]
    if case.kind == "twice":
        flows, alone = flows[:1], dataclasses.replace(alone, noise=case.noise / 2**0.5)
    apart = identify_many(flows, alone, keep_fields=False)
    shared = joint.checks.get("shared_law")
    record = {
        "truth": None if truth is None else [truth.mu_s, truth.mu_2, truth.I0],
        "joint": {
            "parameters": encode(joint.parameters),
            "covariance": encode(joint.covariance),
        },
        "flows": [of(r, c) for r, c in zip(joint.each, posed, strict=True)],
        "apart": [
            of(r, c) | {"parameters": encode(r.parameters)}
            for r, c in zip(apart, posed[: len(apart)], strict=True)
        ],
        "shared_law": None if shared is None else encode(shared),
        "not_done": joint.not_done,
        "steps_per_s": [joint.timing.steps_per_s, apart[0].timing.steps_per_s],
        "date": time.strftime("%Y-%m-%d"),
        "device": joint.device,
        "machine": describe(),
    }
    return {
        "case": case.name,
        "kind": case.kind,
        "seconds": round(time.monotonic() - begin, 1),
        "joint_s": round(joint.timing.wall_s, 2),
        "apart_s": round(apart[0].timing.wall_s, 2),
        "failure": joint.failure,
        "record": json.dumps(plain(record), separators=(",", ":")),
    }


def of(result: Result, case: Posed) -> dict[str, Any]:
    """What a row keeps of the fit of a flow."""
    return {"I_range": result.law.I_range, "known": known_of(result, case)}


def append(path: Path, row: dict[str, Any]) -> None:
    """Add a row to a table that several processes write."""
    with path.open("a", encoding="utf-8", newline="") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        text = io.StringIO(newline="")
        writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
        if file.tell() == 0:
            writer.writeheader()
        writer.writerow(row)
        file.write(text.getvalue())


def read(path: Path) -> list[dict[str, Any]]:
    """The rows of finished cases, with their records."""
    if not path.exists():
        return []
    csv.field_size_limit(10**8)
    with path.open(encoding="utf-8", newline="") as file:
        rows: list[dict[str, Any]] = [row for row in csv.DictReader(file) if not row["failure"]]
    return [row | {"record": json.loads(row["record"])} for row in rows]


def run(own: argparse.Namespace, config: Config) -> None:
    """The missing cases of a part."""
    end = time.monotonic() + own.seconds
    own.out.mkdir(parents=True, exist_ok=True)
    table = own.out / "rows.csv"
    part, parts = map(int, own.part.split("/"))
    done = {(row["kind"], row["case"]) for row in read(table)}
    every = cases(own.flows, own.scenes, own.seed)
    every = [case for case in every if own.kinds is None or case.kind in own.kinds]
    for case in every[part::parts]:
        if (case.kind, case.name) in done:
            continue
        if time.monotonic() > end:
            print(f"{own.seconds:g} s are over: call again for the rest", flush=True)
            return
        try:
            row = made(case, config)
        except Exception as error:  # the other cases go on
            traceback.print_exc()
            row = dict.fromkeys(COLUMNS, "") | {"failure": f"{type(error).__name__}: {error}"}
            row |= {"case": case.name, "kind": case.kind}
        append(table, row)
        print(case.kind, case.name, row["seconds"], row["failure"] or "", flush=True)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--make", action="store_true", help="simulate the flows")
    parser.add_argument("--run", action="store_true", help="identify the cases")
    parser.add_argument("--flows", type=Path, required=True, help="folder of simulated flows")
    parser.add_argument("--scenes", type=Path, default=Path("scenes"), help="folder of grains")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results")
    parser.add_argument("--seed", type=int, default=SEED, help="of the simulated materials")
    parser.add_argument("--part", default="0/1", help="i/n: every n-th case from the i-th on")
    parser.add_argument("--kinds", nargs="+", help="kinds of cases; none: all")
    parser.add_argument("--seconds", type=float, default=1e9, help="no case begins after these")
    own, words = parser.parse_known_args(arguments)
    if own.make:
        make_pairs(own.seed, PAIRS, own.flows)
    if own.run:
        run(own, raw.config_of(words))
    return 0


if __name__ == "__main__":
    sys.exit(main())
