r"""The prior of a free curve: its strength, from the data, by the marginal likelihood.

The second differences $Dc$ of the coefficients of a curve (`Law.curve`) have the prior
$N(0, 1/\lambda)$. Around the point of the last-layer step the loss is quadratic in the parameters
$\theta$ of the law,

$$ L(\delta) = L_0 + g^T \delta + \tfrac12 \delta^T H \delta, $$

after the coefficients C of the network are eliminated: H is the Schur complement of their block of
the normal equations. The likelihood is $\exp(-L/\tau)$. The residuals of neighboring points are
correlated, so that the number of independent points is not known. $\tau$ follows from the scatter
of the gradient over blocks of space and time,

$$ \tau = \frac1N \operatorname{tr} H^{-1} \sum_B s_B s_B^T, $$

with which the covariance $\tau H^{-1}$ has the size of the sandwich estimate (White, Econometrica
50, 1982). Then $\lambda$ maximises (MacKay, Neural Computation 4, 1992)

$$ 2 \ln E(\lambda) = \operatorname{rank} D \, \ln\lambda
   - \ln\det\!\left(H/\tau + \lambda D^T D\right)
   - \min_\delta \left[ \tfrac2\tau L(\delta) + \lambda |D(\theta + \delta)|^2 \right]. $$
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from granpinn.physics.laws import FrictionLaw

PARTS = 4  # of the range of x, of y and of t, for the blocks
LEAST, MOST, COUNT = 1e-2, 1e10, 121  # values of lambda


def differences(law: FrictionLaw, like: Tensor) -> Tensor:
    """The second differences D [R, L] of the curve among the L free parameters of a law; R may be
    0."""
    where = [law.free.index(name) for name in law.curve]
    D = like.new_zeros(max(0, len(where) - 2), len(law.free))
    for k, row in enumerate(D):
        row[where[k : k + 3]] = like.new_tensor([1.0, -2.0, 1.0])
    return D


def strength(A: Tensor, b: Tensor, scores: Tensor, theta: Tensor, D: Tensor, ridge: float) -> float:
    """tau lambda, the weight of |D theta|^2 / 2 beside the loss; 0 where nothing determines it.

    Args:
        A, b: the normal equations J^T J [K, K] and J^T r [K]; theta are the last L unknowns.
        scores: the parts of b from each block [B, K].
        theta: free parameters of the law [L].
        D: second differences [R, L].
        ridge: added to the unit diagonal of the scaled equations for the other unknowns.
    """
    L = len(theta)
    of_C, of_law = slice(0, len(b) - L), slice(len(b) - L, len(b))
    scale = A.diagonal()[of_C].sqrt().clamp_min(1e-30)
    scaled = A[of_C, of_C] / scale / scale[:, None]
    scaled.diagonal().add_(ridge)
    factor, fault = torch.linalg.cholesky_ex(scaled)
    if int(fault):
        return 0.0
    across = A[of_C, of_law] / scale[:, None]
    solved = torch.cholesky_solve(across, factor)
    H = A[of_law, of_law] - across.T @ solved
    g, s = (x[..., of_law] - (x[..., of_C] / scale) @ solved for x in (b, scores))
    s = s - s.mean(0)
    # a direction that nothing determines has no share in tau
    values, vectors = torch.linalg.eigh((H + H.T) / 2)
    known = values > 1e-10 * values[-1]
    if not bool(known.any()):
        return 0.0
    along = s @ vectors[:, known]
    tau = float((along.square().sum(0) / values[known]).mean())
    if not (math.isfinite(tau) and tau > 0):
        return 0.0
    Q, rank = D.T @ D, len(D)
    best, weight = -math.inf, 0.0
    for exponent in torch.linspace(math.log(LEAST), math.log(MOST), COUNT).tolist():
        value = math.exp(exponent)
        precision, slope = H / tau + value * Q, g / tau + value * (Q @ theta)
        factor, fault = torch.linalg.cholesky_ex(precision)
        if int(fault):
            continue
        delta = -torch.cholesky_solve(slope[:, None], factor)[:, 0]
        misfit = value * theta @ Q @ theta + delta @ slope
        evidence = rank * exponent - 2 * float(factor.diagonal().log().sum()) - float(misfit)
        if evidence > best:
            best, weight = evidence, tau * value
    return weight
