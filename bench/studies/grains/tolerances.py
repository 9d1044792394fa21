"""Settings of the identification on grains and on reference collapses, clean and with noise.

    python -m bench.studies.grains.tolerances SCENES --reference FILE... --grid GRID --json OUT

SCENES holds the folders of bench.studies.grains.make. GRID is a JSON list of settings of
granpinn.train, such as [{"steps": 20000, "weights.law_error": 0.05}]. For every entry all flows are
one batch: the scenes with a surface line, the reference collapses, and these with noise of 20 %.
The truth of a scene is its own law; that of a collapse is in its file.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.studies import raw
from bench.studies.grains.law import SCORED, errors_percent, friction
from bench.studies.grains.make import FLOW, SUMMARY
from bench.studies.grains.run import scenes_in
from granpinn import identify_many
from granpinn.config import Config
from granpinn.data import Flow, read_flow
from granpinn.results import Result

NOISE = 0.2


@dataclass(frozen=True)
class Case:
    """A flow with its true law, or with its mean mu where it holds one I only.

    Attributes:
        law: mu_s, mu_2, I0; None for a narrow range of I.
        mean: I and mu.
        I_range: where the law is compared.
    """

    name: str
    flow: Flow
    law: dict[str, float] | None
    mean: dict[str, float] | None
    I_range: tuple[float, float]
    noise: float = 0.0

    def errors(self, result: Result) -> dict[str, float]:
        """Error of mu in % at the inertial numbers of the case."""
        mu = friction(result.law.name, {name: p.value for name, p in result.parameters.items()})
        if self.law is not None:
            return errors_percent(mu, self.law, *self.I_range)
        assert self.mean is not None
        I = self.mean["I"]  # noqa: E741
        return {f"{I:g}": 100 * (float(mu(I)) / self.mean["mu"] - 1)}


def case_of_scene(folder: Path) -> Case:
    """A scene of grains with its own law along D."""
    own = json.loads((folder / SUMMARY).read_text())["own"]["along_D"]
    low, high = own["I_range"]
    return Case(folder.name, read_flow(folder / FLOW), own["law"], own["mean"], (low, high))


def cases_of_reference(path: Path) -> list[Case]:
    """A reference collapse, clean and with noise."""
    flow = read_flow(path)
    if flow.truth is None:
        raise SystemExit(f"{path} must state its friction law, got none")
    law = {name: getattr(flow.truth, name) for name in flow.truth.friction_law.names}
    clean = Case(path.stem, flow, law, None, (min(SCORED), max(SCORED)))
    return [clean, dataclasses.replace(clean, name=f"{path.stem}, 20 % noise", noise=NOISE)]


def tried(settings: dict[str, Any], cases: Sequence[Case]) -> dict[str, Any]:
    """The errors of all cases with some settings."""
    begin = time.monotonic()
    config = Config(**{"simulated_pressure.frames": 0} | settings)
    flows, noise = [case.flow for case in cases], [case.noise for case in cases]
    found = identify_many(flows, config, noise=noise)
    rows = {
        case.name: None if result.failure else case.errors(result)
        for case, result in zip(cases, found, strict=True)
    }
    seconds = round(time.monotonic() - begin, 1)
    return {"settings": settings, "seconds": seconds, "error_percent": rows}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("scenes", type=Path)
    parser.add_argument("--reference", nargs="*", type=Path, default=[])
    parser.add_argument("--grid", type=Path, required=True, help="JSON list of settings")
    parser.add_argument("--json", type=Path, required=True, help="file for the errors")
    chosen = parser.parse_args()
    cases = [case_of_scene(folder) for folder in scenes_in(chosen.scenes)]
    cases = [case for case in cases if case.flow.surface is not None]
    cases += [case for path in chosen.reference for case in cases_of_reference(path)]
    found: dict[str, Any] = {"command": " ".join(["python", *sys.argv]), "rows": []}
    for settings in json.loads(chosen.grid.read_text()):
        found["rows"].append(tried(settings, cases))
        raw.write(chosen.json, found)
        print(json.dumps(found["rows"][-1]), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
