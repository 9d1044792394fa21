"""The scenes by name."""

from __future__ import annotations

from collections.abc import Callable

from bench.studies.grains.materials import Material
from bench.studies.grains.scenes.channel import GAP, SEEN, channel
from bench.studies.grains.scenes.chute import chute
from bench.studies.grains.scenes.collapse import collapse
from bench.studies.grains.scenes.drum import drum
from bench.studies.grains.scenes.heap import heap
from bench.studies.grains.scenes.plane_shear import plane_shear
from bench.studies.grains.scenes.scene import Scene
from bench.studies.grains.scenes.silo import silo

# Slopes at which a layer of a material flows at I of about 0.05 and 0.12.
SLOPES = {0.2: (0.30, 0.37), 0.4: (0.33, 0.40), 0.7: (0.35, 0.42)}
# Mean slopes of the heap of a material at its start, near the one it takes.
HEAP_SLOPES = {0.2: 0.26, 0.4: 0.29, 0.7: 0.32}

SCENES: dict[str, Callable[[Material], Scene]] = {
    "collapse_2": lambda _: collapse(48, 96, reach=240, duration=45),
    "collapse_6": lambda _: collapse(32, 192, reach=280, duration=60),
    "channel_wall": lambda m: channel(m, SEEN, duration=60),
    "channel_mean": lambda m: channel(m, GAP, duration=60),
    "chute_slow": lambda m: chute(m, SLOPES[m.friction][0], steady=False, duration=160),
    "chute_fast": lambda m: chute(m, SLOPES[m.friction][1], steady=False, duration=160),
    "chute_fast_steady": lambda m: chute(m, SLOPES[m.friction][1], steady=True, duration=100),
    "drum": lambda _: drum(0.02, duration=150),
    "drum_filmed": lambda _: drum(0.02, duration=150, filmed=100),
    "heap": lambda m: heap(100, 7 + 100 * HEAP_SLOPES[m.friction], 7, flux=20, duration=80),
    "silo": lambda _: silo(50, 90, outlet=14, duration=45),
    "plane_shear": lambda _: plane_shear(load=20, speed=8, duration=120),
}
