"""What is taken out: the settings and the constants of each variant of the training."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any, NamedTuple
from unittest.mock import patch

from bench.studies.ablation.tolerances import advancing, by_evidence, by_noise
from granpinn.data import collocation, points, surface_strip
from granpinn.identification import case
from granpinn.training import equations, last_layer, mean_rate, problem, tolerances, trainer


class Variant(NamedTuple):
    """A training with a rule taken out, or changed.

    Attributes:
        rule: what is taken out, and what it is for.
        settings: of the identification.
        replaced: (module, name, value) of constants and functions.
    """

    rule: str
    settings: Mapping[str, Any] = {}
    replaced: tuple[tuple[Any, str, Any], ...] = ()

    @contextmanager
    def made(self) -> Iterator[None]:
        """With the constants of the variant in their places."""
        with ExitStack() as stack:
            for module, name, value in self.replaced:
                stack.enter_context(patch.object(module, name, value))
            yield

    def also(self, rule: str, settings: Mapping[str, Any] | None = None, *more: Any) -> Variant:
        return Variant(rule, {**self.settings, **(settings or {})}, (*self.replaced, *more))


def _same(flow: Any) -> Any:
    return flow


def _all_resolved(cls: Any, facts: Any, training: int | None = None) -> Any:
    share = min(1.0, (tolerances.RESOLVED / max(1.0, facts.independent(training))) ** 0.5)
    return cls(facts.sigma, share)


def _uncapped(self: Any, weight: float, misfit: float) -> float:
    return float(max(1.0, self.share * self.sigma * weight**0.5) ** -2)


VN = tolerances.VelocityNoise
PLAIN_N = (VN, "of", classmethod(_all_resolved))
FIVE = Variant(
    "five of no effect: law error, finer strip, minimum of points, n^(k/3), repeated step",
    {"weights.law_error": 0.0},
    (
        (surface_strip, "FINER", 1),
        (collocation, "LEAST", 0),
        PLAIN_N,
        (last_layer, "ITERATIONS", 1),
    ),
)
FOUR = Variant(
    "the same with the repeated step",
    {"weights.law_error": 0.0},
    ((surface_strip, "FINER", 1), (collocation, "LEAST", 0), PLAIN_N),
)
SIX = FOUR.also("and no pre-fit", {"optimizer.prefit": 0.0})
V: dict[str, Variant] = {
    "default": Variant("nothing"),
    "law_error": Variant("relative error of the law in fast grains", {"weights.law_error": 0.0}),
    "finer": Variant("24 times finer strip", {}, ((surface_strip, "FINER", 1),)),
    "least": Variant("at least 30,000 points", {}, ((collocation, "LEAST", 0),)),
    "n_k": Variant("n = 1000^(k/3)", {}, (PLAIN_N,)),
    "repeat": Variant("repeated last-layer step", {}, ((last_layer, "ITERATIONS", 1),)),
    "prefit": Variant("pre-fit of the velocity", {"optimizer.prefit": 0.0}),
    "contradicted": Variant(
        "data may contradict the mean", {}, ((mean_rate, "CONTRADICTED", float("inf")),)
    ),
    "mean": Variant("mean strain rate", {}, ((equations, "CERTAIN", float("inf")),)),
    "last_layer": Variant("last-layer step", {"optimizer.last_layer": False}),
    "pressure_weight": Variant(
        "weight of the law by the error of the pressure", {}, ((equations, "PRESSURE_ERROR", 0.0),)
    ),
    "strip": Variant("strip under the surface", {}, ((surface_strip, "DENSITY", 0.0),)),
    "thickest": Variant("thickest strip", {}, ((surface_strip, "THICKEST", 1e9),)),
    "between": Variant("points between the vectors", {"batch.collocation": 0.0}),
    "lowest": Variant(
        "no points between the lowest rows",
        {},
        ((collocation, "without_row", lambda grains, gravity, row: grains),),
    ),
    "partial": Variant("partly filled cells", {}, ((case, "with_partial_cells", _same),)),
    "toe": Variant("toe of the surface left out", {}, ((points, "TOE_GRAINS", 0.0),)),
    "noise": Variant("tolerance follows the noise", {"weights.follow_noise": False}),
    "cap": Variant("noise is at most the misfit of the pre-fit", {}, ((VN, "factor", _uncapped),)),
    "columns": Variant("momentum / sqrt(columns)", {}, ((tolerances, "MOST_COLUMNS", 1),)),
    "five": FIVE,
    "four": FOUR,
    "six": SIX,
}
for momentum, law in ((0.03, 0.02), (0.03, 0.008), (0.02, 0.008), (0.05, 0.02), (0.03, 0.012)):
    V[f"four_{momentum:g}_{law:g}"] = FOUR.also(
        f"tolerances of momentum {momentum:g} and law {law:g}",
        {"weights.sigma_momentum": momentum, "weights.sigma_constitutive": law},
    )
BASE = Variant("the minimum of points and n^(k/3)", {}, ((collocation, "LEAST", 0), PLAIN_N))
V["base"] = BASE
for name in ("prefit", "repeat", "contradicted", "mean", "pressure_weight", "partial", "lowest"):
    V[f"base_{name}"] = BASE.also(V[name].rule, V[name].settings, *V[name].replaced)
for name in ("toe", "noise", "columns", "strip", "between", "thickest", "cap", "finer"):
    V[f"base_{name}"] = BASE.also(V[name].rule, V[name].settings, *V[name].replaced)
V["base_half"] = BASE.also("strip of half as many points", {}, (surface_strip, "FINER", 1e9))
for key, value in (
    *(("weights.sigma_momentum", m) for m in (0.02, 0.03)),
    *(("weights.sigma_constitutive", m) for m in (0.004, 0.016)),
    *(("weights.law_error", m) for m in (0.01, 0.04)),
):
    V[f"base_{key.split('_')[-1]}_{value:g}"] = BASE.also(f"{key} = {value:g}", {key: value})
for momentum, by_momentum, by_law in (
    (0.05, 0, 0.1),
    (0.05, 0, 0.3),
    (0.03, 0.8, 0),
    (0.03, 0.8, 0.1),
):
    V[f"base_noise_{momentum:g}_{by_momentum:g}_{by_law:g}"] = BASE.also(
        f"momentum {momentum:g}, growing by {by_momentum:g}, law by {by_law:g} of the noise",
        {"weights.sigma_momentum": momentum},
        (problem, "sigmas_of", by_noise(by_momentum, by_law)),
    )
V["evidence"] = FOUR.also(
    "tolerances by evidence", {}, (trainer.Trainer, "advance", advancing(by_evidence))
)
VARIANTS: Mapping[str, Variant] = V
