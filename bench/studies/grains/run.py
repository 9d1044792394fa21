"""The default identification on every scene of grains.

    python -m bench.studies.grains.run --all SCENES --out RUNS --device cuda

SCENES holds the folders of bench.studies.grains.make. On a GPU all scenes and seeds are one batch;
on a CPU `--group 2` takes two at a time. Settings that are not its own go to the identification.
A scene without a surface line is identified at level V0. grains.json is written after every score.

Defends: mu(I) within 3 % of the law of the scene over its range of I, nothing tuned per scene.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from bench.studies import raw
from bench.studies.experiment.commands import ExperimentError
from bench.studies.grains.make import FLOW, SUMMARY
from bench.studies.grains.score import line, score
from granpinn import identify_many
from granpinn.data import read_flow


def scenes_in(folder: Path) -> list[Path]:
    """The folders of scenes in a folder, by name.

    Raises:
        ExperimentError: there is none.
    """
    found = sorted(
        path.parent for path in folder.glob(f"*/{FLOW}") if path.with_name(SUMMARY).exists()
    )
    if not found:
        raise ExperimentError(
            f"--all must be a folder with scenes, got none in {folder}: make one with "
            "bench.studies.grains.make"
        )
    return found


def study(
    scenes: Sequence[Path],
    settings: Sequence[str],
    seeds: Sequence[int],
    group: int,
    out: Path,
) -> Iterator[dict[str, Any]]:
    """Scores of every scene and seed; the run folders are OUT/V1_000/000 and so on.

    Args:
        settings: of every identification, in words.
        group: flows in a batch; 0: all.
    """
    members = [(scene, read_flow(scene / FLOW), seed) for scene in scenes for seed in seeds]
    for level in ("V1", "V0"):
        config = raw.config_of(settings if level == "V1" else [*settings, "--level", level])
        mine = [m for m in members if (m[1].surface is None) == (level == "V0")]
        size = group or max(1, len(mine))
        for first in range(0, len(mine), size):
            part = mine[first : first + size]
            folder = out / f"{level}_{first:03d}"
            flows = [flow for _, flow, _ in part]
            identify_many(flows, config, [seed for *_, seed in part], run_dir=folder)
            for k, (scene, _, _) in enumerate(part):
                yield score(folder / f"{k:03d}", scene)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--all", type=Path, required=True, help="folder of the scenes")
    parser.add_argument("--out", type=Path, required=True, help="folder for runs and grains.json")
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--group", type=int, default=0, help="flows at a time; 0: all")
    own, settings, _ = raw.parse(parser, arguments)
    own.out.mkdir(parents=True, exist_ok=True)
    scores: list[dict[str, Any]] = []
    try:
        for found in study(scenes_in(own.all), settings, own.seeds, own.group, own.out):
            scores.append(found)
            print(line(found), flush=True)
            raw.write(own.out / "grains.json", {"settings": settings, "scores": scores})
    except ExperimentError as error:
        print(f"bench.studies.grains.run: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
