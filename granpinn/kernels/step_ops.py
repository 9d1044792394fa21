"""The operators of one optimization step of E members; csrc/step.h describes each.

A step copies nothing to the host. `counter` int64 [3] holds the number of the step, and `table`
[rows, 2 + E] float64 the schedule of the next steps (granpinn/training/control_table.py). `update`
and `descend` change tensors in place.

`batch_loss` draws a batch as `draw_batch` does and evaluates `residual_loss` on it. Its arguments
are the arguments of `draw_batch`, then params and theta, then the arguments of
granpinn.kernels.ops.residual_loss after the term weights. On a GPU it also packs the weights. Both
take a source term at all points [N, 2], or None, as their last argument. It is the last of the
tensors that `draw_batch` returns; without a source that one has no rows.

The operators raise ValueError or TypeError for wrong sizes, and if a tensor that they change shares
memory with another. `places` must lie within the points: a CPU raises ValueError. A GPU draws NaN
for a member with a wrong place, because a check would wait for the device; its loss is then NaN.

`orthogonalize` gives U V^T of matrices G = U S V^T [..., m, n], to about 30 %, by five steps of
Newton-Schulz (csrc/cpu/orthogonalize.h); `descend` subtracts it, times a learning rate, from
matrices of the parameters. With `precision` "fast" a GPU rounds the operands of products to half
precision if G is float32 with sides up to 128. The error of U V^T is then 0.2 % (Muon is published
in bfloat16, 2 %), and `descend` takes one launch. Sums and the iterate stay in float32. "fast"
changes nothing on a CPU, in float64 and for larger matrices.
"""

from __future__ import annotations

from granpinn.kernels import registration  # noqa: F401  (loads the operators)

VARIABLES = {"fixed": 0, "log": 1, "log_above": 2, "logistic": 3}
"""Codes of the unbounded variables q of a law (csrc/math/law_variables.h), for `update`."""
