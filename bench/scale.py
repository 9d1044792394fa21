"""Memory and speed of a training on a large flow, beside those on a small one.

    python -m bench.scale --device cuda --steps 3000 --json bench/results/scale_gpu.json

Writes flows with an analytic velocity, frame by frame: a layer on a slope, with waves inside it,
that fills the lower half of its grid. Then it trains on each, in a process of its own, by the same
way as `granpinn.train`. A row has the peak of the memory that a process cannot share or give back
(RssAnon), that of the device, and the steps per second after the pre-fit.

Claim: a flow of 2,000 frames of 512 x 512 takes at most 4 GB of the host beyond the cache of its
file, 8 GB of the device, and makes at least 0.9 times the steps per second of a small flow.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import torch

from bench.memory import kilobytes
from bench.studies import raw
from bench.studies.cores import alone
from granpinn.config import Config
from granpinn.data.schema import FORMAT_NAME, FORMAT_VERSION
from granpinn.identification.identify import identify
from granpinn.progress import Progress

SIZES = ((200, 128), (2000, 512))  # frames, and cells along each side of the grid
HOST_GB, DEVICE_GB, SPEED = 4.0, 8.0, 0.9  # the claim
EVERY = 0.01  # s between two looks at the memory
POOL = 16  # frames of noise, which are shifted at random: more would take the time of the writer
LENGTH, DEPTH, GRAIN = 0.5, 0.25, 2e-3  # m: side of the grid, depth of the layer, grain
SLOPE, SPEED_0 = math.radians(24), 0.8  # speed of the surface in m/s
WAVES, SHARE, NOISE = 3, 0.1, 0.005  # waves along x; their speed and the noise, of the surface's


def write_flow_file(path: Path, frames: int, cells: int) -> None:
    """Write a flow of [frames, cells, cells], with vectors in half of its cells.

    u = U (1 - (1 - y/h)^1.5) + dpsi/dy and v = -dpsi/dx for y < h, with f = y^2 (h - y)^2 and
    psi = f sin(k x) cos(w t): the waves move neither the base nor the surface.
    """
    x = (np.arange(cells) + 0.5) * (LENGTH / cells)
    t = np.arange(1, frames + 1) * (2.0 / frames)
    y, h, k = x[:, None], DEPTH, 2 * math.pi * WAVES / LENGTH
    inside = y < h
    mean = SPEED_0 * (1 - (1 - np.minimum(y / h, 1)) ** 1.5)
    f, f_y = y**2 * (h - y) ** 2, 2 * y * (h - y) * (h - 2 * y)
    size = SHARE * SPEED_0 / np.abs(f_y[inside]).max()
    waves = [size * f_y * np.sin(k * x), -size * k * f * np.cos(k * x)]
    mean, *waves = (np.where(inside, a, np.nan).astype(np.float32) for a in (mean, *waves))
    c = np.broadcast_to(inside, (cells, cells)).astype(np.float32)
    rng = np.random.default_rng(0)
    pool = NOISE * SPEED_0 * rng.standard_normal((POOL, 2, cells, cells), np.float32)
    with h5py.File(path, "w") as file:
        file.attrs["format_name"] = np.bytes_(FORMAT_NAME.encode())
        file.attrs["format_version"] = FORMAT_VERSION
        file.attrs["gravity"] = 9.81 * np.array([math.sin(SLOPE), -math.cos(SLOPE)])
        file.attrs["density"], file.attrs["grain_diameter"] = 1500.0, GRAIN
        for name, text in (("length_unit", "m"), ("time_unit", "s"), ("density_unit", "kg/m^3")):
            file.attrs[name] = np.bytes_(text.encode())
        for name, axis in (("t", t), ("y", x), ("x", x)):
            file[name] = axis
        shape = (frames, cells, cells)
        c_all, u_all, v_all = (file.create_dataset(n, shape, np.float32) for n in "cuv")
        for j, time_j in enumerate(t):
            swing = np.float32(math.cos(2 * math.pi * time_j))
            noise = np.roll(pool[rng.integers(POOL)], rng.integers(cells, size=2), (1, 2))
            c_all[j] = c
            u_all[j] = np.float32(1 + 0.1 * math.sin(time_j)) * mean + swing * waves[0] + noise[0]
            v_all[j] = swing * waves[1] + noise[1]
        file["surface_t"] = np.repeat(t, cells)
        file["surface_x"] = np.tile(x, frames)
        file["surface_y"] = np.full(frames * cells, h)


@contextlib.contextmanager
def peak() -> Iterator[list[float]]:
    """The peak of RssAnon in GB, in the list, from a thread that looks often."""
    found, done = [0.0], threading.Event()

    def watch() -> None:
        while not done.wait(EVERY):
            found[0] = max(found[0], kilobytes("RssAnon") * 1024 / 1e9)

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    try:
        yield found
    finally:
        done.set()
        thread.join()


def trained(path: Path, words: list[str]) -> dict[str, Any]:
    """Peaks and speed of an identification with its files and its page."""
    config: Config = raw.config_of(words)
    with peak() as host_gb, tempfile.TemporaryDirectory() as folder:
        begin = time.monotonic()
        found = identify(path, config, run_dir=folder, progress=Progress())
        found.report()
        seconds = time.monotonic() - begin
        history = {name: np.asarray(found.history[name]) for name in ("step", "wall_s")}
    kept = history["step"] > config.optimizer.prefit * found.timing.steps
    step, wall = (history[name][kept] for name in ("step", "wall_s"))
    pace = (np.diff(step) / np.diff(wall)).tolist()
    on_gpu = found.device.startswith("cuda")
    return {
        "n_points": found.data.n_points,
        "device": torch.cuda.get_device_name() if on_gpu else "cpu",
        "steps_per_s": round(statistics.median(pace), 2),
        "host_gb": round(host_gb[0], 3),
        "device_gb": round(torch.cuda.max_memory_reserved() / 1e9, 3) if on_gpu else None,
        "seconds": round(seconds, 2),
        "not_done": found.not_done,
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", type=Path, help="file for the results")
    parser.add_argument("--frames", type=int, default=SIZES[-1][0], help="of the large flow")
    own, words, _ = raw.parse(parser)
    rows: list[dict[str, Any]] = []
    for frames, cells in (SIZES[0], (own.frames, SIZES[-1][1])):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "flow.h5"
            begin = time.monotonic()
            write_flow_file(path, frames, cells)
            written = round(time.monotonic() - begin, 2)
            row = {"frames": frames, "cells": cells, "vectors": frames * cells * cells // 2}
            rows.append(row | {"written_s": written} | alone(trained, path, words))
        print(json.dumps(rows[-1]), flush=True)
        raw.write(own.json, {"words": words, "rows": rows})
    raw.write(own.json, {"words": words, "rows": rows} | _compared(*rows))
    return 0


def _compared(small: dict[str, Any], large: dict[str, Any]) -> dict[str, Any]:
    """The claim."""
    ratio = large["steps_per_s"] / small["steps_per_s"]
    memory = large["host_gb"] <= HOST_GB and (large["device_gb"] or 0.0) <= DEVICE_GB
    return {"speed_ratio": round(ratio, 3), "claim_holds": memory and ratio >= SPEED}


if __name__ == "__main__":
    sys.exit(main())
