"""The collapse as an animated GIF, coloured by speed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from granpinn.data.flow import Flow
from granpinn.figures.style import VALUE_MAP, WIDTH, label, new_figure
from granpinn.output import replacing

MOST_FRAMES = 200
FRAMES_PER_SECOND = 25
DPI = 90


def animate(flow: Flow, path: Path) -> Path:
    """Writes the frames of a simulated flow, every n-th if there are many, as a GIF.

    Axes and colour bar are drawn once; per frame only the grains and the time change.
    """
    frames = range(0, len(flow.t), -(-len(flow.t) // MOST_FRAMES))
    speed = np.hypot(flow.u, flow.v)
    shape = float(flow.y[-1] / flow.x[-1])
    figure = new_figure(min(0.85 * WIDTH * shape + 0.8, 7.0))
    figure.set_dpi(DPI)
    canvas: Any = FigureCanvasAgg(figure)
    axes = figure.subplots()
    half = 0.5 * float(flow.x[1] - flow.x[0])  # the grid of a simulated flow is even
    image = axes.imshow(
        np.ma.masked_invalid(speed[0]),
        origin="lower",
        extent=(flow.x[0] - half, flow.x[-1] + half, flow.y[0] - half, flow.y[-1] + half),
        cmap=VALUE_MAP,
        vmin=0,
        vmax=float(np.nanmax(speed)),
        interpolation="nearest",
        animated=True,
    )
    axes.set_xlabel(label("$x$", flow.length_unit))
    axes.set_ylabel(label("$y$", flow.length_unit))
    title = axes.text(0, 1.02, " ", transform=axes.transAxes, va="bottom", animated=True)
    figure.colorbar(image, ax=axes, label="$|v|$")
    canvas.draw()
    background = canvas.copy_from_bbox(figure.bbox)

    def picture(k: int) -> Image.Image:
        canvas.restore_region(background)
        image.set_data(np.ma.masked_invalid(speed[k]))
        title.set_text(f"t = {flow.t[k]:.3g}")
        axes.draw_artist(image)
        axes.draw_artist(title)
        return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])

    # The colour bar is in every frame: the palette of one serves all.
    palette = picture(0).quantize(255)
    pictures = [picture(k).quantize(palette=palette, dither=Image.Dither.NONE) for k in frames]
    with replacing(path) as temporary:
        pictures[0].save(
            temporary,
            format="GIF",
            save_all=True,
            append_images=pictures[1:],
            duration=1000 // FRAMES_PER_SECOND,
            loop=0,
        )
    return path
