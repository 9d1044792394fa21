"""The page of a film: one picture for every stage, for a look of ten seconds each."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import binned_statistic_2d

from granpinn.figures.style import BLUE, GREEN, ORANGE, SKY, Drawing, new_figure, save, styled
from granpinn.output import write_text
from granpinn.report.page import encoded, template

if TYPE_CHECKING:
    from granpinn.filming.measurement import Field, Measured

ARROWS = 700  # of a picture
LENGTH = 0.03  # of the longest arrow, widths of the picture
DPI = 110  # of pictures; the page has several
PATCHES = 60  # of the map of the granular temperature, along x


def write(measured: Measured, path: Path) -> None:
    """Writes the page, which needs no other file."""
    stages = {
        "Vectors, rejected features and free surface": vectors,
        "The film from frame to frame": history,
        "Granular temperature (noise is in it)": temperature,
    }
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "stage.png"
        for title, draw in stages.items():
            drawing = draw(measured)
            save(drawing.figure, file)
            pictures.append((title, drawing.caption, file.read_bytes()))
    text = template("camera.html", base64=encoded).render(
        said=measured.said, faults=measured.judgement.said, pictures=pictures
    )
    write_text(path, text)


def _on_picture(measured: Measured, each: Callable[[Any, Field], None]) -> Figure:
    """The shown frames one above the other; `each` draws on the axes of a field."""
    fields = measured.fields
    rows, columns = fields[0].picture.shape
    figure = new_figure(min(8.0, 0.4 + len(fields) * (0.25 + 5.2 * rows / columns)))
    figure.set_dpi(DPI)
    for axes, field in zip(figure.subplots(len(fields), squeeze=False)[:, 0], fields, strict=True):
        axes.imshow(field.picture, cmap="gray", vmax=max(1, np.quantile(field.picture, 0.995)))
        axes.set(title=f"frame {field.number}", xticks=[], yticks=[])
        each(axes, field)
        axes.set(xlim=(0, columns), ylim=(rows, 0))
    return figure


@styled
def vectors(measured: Measured) -> Drawing:
    """Vectors, features whose vectors were rejected, and the line of the free surface."""
    kept = [field.vectors.kept() for field in measured.fields]
    fastest = max(float(np.hypot(good.u, good.v).max()) for good in kept)

    def each(axes: Any, field: Field) -> None:
        all_, good = field.vectors, field.vectors.kept()
        rows, columns = field.picture.shape
        some = slice(None, None, max(1, good.x.size // ARROWS))
        arrows = {"angles": "xy", "scale_units": "xy", "scale": fastest / (LENGTH * columns)}
        places = (a[some] for a in (good.x, good.y, good.u, good.v))
        axes.quiver(*places, color=SKY, width=0.0015, **arrows)
        axes.plot(all_.x[~all_.good], all_.y[~all_.good], "x", color=ORANGE, ms=3)
        if measured.line is not None:
            now = measured.line.t == field.number
            axes.plot(measured.line.x[now], rows - measured.line.y[now], ".", color=GREEN, ms=1.5)

    caption = (
        f"Arrows vary smoothly; the longest is {fastest:.3g} px per frame. They lie everywhere in "
        "the grains and nowhere else. Crosses, the rejected features, are few. Green dots follow "
        "the upper edge of the grains."
    )
    return Drawing(_on_picture(measured, each), caption)


@styled
def history(measured: Measured) -> Drawing:
    """Motion, light and sharpness of every frame."""
    figure = new_figure(4.5)
    names = {"fast": "fast grains [px]", "light": "grey level", "sharp": "sharpness"}
    rows = zip(figure.subplots(len(names), 1, sharex=True), names.items(), strict=True)
    for axes, (key, name) in rows:
        axes.plot(getattr(measured.film, key), color=BLUE, lw=0.8)
        axes.set_ylabel(name)
        if measured.judgement.release is not None:
            axes.axvline(measured.judgement.release, color=ORANGE, lw=0.8)
    axes.set_xlabel("frame")
    return Drawing(figure, "Smooth curves, without spikes. The vertical line is the release.")


@styled
def temperature(measured: Measured) -> Drawing:
    """Half of the mean square of the motion around that of the neighbors."""

    def each(axes: Any, field: Field) -> None:
        good = field.vectors.kept()
        rows, columns = field.picture.shape
        bins = [max(1, round(PATCHES * rows / columns)), PATCHES]
        area = [[0, rows], [0, columns]]
        mean = binned_statistic_2d(good.y, good.x, good.temperature, bins=bins, range=area)
        shown = axes.imshow(mean.statistic, extent=(0, columns, rows, 0), cmap="magma")
        axes.figure.colorbar(shown, ax=axes)

    caption = (
        "Residual motion in (px/frame)^2: motion of single grains, and the noise of the measurement"
    )
    return Drawing(_on_picture(measured, each), caption)
