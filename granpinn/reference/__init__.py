r"""The slow truth: every op of `granpinn.kernels.ops` by nested automatic differentiation.

Nothing here shares code or a closed-form derivative with the kernels of csrc/: derivatives with
respect to x, y, t, the weights and the rheology all come from `torch.autograd.grad`. Works in any
floating dtype; float64 is the yardstick of the tests, float32 the rival whose error they allow.

Shapes: points [N, 3] in the order (x, y, t), params [P], theta [K] of a friction law with K
parameters. With an ensemble, params [E, P], theta [E, K] and any input may lead with E; outputs
then lead with E. `physics` has the fields of `granpinn.physics.constants.Physics`; all quantities
are dimensionless (`granpinn.physics.scales`). Equation numbers are those of the paper.
"""

from granpinn.reference.equations import pointwise_residuals, residuals, strong_residual
from granpinn.reference.friction import friction, inertial_number, viscosity, yield_stress
from granpinn.reference.loss import loss_terms, residual_loss
from granpinn.reference.network import network, network_jet, network_value

__all__ = [
    "friction",
    "inertial_number",
    "loss_terms",
    "network",
    "network_jet",
    "network_value",
    "pointwise_residuals",
    "residual_loss",
    "residuals",
    "strong_residual",
    "viscosity",
    "yield_stress",
]
