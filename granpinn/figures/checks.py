"""The checks of an identification: the profile of I0, the simulation with the identified law."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import Normalize

from granpinn.arrays import Floats
from granpinn.figures.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    VALUE_MAP,
    Drawing,
    label,
    new_figure,
    styled,
)
from granpinn.physics.laws import mu_of_i
from granpinn.results.fields import Units
from granpinn.uncertainty.unknown_I0 import ProfilePoint

Curve = Callable[[str], Floats]  # a curve of checks/resimulation.py by its name


@styled
def profile_of_I0(
    points: Sequence[ProfilePoint], smallest_rise: float, answer: str, I0_of_run: float
) -> Drawing:
    """The rise of the loss, and mu_s, mu_2 and the slope of mu(I), over the grid of I0.

    Args:
        smallest_rise: a rise of the loss up to this is scatter of the training.
        answer: what the profile says, for the caption.
    """
    I0 = np.array([p.I0 for p in points])
    excluded = np.array([p.excluded for p in points])
    rises = np.array([p.loss_rise for p in points])
    figure = new_figure(5.4)
    loss, values = figure.subplots(2, 1, sharex=True)
    loss.plot(I0, rises, color=BLUE)
    loss.plot(I0[~excluded], rises[~excluded], "o", color=BLUE, label="allowed")
    loss.plot(I0[excluded], rises[excluded], "x", color=ORANGE, label="excluded")
    loss.axhline(smallest_rise, color=GREY, lw=1.2, ls=(0, (4, 3)), label="scatter (3 se)")
    loss.set_xscale("log")
    loss.set_ylabel("rise of the loss")
    loss.set_title("(a) loss over the best")
    for name, color in (("mu_s", BLUE), ("mu_2", ORANGE)):
        symbol = f"${mu_of_i.LAW.parameter(name).symbol}$"
        values.plot(I0, [getattr(p, name) for p in points], "o-", color=color, label=symbol)
    slope = [p.slope for p in points]
    values.plot(I0, slope, "o-", color=GREEN, label=r"$(\mu_2 - \mu_s)/I_0$")
    for axes in (loss, values):
        axes.axvline(I0_of_run, color=BLACK, lw=1.0, ls=(0, (1, 2)))
        axes.grid(True)
        axes.legend()
    values.set_yscale("log")
    values.set_xlabel("$I_0$, held fixed")
    values.set_title("(b) identified values")
    return Drawing(figure, f"{answer}. Dotted: the I0 of the run.")


@styled
def resimulation(curve: Curve, units: Units | None) -> Drawing:
    """Front, surface profiles and velocity error of a simulation against the data."""
    length = units.of("length") if units else None
    time = label("$t$", units.of("time") if units else None)
    has_front = bool(np.isfinite(curve("front")).any())
    figure = new_figure(7.2 if has_front else 2.6)
    *above, error = figure.subplots(3 if has_front else 1, 1, squeeze=False)[:, 0]
    if has_front:
        _front_and_surface(above, curve, time, length)
    error.plot(curve("t"), curve("velocity_percent"), color=ORANGE)
    error.set_ylim(bottom=0)
    error.set_xlabel(time)
    error.set_ylabel("velocity error [%]")
    number = "(c) " if has_front else ""
    error.set_title(f"{number}velocity, relative $L_2$ error over the common points")
    for axes in (*above, error):
        axes.grid(True)
    start = "column" if has_front else "layer"
    return Drawing(
        figure,
        f"The data against a simulation with the identified law, from the {start} "
        "of the first frame.",
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
