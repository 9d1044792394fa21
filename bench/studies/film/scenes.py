"""The scenes of the study: collapses and chutes in SI units, and how each is filmed."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.studies.experiment.film import FRACTION, GRAIN_DENSITY, GRAVITY, HEIGHT, column
from bench.studies.experiment.velocity_field import LAYERS, VelocityField
from bench.studies.film.render import Shot
from granpinn.data import Flow
from granpinn.simulation import Chute, Collapse, simulate

MARGIN = 24  # px of background beside and above the grains


@dataclass(frozen=True, eq=False)
class Scene:
    """A simulated flow, its field and its film."""

    flow: Flow
    field: VelocityField
    shot: Shot
    tilt: float = 0.0  # degrees, of the plumb line in the picture

    def settings(self) -> dict[str, Any]:
        """The flags of `granpinn film` that a lab gives."""
        d = self.flow.grain_diameter * math.sqrt(FRACTION)  # see bench.studies.experiment.film
        return {
            "scale": f"{self.shot.pixel * 1e3!r} mm/px",
            "frame_rate": f"{self.shot.rate!r} Hz",
            "grain_diameter": f"{d * 1e3!r} mm",
            "grain_density": f"{GRAIN_DENSITY} kg/m^3",
            "solid_fraction": FRACTION,
            "tilt": f"{self.tilt!r} deg",
            "origin": f"-0.5,{self.shot.rows - 0.5}",  # the lower left corner of the picture
        }

    def true_velocity(self, t: Any, x: Any, y: Any) -> Any:
        """(u, v) [2, n] in m/s at times and places [n] of the flow."""
        out = np.empty((2, len(t)))
        for now in np.unique(t):
            k = t == now
            out[:, k] = self.field.velocity(float(now), x[k], y[k])
        return out


def named(name: str) -> Scene:
    """A scene by its name KIND_SEED_GRAIN, such as collapse_401_6: 6 px for a grain."""
    kind, seed, grain = name.split("_")
    return {"collapse": collapse, "chute": chute}[kind](int(seed), grain=float(grain))


def _field(flow: Flow) -> VelocityField:
    """The field of a flow at rest at t = 0, before its first frame, with no grains above its grid.

    A field goes on beyond its grid with the outermost cells.
    """
    above = flow.y[-1] + (flow.y[1] - flow.y[0]) * np.arange(1, 2 * LAYERS + 1)
    pad = ((1, 0), (0, above.size), (0, 0))
    c, u, v = (np.pad(a, pad) for a in (flow.c, flow.u, flow.v))
    c[0, : flow.y.size] = flow.c[0]
    u[:, flow.y.size :], v[:, flow.y.size :] = np.nan, np.nan
    t, y = np.insert(flow.t, 0, 0.0), np.append(flow.y, above)
    return VelocityField(dataclasses.replace(flow, t=t, y=y, c=c, u=u, v=v, p=None))


def _shot(flow: Flow, pixel: float, frames: int, fastest: float, before: int, **more: Any) -> Shot:
    """A film of up to `frames` frames, `before` of them at rest; the fastest grains move by
    `fastest` px per frame, or less if the flow would end before the film."""
    speed = float(np.nanpercentile(np.hypot(flow.u, flow.v), 99.5))
    rate = max(speed / (fastest * pixel), (frames - before) / float(flow.t[-1]))
    count = min(frames, before + int(flow.t[-1] * rate))
    return Shot(pixel=pixel, rate=rate, first=-before, frames=count, **more)


def collapse(
    seed: int,
    grain: float = 6.0,
    across: float = 40.0,
    frames: int = 200,
    fastest: float = 5.0,
    before: int = 12,
    **film: Any,
) -> Scene:
    """A random collapse: `across` grains high, the fastest moves `fastest` px per frame."""
    random = np.random.default_rng([seed, 1])
    mu_s = float(random.uniform(0.25, 0.5))
    like = Collapse(
        mu_s=mu_s,
        mu_2=mu_s + float(random.uniform(0.15, 0.3)),
        aspect=float(random.uniform(1.2, 2.5)),
        height=1.0,
        d=1.0 / across,
        box_width=3.2,
        box_height=1.2,
        t_end=3.2 * math.sqrt(HEIGHT / GRAVITY),
    )
    flow = column(256, 160, like)
    pixel = HEIGHT / (across * grain)
    size = {
        "rows": math.ceil(1.05 * HEIGHT / pixel) + MARGIN,
        "columns": math.ceil(float(flow.x[-1]) / pixel) + MARGIN,
    }
    more: Any = {"grain": grain, "seed": seed, **size}
    shot = _shot(flow, pixel, frames, fastest, before, **more)
    return Scene(flow, _field(flow), dataclasses.replace(shot, **film))


def chute(
    seed: int,
    grain: float = 6.0,
    depth: float = 30.0,
    frames: int = 200,
    fastest: float = 5.0,
    before: int = 12,
    **film: Any,
) -> Scene:
    """A layer of `depth` grains that starts from rest on a slope."""
    random = np.random.default_rng([seed, 2])
    mu_s = float(random.uniform(0.25, 0.4))
    d = HEIGHT / 2 / depth
    pixel = d / grain
    wide = 80 * d
    angle = math.degrees(math.atan(mu_s)) + 5.0
    like = Chute(
        mu_s=mu_s,
        mu_2=mu_s + 0.3,
        slope=angle,
        height=HEIGHT / 2,
        g=GRAVITY,
        density=FRACTION * GRAIN_DENSITY,
        d=d,
        frames=160,
        cells=48,
        t_end=0.6,
        period=wide,
        length_unit="m",
        time_unit="s",
    )
    flow = simulate(like)
    size = {"rows": math.ceil(1.1 * HEIGHT / 2 / pixel) + MARGIN, "columns": int(wide / pixel)}
    more: Any = {"grain": grain, "seed": seed, "period": like.period, **size}
    shot = _shot(flow, pixel, frames, fastest, before, **more)
    return Scene(flow, _field(flow), dataclasses.replace(shot, **film), tilt=angle)
