"""What is taken out or changed: the settings and the constants of each variant of the training."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any, NamedTuple
from unittest.mock import patch

from granpinn.data import collocation, outline, surface_strip
from granpinn.fit import case
from granpinn.training import equations, last_layer, mean_rate, tolerances


class Variant(NamedTuple):
    """A training with a rule taken out, or changed.

    Attributes:
        rule: what is taken out or changed, in words.
        settings: of the identification.
        replaced: (module or class, name, value) of constants and functions.
    """

    rule: str
    settings: Mapping[str, Any] = {}
    replaced: tuple[tuple[Any, str, Any], ...] = ()

    @contextmanager
    def made(self) -> Iterator[None]:
        """With the constants of the variant in their places."""
        with ExitStack() as stack:
            for place, name, value in self.replaced:
                stack.enter_context(patch.object(place, name, value))
            yield


def _constant(rule: str, place: Any, name: str, value: Any) -> Variant:
    return Variant(rule, {}, ((place, name, value),))


def _setting(rule: str, name: str, value: Any) -> Variant:
    return Variant(rule, {name: value})


VARIANTS: Mapping[str, Variant] = {
    "default": Variant("nothing"),
    # Rules, each taken out.
    "partial": _constant("partly filled cells", case, "with_partial_cells", lambda flow: flow),
    "between": _setting("points between the vectors", "batch.collocation", 0.0),
    "lowest": _constant(
        "no points between the lowest rows", collocation, "without_row", lambda g, *_: g
    ),
    "strip": _constant("strip under the surface", surface_strip, "DENSITY", 0.0),
    "finer": _constant("24 times finer strip", surface_strip, "FINER", 1),
    "thickest": _constant("thickest strip", surface_strip, "THICKEST", 1e9),
    "toe": _constant("the toe of the surface does not count", outline, "TOE_GRAINS", 0.0),
    "columns": _constant("momentum / sqrt(columns)", tolerances, "MOST_COLUMNS", 1),
    "noise": _setting("tolerance follows the noise", "weights.follow_noise", False),
    "law_error": _setting("relative error of the law", "weights.law_error", 0.0),
    "prefit": _setting("pre-fit of the velocity", "optimizer.prefit", 0.0),
    "last_layer": _setting("last-layer step", "optimizer.last_layer", False),
    "repeat": _constant("repeated last-layer step", last_layer, "ITERATIONS", 1),
    "mean": _constant("mean strain rate", equations, "CERTAIN", math.inf),
    "contradicted": _constant("data contradict the mean", mean_rate, "CONTRADICTED", math.inf),
    "pressure_weight": _constant("pressure error", equations, "PRESSURE_ERROR", 0.0),
    # Other tolerances.
    "momentum_0.03": _setting("momentum 0.03", "weights.sigma_momentum", 0.03),
    "momentum_0.02": _setting("momentum 0.02", "weights.sigma_momentum", 0.02),
    "error_0.01": _setting("relative error of the law 1 %", "weights.law_error", 0.01),
    "error_0.04": _setting("relative error of the law 4 %", "weights.law_error", 0.04),
}
