r"""The measured noise of flows with few vectors: is it that of the whole flow, and of known noise?

    python -m bench.studies.noise.gaps SCENES --reference FILE... --json OUT

SCENES holds the folders of bench.studies.grains.make; each scene that is not steady is thinned at
random. Each reference collapse is thinned with and without noise of known size and correlation
$e^{-h^2/2\ell^2}$ at h cells, $\ell$ = 0 (white), 1, 2, 4. The fields of `made_up` are a smooth
flow with such noise on a grid, thinned, and at random places.

Defends: the noise and the number of independent vectors are the same whether vectors lie on a grid,
on a part of it, or scattered.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter

from bench.studies import raw
from bench.studies.draws import thinned
from bench.studies.grains.run import scenes_in
from bench.studies.grains.tolerances import case_of_scene, cases_of_reference
from granpinn.arrays import Float64
from granpinn.data import Flow
from granpinn.data.scaling import scales_of
from granpinn.estimates.facts import Facts
from granpinn.estimates.pairs import pair_noise
from granpinn.training.tolerances import VelocityNoise

PARTS = (1.0, 0.5, 0.25, 0.12, 0.06)  # of the vectors
SEEDS = 2
LENGTHS = (0.0, 1.0, 2.0, 4.0)  # of correlation, in cells
LEVELS = (0.005, 0.05, 0.2)  # of the rms speed
STRIDES = (1, 2, 3, 4, 5)  # of third differences in time, in frames
MADE_UP = (40, 40, 40)  # frames, rows, columns
WAVES = 400  # that make a random field


def estimate(flow: Flow) -> dict[str, float | None]:
    """What `Facts` measures, the noise in units of the rms speed."""
    facts = Facts(flow, scales_of(flow))
    begin = time.process_time()
    noise = facts.noise
    seconds = time.process_time() - begin
    tolerance = VelocityNoise.of(facts)
    return {
        "sigma": None if noise.sigma is None else noise.sigma / facts.speed,
        "vectors_per_independent": noise.vectors_per_independent,
        "independent": facts.independent(),
        "share_times_sigma": tolerance.share * tolerance.sigma / facts.speed,
        "seconds": round(seconds, 2),
    }


def strides(flow: Flow) -> list[float]:
    """Noise from third differences of every s-th frame, over the rms speed: the same for all s
    where errors of different frames are independent."""
    facts = Facts(flow, scales_of(flow))
    view = facts.view
    found = []
    for s in STRIDES:
        squares = []
        for values in (view.u, view.v):
            a = np.where(view.there, values, np.nan)
            third = a[3 * s :] - 3 * a[2 * s : -s] + 3 * a[s : -2 * s] - a[: -3 * s]
            squares.append(1.4826**2 * float(np.nanmedian(np.abs(third))) ** 2 / 20)
        found.append(float(np.sqrt(np.mean(squares))) / facts.speed)
    return found


def noisy(flow: Flow, level: float, length: float, seed: int) -> Flow:
    """The flow with Gaussian noise of `level` times its rms speed, correlated over cells."""
    generator = np.random.default_rng(seed)
    speed = float(np.sqrt(np.mean((flow.u**2 + flow.v**2)[flow.valid])))
    made = []
    for values in (flow.u, flow.v):
        e = generator.standard_normal(values.shape)
        if length > 0:
            half = length / np.sqrt(2)
            e = gaussian_filter(e, (0, half, half), mode="wrap")
            e /= e.std()
        made.append((values + level * speed * e).astype(np.float32))
    return dataclasses.replace(flow, u=made[0], v=made[1])


def vectors_of(flow: Flow) -> int:
    return int((flow.valid & (flow.t > 0)[:, None, None]).sum())


def thinnings(flow: Flow) -> Iterator[dict[str, Any]]:
    """The estimates of a flow and of parts of it."""
    for part in PARTS:
        for seed in range(1 if part == 1 else SEEDS):
            seen = flow if part == 1 else thinned(flow, round(part * vectors_of(flow)), seed)
            yield {"part": part, "seed": seed} | estimate(seen)


def made_up(length: float, level: float, layout: str, part: float, seed: int) -> dict[str, Any]:
    """The estimate in a smooth flow with known noise, and the truth.

    The noise of a frame is a sum of waves with random directions and phases, whose correlation is
    that of normal deviates with `length`; its truth is counted over the places of the vectors.

    Args:
        layout: "grid", or "scattered" at random places, as many.
    """
    generator = np.random.default_rng(seed)
    frames, rows, columns = MADE_UP
    parts: list[Float64] = []
    sharing = []
    for k in range(frames):
        y, x = (a.ravel() for a in np.mgrid[:rows, :columns].astype(float))
        keep = generator.uniform(size=x.size) < part
        if layout == "scattered":
            x, y = generator.uniform(0, columns, x.size), generator.uniform(0, rows, x.size)
        x, y = x[keep], y[keep]
        e = generator.standard_normal((2, x.size))
        if length > 0:
            waves = generator.standard_normal((2, WAVES)) / length
            turn = np.outer(x, waves[0]) + np.outer(y, waves[1])
            phases = generator.uniform(0, 2 * np.pi, (2, 1, WAVES))
            e = np.sqrt(2 / WAVES) * np.cos(turn + phases).sum(axis=-1)
            square = (x - x[:, None]) ** 2 + (y - y[:, None]) ** 2
            sharing.append(float(np.exp(-square / 2 / length**2).sum()) / x.size)
        a, b, c = 2 * np.pi * x / 80, 2 * np.pi * y / 60, 2 * np.pi * k / 80
        u, v = np.sin(a + c) * np.cos(b), np.cos(a) * np.sin(b - c)
        speed = level * np.sqrt(0.5)  # level of the rms speed
        parts.append(
            np.stack([np.full(x.size, float(k)), x, y, u + speed * e[0], v + speed * e[1]])
        )
    found = pair_noise(*np.concatenate(parts, axis=1))
    truth = {"true_sigma": level, "true_vectors_per_independent": np.mean(sharing or [1.0])}
    case = {"layout": layout, "length": length, "level": level, "part": part, "seed": seed}
    if found is None:
        return case | truth | {"sigma": None, "vectors_per_independent": None}
    sigma = float(np.hypot(found.u, found.v))  # over sqrt(2), times the rms speed sqrt(1/2)
    own = {"sigma": sigma, "vectors_per_independent": found.vectors_per_independent}
    return case | truth | own


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("scenes", type=Path)
    parser.add_argument("--reference", nargs="*", type=Path, default=[])
    parser.add_argument("--json", type=Path, required=True)
    own = parser.parse_args()
    command = ["python", "-m", "bench.studies.noise.gaps", *sys.argv[1:]]
    found: dict[str, Any] = {"command": " ".join(command)}
    flows = {case.name: case.flow for case in map(case_of_scene, scenes_in(own.scenes))}
    flows = {name: flow for name, flow in flows.items() if not flow.steady}
    found["strides"] = {name: strides(flow) for name, flow in flows.items()}
    for path in own.reference:
        clean = cases_of_reference(path)[0].flow
        flows[path.stem] = clean
        for length in LENGTHS:
            flows[f"{path.stem}, noise 2 %, length {length:g}"] = noisy(clean, 0.02, length, 0)
    found["thinned"] = []
    for name, flow in flows.items():
        found["thinned"] += [{"flow": name} | row for row in thinnings(flow)]
        print(name, flush=True)
        raw.write(own.json, found)
    layouts = [("grid", part) for part in (1.0, 0.25, 0.06)]
    layouts += [("scattered", part) for part in (0.25, 0.06)]
    found["made_up"] = [
        made_up(length, level, layout, part, 0)
        for length in LENGTHS
        for level in LEVELS
        for layout, part in layouts
    ]
    raw.write(own.json, found)
    return 0


if __name__ == "__main__":
    sys.exit(main())
