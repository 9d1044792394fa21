"""Figures of a result on axes of matplotlib, as `result.plot` gives them.

They are the panels of the report, in the style of the caller. Without axes each makes a figure by
pyplot, which a notebook shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize

from granpinn.arrays import Floats
from granpinn.declared import checked
from granpinn.errors import BadInput
from granpinn.figures import curves, maps
from granpinn.figures.style import label
from granpinn.results import Fields
from granpinn.results.fields import VARIABLES

if TYPE_CHECKING:
    from granpinn.identification.identified import Identification

SPEED = "speed"
SYMBOLS = {
    SPEED: "$|v|$",
    "D2": "$D_2$",
    "eta": r"$\eta$",
    "tau_xx": r"$\tau_{xx}$",
    "tau_xy": r"$\tau_{xy}$",
    "divergence": r"$\nabla \cdot v$",
    "momentum_residual_x": r"$e_x / (\rho |g|)$",
    "momentum_residual_y": r"$e_y / (\rho |g|)$",
    "u_reference": "$u$ of the flow",
    "v_reference": "$v$ of the flow",
    "p_reference": "reference $p$",
}
DECADES = ("I", "eta")  # spread over decades: their maps are logarithmic
LEAST_SHARE = 1e-3  # of the largest value, at the lower end of such a map

Panels = npt.NDArray[Any]  # of Axes


class Plots:
    """The figures of a result.

        result.plot()                            # law, speed and pressure
        result.plot.law(ax=ax)                   # on axes of your own
        result.plot.fields(1.0, ["p", "I"])      # maps at a time
        result.plot.law().figure.savefig("law.pdf")

    Times are in the unit of the flow; without one they are 0.7 of the last.
    """

    def __init__(self, result: Identification) -> None:
        self._result = result

    @checked
    def __call__(self, t: float | None = None) -> Panels:
        """The law, the speed and the pressure side by side; the three axes."""
        panels = _panels(1, 3, None)
        self.law(panels[0])
        self.fields(t, axes=panels[1:])
        return panels

    @checked
    def law(self, ax: Axes | None = None) -> Axes:
        """The law over the I of the data, its band, the points of the fit, and the true law."""
        (ax,) = _panels(1, 1, None if ax is None else [ax])
        curves.draw_law(ax, self._result)
        ax.set_xlabel("inertial number $I$")
        ax.set_title(self._result.friction_law.title)
        return ax

    @checked
    def fields(
        self,
        t: float | None = None,
        names: Sequence[str] = (SPEED, "p"),
        axes: Sequence[Axes] | Panels | None = None,
    ) -> Panels:
        """Maps of fields, one panel for each, at the frame nearest to a time.

        Args:
            names: variables of `result.fields`, or "speed".
            axes: one for each name.

        Raises:
            BadInput: a name is unknown, or there are more or fewer axes than names.
        """
        found = self._result.grid
        panels, k = _panels(1, len(names), axes), maps.frame_at(found, t)
        for ax, name in zip(panels, names, strict=True):
            values, kind = _values(found, name, k)
            text = label(SYMBOLS.get(name, f"${name}$"), found.units.of(kind))
            norm = _decades(values) if name in DECADES else maps.value_norm(values)
            one = maps.Map(f"$t$ = {found.t[k]:.4g}", values, norm, text)
            maps.draw_grains(ax, found, maps.grain_window(found, k), one)
        return panels

    @checked
    def history(self, axes: Sequence[Axes] | Panels | None = None) -> Panels:
        """The identified values, and the loss with its terms, against the step: two panels."""
        panels = _panels(2, 1, axes)
        curves.draw_evolution(panels[0], panels[1], self._result, self._result.history)
        return panels


def _panels(rows: int, columns: int, axes: Sequence[Axes] | Panels | None) -> Panels:
    """The given axes, or those of a new figure, [rows * columns]."""
    count = rows * columns
    if axes is None:
        from matplotlib import pyplot

        size = 4.8 * columns, 3.6 * rows
        _, made = pyplot.subplots(rows, columns, figsize=size, squeeze=False, layout="constrained")
        return np.asarray(made.ravel())
    given = np.atleast_1d(np.asarray(axes, dtype=object)).ravel()
    if len(given) != count or not all(isinstance(ax, Axes) for ax in given):
        raise BadInput(f"axes must be {count} axes of matplotlib, got {len(given)} objects")
    return given


def _values(fields: Fields, name: str, k: int) -> tuple[Floats, str]:
    """A field at frame k [Y, X] and its kind of quantity."""
    if name == SPEED:
        return np.hypot(fields.frame("u", k), fields.frame("v", k)), "velocity"
    if name not in fields.values:
        known = ", ".join([SPEED, *(known for known in VARIABLES if known in fields.values)])
        raise BadInput(f"names must be among {known}, got {name!r}")
    return fields.frame(name, k), VARIABLES[name][0]


def _decades(values: Floats) -> Normalize:
    highest = float(np.nanmax(values, initial=0.0)) or 1.0
    return LogNorm(LEAST_SHARE * highest, highest)
