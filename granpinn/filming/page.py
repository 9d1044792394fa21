"""The page of a film: pictures of every stage, for a look of ten seconds each."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from granpinn.figures.page import template
from granpinn.figures.style import BLUE, GREEN, ORANGE, Drawing, new_figure, png, styled
from granpinn.output import write_text

if TYPE_CHECKING:
    from granpinn.filming.measurement import Measured

ARROWS = 700  # of a picture
LENGTH = 0.03  # of the longest arrow, widths of the picture
CURVES = {"fast": "fast grains [px]", "light": "grey level", "sharp": "sharpness"}


def write(measured: Measured, path: Path) -> None:
    """Writes the page, which needs no other file."""
    figure, caption = draw(measured)
    page = template("camera.html")
    write_text(path, page.render(said=measured.said, caption=caption, picture=png(figure)))


@styled
def draw(measured: Measured) -> Drawing:
    """Frames with their vectors, rejected features and surface; the film from frame to frame."""
    vectors, line, pictures = measured.vectors, measured.line, measured.pictures
    good = vectors[vectors.good]
    fastest = float(np.hypot(good.u, good.v).max())
    rows, columns = next(iter(pictures.values())).shape
    heights = [0.9 + min(3.5, 5.2 * rows / columns)] * len(pictures) + [1.2] * len(CURVES)
    figure = new_figure(sum(heights))
    stages = figure.subplots(len(heights), 1, height_ratios=heights)
    for axes, (number, picture) in zip(stages, pictures.items(), strict=False):
        axes.imshow(picture, cmap="gray", vmax=max(1, np.quantile(picture, 0.995)))
        now = good[good.t == number]
        now = now.iloc[:: max(1, len(now) // ARROWS)]
        arrows = axes.quiver(
            *(now[name] for name in ("x", "y", "u", "v", "temperature")),
            **{"angles": "xy", "scale_units": "xy", "scale": fastest / (LENGTH * columns)},
            **{"clim": (0, good.temperature.quantile(0.95)), "cmap": "cool", "width": 0.0015},
        )
        label = "granular temperature and noise [(px/frame)$^2$]"
        figure.colorbar(arrows, ax=axes, label=label, location="bottom", aspect=60)
        wrong = vectors[~vectors.good & (vectors.t == number)]
        axes.plot(wrong.x, wrong.y, "x", color=ORANGE, ms=3)
        if line is not None:
            here = line.t == number
            axes.plot(line.x[here], rows - line.y[here], ".", color=GREEN, ms=1.5)
        axes.set(title=f"frame {number}", xticks=[], yticks=[], xlim=(0, columns), ylim=(rows, 0))
    for axes, (key, name) in zip(stages[len(pictures) :], CURVES.items(), strict=True):
        axes.plot(measured.film[key], color=BLUE, lw=0.8)
        axes.set(ylabel=name, xlabel="frame")
        if measured.released is not None:
            axes.axvline(measured.released, color=ORANGE, lw=0.8)
    return Drawing(
        figure,
        f"Arrows vary smoothly; the longest is {fastest:.3g} px per frame. They lie everywhere in "
        "the grains and nowhere else. Their color is the granular temperature: half of the mean "
        "square of the motion around that of the neighbors, with the noise in it. Crosses, the "
        "rejected features, are few. Green dots follow the upper edge of the grains. The curves "
        "have no spikes; the vertical line is the release.",
    )
