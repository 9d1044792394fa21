"""The default identification on every scene of grains.

    python -m bench.studies.grains.run --all SCENES --out RUNS --device cuda

SCENES holds the folders of bench.studies.grains.make. On a GPU all scenes and seeds are one batch;
on a CPU `--group 2` takes two at a time. Settings that are not its own go to the identification.
A scene without a surface line is identified at level V0.

Defends: mu(I) within 3 % of the law of the scene over its range of I, nothing tuned per scene.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench.studies import raw
from bench.studies.experiment.commands import ExperimentError
from bench.studies.grains.make import FLOW, SUMMARY
from bench.studies.grains.score import line, score
from granpinn import identify_many
from granpinn.config import Config
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
    config: Config,
    without_surface: Config,
    seeds: Sequence[int],
    group: int,
    out: Path,
) -> list[dict[str, Any]]:
    """Scores of every scene and seed; the run folders are OUT/surface_000/000 and so on.

    Args:
        without_surface: settings for the scenes without a surface line.
        group: flows in a batch; 0: all.
    """
    members = [(scene, read_flow(scene / FLOW), seed) for scene in scenes for seed in seeds]
    scores = []
    for level, settings in (("surface", config), ("none", without_surface)):
        mine = [m for m in members if (m[1].surface is None) == (level == "none")]
        size = group or max(1, len(mine))
        for first in range(0, len(mine), size):
            part = mine[first : first + size]
            folder = out / f"{level}_{first:03d}"
            flows = [flow for _, flow, _ in part]
            identify_many(flows, settings, [seed for *_, seed in part], run_dir=folder)
            for k, (scene, _, _) in enumerate(part):
                scores.append(score(folder / f"{k:03d}", scene))
                print(line(scores[-1]), flush=True)
    return scores


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--all", type=Path, required=True, help="folder of the scenes")
    parser.add_argument("--only", nargs="+", help="names of scene folders, by default every one")
    parser.add_argument("--out", type=Path, required=True, help="folder for runs and grains.json")
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--group", type=int, default=0, help="flows at a time; 0: all")
    chosen, settings, config = raw.parse(parser)
    try:
        scenes = scenes_in(chosen.all)
        if chosen.only:
            scenes = [scene for scene in scenes if scene.name in chosen.only]
        chosen.out.mkdir(parents=True, exist_ok=True)
        without = raw.config_of([*settings, "--level", "V0"])
        begin = time.monotonic()
        scores = study(scenes, config, without, chosen.seeds, chosen.group, chosen.out)
    except ExperimentError as error:
        print(f"bench.studies.grains.run: {error}", file=sys.stderr)
        return 1
    found = {
        "command": " ".join(["python -m bench.studies.grains.run", *sys.argv[1:]]),
        "settings": settings,
        "seconds": round(time.monotonic() - begin, 1),
        "scores": scores,
    }
    raw.write(chosen.out / "grains.json", found)
    return 0


if __name__ == "__main__":
    sys.exit(main())
