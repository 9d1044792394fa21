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

from granpinn.kernels import registration  # noqa: F401  (loads the operators)

VARIABLES = {"fixed": 0, "log": 1, "log_above": 2, "logistic": 3}
"""Codes of the unbounded variables q of a law (csrc/math/law_variables.h), for `update`."""
