"""The operators of one optimization step, for E members at a time: csrc/step.h says what each does.

In an optimization step nothing crosses to the host: `counter` int64 [3] says which step it is and
`table` [rows, 2 + E] float64 what the schedule has for it (granpinn/training/control.py). `update`
and `descend` change tensors in place.

`batch_loss` is `residual_loss` of what `draw_batch` draws: for its arguments, followed by params,
theta and what comes after the term weights in granpinn.kernels.ops.residual_loss. As one operator,
a GPU brings the weights into order while it draws.

`orthogonalize` gives U V^T of matrices G = U S V^T [..., m, n], to about 30 %, by five steps of
Newton-Schulz (csrc/cpu/orthogonalize.h); `descend` subtracts it, times a learning rate, from
matrices of the parameters. Their `precision` "fast" lets a GPU round the operands of products to
half precision where G is float32 with sides up to 128: U V^T is then off by 0.2 % (Muon is
published in bfloat16, 2 %), and `descend` takes one launch. Sums and the iterate stay in float32.
It changes nothing on a CPU, in float64 and for larger matrices.
"""

from __future__ import annotations

from torch import library

from granpinn.kernels import op_rules  # noqa: F401  (loads the operators)
from granpinn.physics.terms import NAMES

VARIABLES = {"fixed": 0, "log": 1, "log_above": 2, "logistic": 3}
"""Codes of the unbounded variables q of a law (csrc/math/law_variables.h), for `update`."""


@library.register_fake("granpinn::draw_batch")
def _(counter, table, seeds, places, points, *rest):  # type: ignore[no-untyped-def]
    interior, surface, _ = rest[-3:]
    E = seeds.shape[0]
    shapes = ((interior, 3), (interior, 2), (interior, 2), (surface, 3), (surface,), (len(NAMES),))
    return tuple(points.new_empty([E, *shape]) for shape in shapes)


@library.register_fake("granpinn::batch_loss")
def _(counter, table, seeds, *rest):  # type: ignore[no-untyped-def]
    params, theta = rest[-9], rest[-8]
    E = params.shape[0]
    shapes = ((E,), (E, len(NAMES)), params.shape, theta.shape)
    return tuple(params.new_empty(shape) for shape in shapes)


@library.register_fake("granpinn::orthogonalize")
def _(G, precision="fp32"):  # type: ignore[no-untyped-def]
    return G.new_empty(G.shape)


def _nothing(*arguments: object) -> None:
    """The shapes of what an operator changes in place."""


for _name in ("update", "descend"):
    library.register_fake(f"granpinn::{_name}")(_nothing)
