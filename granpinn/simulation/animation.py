"""The collapse as an animated GIF, coloured by speed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg

from granpinn.atomic import atomic_path
from granpinn.data.flow import Flow
from granpinn.plots.style import VALUE_MAP, WIDTH, label, new_figure

MOST_FRAMES = 60
FRAMES_PER_SECOND = 15
DPI = 90


def animate(flow: Flow, path: Path) -> Path:
    """Writes the frames of a flow, every n-th if there are many, as a GIF."""
    frames = range(0, len(flow.t), -(-len(flow.t) // MOST_FRAMES))
    speed = np.hypot(flow.u, flow.v)
    shape = float(flow.y[-1] / flow.x[-1])
    figure = new_figure(min(0.85 * WIDTH * shape + 0.8, 7.0))
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    mesh = axes.pcolormesh(
        flow.x,
        flow.y,
        np.ma.masked_invalid(speed[0]),
        shading="nearest",
        cmap=VALUE_MAP,
        vmin=0,
        vmax=float(np.nanmax(speed)),
    )
    axes.set_aspect("equal")
    axes.set_xlabel(label("$x$", flow.length_unit))
    axes.set_ylabel(label("$y$", flow.length_unit))
    figure.colorbar(mesh, ax=axes, label="$|v|$")

    # Lay out once: doing it for every frame takes most of the time.
    axes.set_title(" ")
    figure.canvas.draw()
    figure.set_layout_engine("none")

    def draw(k: int) -> list[Artist]:
        mesh.set_array(np.ma.masked_invalid(speed[k]))
        axes.set_title(f"t = {flow.t[k]:.3g}")
        return [mesh]

    animation = FuncAnimation(figure, draw, frames=frames, blit=False)
    with atomic_path(path) as temporary:
        writer = PillowWriter(fps=FRAMES_PER_SECOND)
        gif = temporary.with_suffix(".gif")  # the writer goes by the name
        try:
            animation.save(str(gif), writer=writer, dpi=DPI)
            temporary.write_bytes(gif.read_bytes())
        finally:
            gif.unlink(missing_ok=True)
    return path
