"""A simulation with the identified law against the data."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import Normalize

from granpinn.arrays import Floats
from granpinn.figures.style import (
    BLACK,
    BLUE,
    ORANGE,
    VALUE_MAP,
    Drawing,
    label,
    new_figure,
    styled,
)
from granpinn.results.fields import Units

Curve = Callable[[str], Floats]  # a curve of checks/resimulation.py by its name


@styled
def resimulation(curve: Curve, units: Units | None) -> Drawing:
    """Front, surface profiles and velocity error of a simulation against the data."""
    length = units.of("length") if units else None
    time = label("$t$", units.of("time") if units else None)
    figure = new_figure(7.2)
    *above, error = figure.subplots(3, 1)
    _front_and_surface(above, curve, time, length)
    error.plot(curve("t"), curve("velocity_percent"), color=ORANGE)
    error.set_ylim(bottom=0)
    error.set_xlabel(time)
    error.set_ylabel("velocity error [%]")
    error.set_title("(c) velocity, relative $L_2$ error over the common points")
    for axes in (*above, error):
        axes.grid(True)
    return Drawing(
        figure,
        "The data against a simulation with the identified law, from the column of the first "
        "frame.",
    )


def _front_and_surface(panels: Sequence[Axes], curve: Curve, time: str, length: str | None) -> None:
    """The two panels above the error of a collapse."""
    front, surface = panels
    t = curve("t")
    every = max(1, len(t) // 40)
    front.plot(t, curve("front_simulated"), color=BLUE, label="simulated")
    dots: dict[str, Any] = {"color": BLACK, "ms": 3.6, "mfc": "white", "mew": 1.0}
    front.plot(t[::every], curve("front")[::every], "o", label="data", **dots)
    front.set_xlabel(time)
    front.set_ylabel(label("front $x$", length))
    front.set_title("(a) front")
    front.legend()
    norm, times = Normalize(0, float(t[-1])), t[curve("frames").astype(int)]
    for time_k, known, found in zip(
        times, curve("profiles"), curve("profiles_simulated"), strict=True
    ):
        color = colormaps[VALUE_MAP](norm(float(time_k)))
        surface.plot(curve("x"), found, color=color, label=f"t = {time_k:.3g}")
        surface.plot(curve("x"), known, "o", color=color, ms=2.6, mfc="white", mew=0.8)
    surface.set_xlabel(label("$x$", length))
    surface.set_ylabel(label("height", length))
    surface.set_title("(b) surface: lines simulated, dots data")
    surface.legend()
