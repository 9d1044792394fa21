"""The inertial numbers of the flowing vectors: what they show of a law, and whether it is dense."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from granpinn.data.scaling import initial_height
from granpinn.inspection import Inspection, digits
from granpinn.inspection.statements import FEW_GRAINS
from granpinn.physics.laws import mu_of_i
from granpinn.results.parameters import NOT_DETERMINED
from granpinn.results.record import CARE, IMPROBABLE, Check, Reason, Record
from granpinn.uncertainty.determined import lost_of, percentiles
from granpinn.uncertainty.error_model import Known, Pair, ends_of

GAS = 1.0  # median inertial number: above, grains collide as in a gas
I_EDGES = np.logspace(-4, 1, 51)  # of the figure


@dataclass(frozen=True)
class InertialRange(Record):
    """With the pressure of estimates/facts.py.

    Attributes:
        q05, q50, q95, q99: quantiles.
        above: share with I > I0 / 3, where mu(I) bends enough to show mu_2; None for a law without
            I0.
        low, high: the range of I of the vectors that shear.
        lost: parameters of mu(I) that this range does not determine.
    """

    title = "inertial number"

    q05: float
    q50: float
    q95: float
    q99: float
    above: float | None
    low: float
    high: float
    lost: tuple[str, ...]

    @property
    def words(self) -> str:
        scale = "" if self.above is None else f"; {self.above:.0%} above I0/3"
        return (
            f"{self.q05:.2g} to {self.q95:.2g} (5..95 %), median {self.q50:.2g}, with hydrostatic "
            f"pressure below the surface{scale}"
        )

    def reasons(self, of: Inspection) -> list[Reason]:
        found = []
        flow, text = of.filmed, ""
        count = initial_height(flow) / flow.grain_diameter
        if not flow.periodic and count < FEW_GRAINS and self.q99 > GAS:
            text = (
                f"the grains are {digits(count)} diameters high, and the inertial number reaches "
                f"{self.q99:.2g}, where grains collide as in a gas"
            )
        elif self.q50 > GAS:
            text = (
                f"the inertial number is {self.q50:.2g} (median), and dense flows have less than "
                f"{GAS:g}"
            )
        if text:
            text += ": check the grain diameter, the scale and the frame rate"
            found.append(Reason(IMPROBABLE, text))
        if self.lost:
            text = (
                f"{' and '.join(self.lost)} {NOT_DETERMINED}: the grains shear at I = "
                f"{self.low:.2g} to {self.high:.2g} only; a training gives mu there."
            )
            found.append(Reason(CARE, text))
        return found

    def figures(self) -> dict[str, tuple[str, Callable[[Inspection], Any]]]:
        return {"inertial_number": ("Inertial numbers that the data cover", _draw)}


def make(inspection: Inspection) -> InertialRange | None:
    numbers, law = inspection.inertia, inspection.law
    found, shear = numbers.quantiles(0.05, 0.5, 0.95, 0.99), shear_of(inspection)
    if found is None or shear is None:
        return None
    above, scale = None, law.inertial_scale
    if scale is not None:
        weight = numbers.vectors[numbers.flows]
        above = float(weight[scale / 3 < numbers.I[numbers.flows]].sum() / weight.sum())
    lost: tuple[str, ...] = ()
    if law.law == mu_of_i.LAW.name and inspection.undetermined is None:
        mu_s, mu_2, I0 = law.theta
        lost = lost_of([Known(ends_of(shear, I0), (mu_s, mu_2))])
    q05, q50, q95, q99 = found
    return InertialRange(q05, q50, q95, q99, above, *shear, lost)


def shear_of(inspection: Inspection) -> Pair | None:
    """The range of I of the vectors that shear; None if none does."""
    numbers = inspection.inertia
    return percentiles(numbers.I[numbers.flows], numbers.vectors[numbers.flows])


def _draw(inspection: Inspection) -> Any:
    """The assumed friction law, that of the momentum balance, and I of the flowing vectors."""
    from matplotlib.ticker import PercentFormatter

    from granpinn.figures.style import BLACK, BLUE, ORANGE, SKY, Drawing, new_figure, styled

    @styled
    def draw(found: InertialRange) -> Drawing:
        figure = new_figure(4.6)
        law_axes, axes = figure.subplots(2, 1, sharex=True, height_ratios=(1.3, 1))
        law, numbers = inspection.law, inspection.inertia
        I = np.geomspace(I_EDGES[0], I_EDGES[-1], 300)
        mu = law.friction_law.friction(I, *law.theta)
        law_axes.plot(I, mu, color=BLUE, label=r"$\mu(I)$ assumed")
        law_axes.axvspan(found.q05, found.q95, color=SKY, alpha=0.3, lw=0)
        scale = law.inertial_scale
        if scale is not None:
            text = f"$I_0$ = {scale:g}"
            law_axes.axvline(scale, color=BLACK, ls=(0, (4, 3)), lw=1.2, label=text)
            axes.axvline(scale / 3, color=ORANGE, lw=1.2, label="$I_0/3$")
            axes.legend()
        balance = inspection.records.get("momentum_balance")
        points = getattr(balance, "points", ()) if getattr(balance, "shown", ()) else ()
        if points:
            values = ([getattr(p, name) for p in points] for name in ("I", "mu", "se"))
            look = {"fmt": "o", "ms": 3, "color": ORANGE, "label": "momentum balance"}
            law_axes.errorbar(*values, **look)
        law_axes.set_ylabel(r"$\mu(I)$")
        law_axes.legend(loc="upper left")
        law_axes.set_title("(a) covered by 5 to 95 % of the flowing vectors")
        weights = numbers.vectors[numbers.flows]
        share = weights / weights.sum()
        axes.hist(numbers.I[numbers.flows], I_EDGES.tolist(), weights=share, color=SKY)
        axes.set_xscale("log")
        axes.set_xlabel("inertial number $I$, hydrostatic pressure below the surface")
        axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
        axes.set_title("(b) share of the flowing vectors")
        return Drawing(figure, "Inertial numbers that the data cover.")

    return draw(inspection["inertial_number"])


CHECK = Check("inertial_number", InertialRange, make, seconds=0.2, quick=False, explains=True)
