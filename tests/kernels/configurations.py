"""The one table that drives the kernel tests: random problems, a pure function of their index.

All numbers are drawn in float32 and held in float64, so that casting a problem to float32 loses
nothing: every difference between two precisions is then an error of the computation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.utils._pytree import tree_map_only

from granpinn.kernels.network import NetworkSpec, n_params
from granpinn.physics.terms import LossPoints

Form = Literal["strong", "mixed"]
Regime = Literal["flowing", "low pressure", "slow"]

POINTS = (1, 31, 33, 65_537)
# Index of an ensemble whose members see the same data; every fourth row of the table is one.
SHARED = 1000
# Points times parameters of one oracle evaluation; keeps a configuration near a second.
BUDGET = 1e7


# Least and largest values of the parameters of each law in the table. The switches of a law, where
# its slope jumps in I, are within the I of the table.
THETA = {
    "mu_of_i": ((0.2, 0.5), (0.5, 0.9), (0.2, 0.4)),
    "coulomb": ((0.2, 0.5),),
    "regularised": ((0.2, 0.5), (0.5, 0.9), (0.2, 0.4), (0.02, 0.1), (1.5, 2.0), (0.01, 0.05)),
    "power": ((0.2, 0.5), (0.3, 0.9), (0.4, 1.5)),
    "cohesive": ((0.2, 0.5), (0.5, 0.9), (0.2, 0.4), (0.02, 0.5)),
    "free": (*[(0.2, 0.9)] * 8, (0.005, 0.02), (0.1, 1.0)),
}
SWITCHES = {"regularised": [5], "free": [8, 9]}  # parameters that are an I where the slope jumps
OTHERS = ("regularised", "power", "free", "cohesive")  # of the rows 3, 8, 13, ...


# Layers below this width are all alike. A bottleneck of one or two units makes all derivatives of
# all outputs proportional; the plastic stress then depends on a direction that reverse mode gets
# nearly exactly and forward mode (the kernels' jets) with the error of each component.
NARROW = 8


@dataclass(frozen=True)
class Configuration:
    """One row of the table. `members` is the ensemble size, None for no ensemble axis."""

    index: int
    form: Form
    points: int
    surface_points: int
    hidden: tuple[int, ...]
    regime: Regime
    members: int | None
    threads: int
    law: str = "mu_of_i"
    side_wall: float = 0.0
    source: bool = False

    @property
    def widths(self) -> list[int]:
        return [3, *self.hidden, 3 if self.form == "strong" else 5]

    def __str__(self) -> str:
        hidden = "x".join(map(str, self.hidden))
        ensemble = "" if self.members is None else f"-E{self.members}"
        regime = self.regime.replace(" ", "_")
        law = "" if self.law == "mu_of_i" else f"-{self.law}"
        walls = "-walls" if self.side_wall else ""
        source = "-source" if self.source else ""
        kind = f"{self.index}-{self.form}{law}{walls}{source}"
        return f"{kind}-N{self.points}-{hidden}-{regime}{ensemble}-t{self.threads}"


def configuration(index: int) -> Configuration:
    """Row `index` of the table, any non-negative integer."""
    rng = np.random.default_rng(index)
    points = POINTS[3] if index % 20 == 19 or index % 40 == 10 else int(rng.choice(POINTS[:3]))
    members = None if rng.random() < 0.6 else int(rng.integers(1, 4))
    row = Configuration(
        index=index,
        form="strong" if index % 2 else "mixed",
        points=points,
        surface_points=int(rng.choice([0, 1, 17, 64])),
        hidden=(),
        regime=("flowing", "low pressure", "slow")[index % 3],
        members=members,
        threads=int(rng.integers(1, 3)),
        law={2: "coulomb", 3: OTHERS[(index // 5 + index // 20) % 4]}.get(index % 5, "mu_of_i"),
        side_wall=0.5 if index % 7 < 4 else 0.0,
        source=index % 5 == 4,
    )
    while True:
        depth = int(rng.integers(1, 9))
        width = int(rng.choice([rng.integers(1, 9), 33, 64, 256]))
        hidden = (width,) * depth
        if width > NARROW and rng.random() < 0.5:
            hidden = tuple(int(w) for w in rng.integers(NARROW, width + 1, depth))
        row = replace(row, hidden=hidden)
        if points * n_params(row.widths) * (members or 1) <= BUDGET:
            return row


def small(form: Form, **changes: Any) -> Configuration:
    """A small, well-conditioned row outside the table, for tests of one property.

    `members` with `index=SHARED` makes an ensemble whose members see the same data.
    """
    row = Configuration(
        index=1001,
        form=form,
        points=33,
        surface_points=5,
        hidden=(17, 8),
        regime="flowing",
        members=None,
        threads=1,
    )
    return replace(row, **changes)


class Problem(NamedTuple):
    """The arguments of residual_loss, for one configuration and one draw of points."""

    params: Tensor
    theta: Tensor
    batch: LossPoints
    term_weights: Tensor
    spec: NetworkSpec
    physics: list[float]
    law: str

    def to(self, dtype: torch.dtype) -> Problem:
        cast: Problem = tree_map_only(Tensor, lambda x: x.to(dtype), self)
        return cast

    def part(self, start: int, stop: int, surface_start: int = 0, surface_stop: int = 0) -> Problem:
        """The same networks with a range of the points and of the surface points."""
        chosen = self.batch.at(slice(start, stop), slice(surface_start, surface_stop))
        return self._replace(batch=chosen)

    def member(self, e: int) -> Problem:
        """Member e of an ensemble as a problem of its own."""
        own = {"params": self.params[e], "theta": self.theta[e], "batch": self.batch.member(e)}
        return self._replace(**own)

    @property
    def network(self) -> tuple[Any, ...]:
        """Arguments of network_value, and of network_jet up to the order."""
        spec = self.spec
        return self.batch.points, self.params, spec.widths, spec.input_shift, spec.input_scale

    @property
    def strong(self) -> tuple[Any, ...]:
        """Arguments of strong_residual."""
        points, params, *scaling = self.network
        return points, params, self.theta, *scaling, self.physics, self.law


def problem(row: Configuration, draw: int = 0) -> Problem:
    """The network of `row`, always the same, with points and data number `draw`."""
    weights, data = (
        np.random.default_rng([row.index, 0]),
        np.random.default_rng([row.index, 1, draw]),
    )
    E = () if row.members is None else (row.members,)
    E_data = () if row.index % 4 == SHARED % 4 else E
    N, M = row.points, row.surface_points

    eta_min, eta_max = 1e-3, 1e4
    U, P, p_shift = {
        "flowing": (1.0, 1.0, 1.0),
        "low pressure": (1.0, 1e-3, 0.0 if row.form == "strong" else -6.0),
        "slow": (1e-4, 1.0, 1.0),
    }[row.regime]
    return Problem(
        params=_params(row, weights, E, p_shift),
        theta=_theta(row, weights, E),
        batch=LossPoints(
            _tensor(data.uniform((-1, 0, 0), (2, 1.5, 3), (*E_data, N, 3))),
            _tensor(U * data.normal(size=(*E_data, N, 2))),
            _tensor(data.uniform(0.1, 1, (*E_data, N, 2))),
            _tensor(data.uniform((-1, 0, 0), (2, 1.5, 3), (*E_data, M, 3))),
            _tensor(P * data.uniform(0, 1, (*E_data, M))),
            _tensor(data.normal(size=(*E_data, N, 2))) if row.source else None,
        ),
        term_weights=_tensor(weights.uniform(0.2, 2, 5)),
        spec=NetworkSpec(
            tuple(row.widths),
            tuple(_floats(weights.uniform(-0.5, 0.5, 3))),
            tuple(_floats(weights.uniform(0.3, 1.5, 3))),
            row.form,
        ),
        physics=_floats(
            [
                *(0.02, *weights.uniform(-1, 0, 2), eta_min, eta_max, U, P, 1e-3 * P, 2 * U),
                *(row.side_wall, 0.1 * U, 0.75),
            ]
        ),
        law=row.law,
    )


def _theta(row: Configuration, rng: np.random.Generator, E: tuple[int, ...]) -> Tensor:
    low, high = zip(*THETA[row.law], strict=True)
    return _tensor(rng.uniform(low, high, (*E, len(low))))


def _params(
    row: Configuration, rng: np.random.Generator, E: tuple[int, ...], p_shift: float
) -> Tensor:
    """Weights of variance 2/fan_in and biases of 0.3: outputs of order one at every depth."""
    layers = []
    for n_in, n_out in pairwise(row.widths):
        layers.append(rng.normal(scale=np.sqrt(2 / n_in), size=(*E, n_out * n_in)))
        layers.append(rng.normal(scale=0.3, size=(*E, n_out)))
    layers[-1][..., 2] += p_shift
    return _tensor(np.concatenate(layers, axis=-1))


def _tensor(values: np.ndarray) -> Tensor:
    return torch.from_numpy(values.astype(np.float32)).double()


def _floats(values: Any) -> list[float]:
    return [float(np.float32(value)) for value in values]
