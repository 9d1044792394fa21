"""One law from several flows: I0, error bars, and the test that flows have one law.

python -m bench.studies.one_law.run --make --flows flows
python -m bench.studies.one_law.run --flows flows --scenes scenes --device cuda

Every flow is identified by itself, many side by side. Then groups of them get one law:

- pair: a collapse and a steep chute of one simulated material, flows.py.
- noisy: the same with 100,000 steps, and noise of 0.3 % of the largest speed, nearly the most with
  which I0 is free.
- grains: scenes of grains with one friction (bench/studies/grains), one flow file each in SCENES.
- foreign: three scenes of one friction and one of another.
- same: four scenes of one friction, with another collapse for one of the four.
- twice: a flow with two draws of noise, and once with this noise over sqrt(2).

Words that are not its own are settings of the identification (`--steps 200`).

Defends: I0 within 10 % in 80 % of the pairs, intervals that hold 85 to 97 %, mu_2 at most half as
wrong as from one flow; foreign scenes are found, and no others.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from bench.studies import raw
from bench.studies.coverage.materials import as_measured, path_of
from bench.studies.one_law.flows import PAIRS, make_pairs, pair
from granpinn import Result, identify_many, one_law, read_flow
from granpinn.config import Config
from granpinn.results.decoding import plain

SEED, TWICE = 57, 8
LONG, NOISE, LARGE_NOISE = 100_000, 0.003, 0.05
FRICTIONS = ("0.2", "0.4", "0.7")
SCENES = ("collapse_2", "chute_fast", "chute_fast_steady", "drum_filmed")
OTHER_COLLAPSE = "collapse_6"
KINDS = ("pair", "noisy", "twice", "grains", "same", "foreign")
PATH = Path(__file__).parent / "results" / "groups.json"
Single = tuple[Path, int, float]  # a flow file, the seed of its training, its added noise


@dataclasses.dataclass(frozen=True)
class Group:
    """Flows that get one law.

    Attributes:
        once: a flow to compare it with.
        steps: of every training; None: those of the settings.
    """

    kind: str
    name: str
    flows: tuple[Single, ...]
    once: Single | None = None
    steps: int | None = None


def groups(flows: Path, scenes: Path, seed: int) -> Iterator[Group]:
    """All groups; `seed` is that of the simulated materials."""
    pairs = [tuple(path_of(task, flows) for task in pair(seed, n)) for n in range(PAIRS)]
    for kind, noise, steps in (("pair", 0.0, None), ("noisy", NOISE, LONG)):
        for n, paths in enumerate(pairs):
            own = tuple((path, n, noise) for path in paths)
            yield Group(kind, f"{seed}-{n:02d}", own, steps=steps)
    for n in range(TWICE):
        path = pairs[n // 2][n % 2]
        draws = tuple((path, seed, LARGE_NOISE) for seed in (n, n + PAIRS))
        yield Group("twice", f"{seed}-{n}", draws, (path, n, LARGE_NOISE / 2**0.5))

    def grains(friction: str, names: Sequence[str] = SCENES) -> tuple[Single, ...]:
        return tuple((scenes / f"{name}-{friction}.h5", 0, 0.0) for name in names)

    for friction in FRICTIONS:
        yield Group("grains", friction, grains(friction))
        for scene in SCENES:
            rest = [name for name in SCENES if name != scene]
            yield Group("same", f"{friction}-{scene}", grains(friction, [*rest, OTHER_COLLAPSE]))
            for other in FRICTIONS:
                if other != friction:
                    name = f"{friction}-{other}-{scene}"
                    yield Group("foreign", name, grains(friction, rest) + grains(other, [scene]))


def identified(singles: Sequence[Single], config: Config) -> dict[Single, Result]:
    """The results of single flows, which are trained side by side."""
    paths, seeds, noise = zip(*singles, strict=True)
    flows = [read_flow(path) for path in paths]
    flows = [as_measured(flow) if flow.of_solver else flow for flow in flows]
    found = identify_many(flows, config, seeds, noise=noise)
    return dict(zip(singles, found, strict=True))


def record(group: Group, results: dict[Single, Result]) -> dict[str, Any]:
    """What the study keeps of a group."""
    apart = [results[single] for single in group.flows]
    truth, begin = apart[0].truth, time.monotonic()
    found = one_law(apart)
    seconds = time.monotonic() - begin
    once = None if group.once is None else plain(results[group.once].parameters)
    return {
        "kind": group.kind,
        "name": group.name,
        "truth": None if truth is None else [truth.mu_s, truth.mu_2, truth.I0],
        "I_range": found.law.I_range,
        "parameters": plain(found.parameters),
        "apart": [
            {
                "I_range": result.law.I_range,
                "parameters": plain(result.parameters),
                "I0": plain(result.checks["unknown_I0"].parameters.get("I0")),
            }
            for result in apart
        ],
        "once": once,
        "p_value": None if found.error_bars is None else found.checks["shared_law"].p_value,
        "seconds": seconds,
    }


def run(own: argparse.Namespace, config: Config) -> None:
    """Identify the flows of the groups, those with equal steps in one batch."""
    every = [g for g in groups(own.flows, own.scenes, own.seed) if g.kind in own.kinds]
    config = dataclasses.replace(config, checks="momentum_balance,unknown_I0")
    known = json.loads(own.out.read_text())["groups"] if own.out.exists() else []
    found = [row for row in known if row["kind"] not in own.kinds]
    for steps in dict.fromkeys(group.steps for group in every):
        here = [group for group in every if group.steps == steps]
        singles = [s for g in here for s in (*g.flows, *([] if g.once is None else [g.once]))]
        settings = dataclasses.replace(config, steps=steps or config.steps)
        results = identified(list(dict.fromkeys(singles)), settings)
        found += [record(group, results) for group in here]
        device = next(iter(results.values())).device
        raw.write(own.out, {"device": device, "groups": found})


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--make", action="store_true", help="simulate the flows")
    parser.add_argument("--flows", type=Path, required=True, help="folder of simulated flows")
    parser.add_argument("--scenes", type=Path, default=Path("scenes"), help="folder of grains")
    parser.add_argument("--out", type=Path, default=PATH)
    parser.add_argument("--seed", type=int, default=SEED, help="of the simulated materials")
    parser.add_argument("--kinds", nargs="+", default=KINDS, help="of groups; the others stay")
    own, words = parser.parse_known_args(arguments)
    if own.make:
        make_pairs(own.seed, own.flows)
    else:
        run(own, raw.config_of(words))
    return 0


if __name__ == "__main__":
    sys.exit(main())
