"""Taylor jets written by hand, for any array library: shared by the rivals in torch and JAX.

A jet is the list of channels [value, x, y, t] of an array, in the strong form also [xx, xy, yy].
The loss is the one of `bench.steps`. Functions of the library (`sqrt`, `sigmoid`) are arguments.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bench.steps import G_X, G_Y, SMOOTHING, P, U

Array = Any
Function = Callable[[Array], Array]
SECOND = ((1, 1), (1, 2), (2, 2))


def swish(z: list[Array], sigmoid: Function) -> list[Array]:
    """swish of a jet."""
    s = sigmoid(z[0])
    q = s * (1 - s)
    f1 = s + z[0] * q
    a = [z[0] * s] + [f1 * z_i for z_i in z[1:4]]
    if len(z) > 4:
        f2 = q * (2 + z[0] * (1 - 2 * s))
        a += [f2 * z[i] * z[j] + f1 * z_ij for (i, j), z_ij in zip(SECOND, z[4:], strict=True)]
    return a


def strong(
    jet: list[Array],
    viscosity: Callable[[Array, Array], tuple[Array, Array, Array]],
    sqrt: Function,
) -> list[Array]:
    """Residuals of the strong form from raw outputs.

    Args:
        viscosity: (gamma_dot, p) -> eta and its derivatives by both.
    """
    u, u_x, u_y, u_t, u_xx, u_xy, u_yy = (U * c[:, 0] for c in jet)
    v, v_x, v_y, v_t, v_xx, v_xy, v_yy = (U * c[:, 1] for c in jet)
    p, p_x, p_y = (P * c[:, 2] for c in jet[:3])
    shear = u_y + v_x
    gamma_dot = sqrt(2 * u_x**2 + 2 * v_y**2 + shear**2 + SMOOTHING)
    gamma_x = (2 * u_x * u_xx + 2 * v_y * v_xy + shear * (u_xy + v_xx)) / gamma_dot
    gamma_y = (2 * u_x * u_xy + 2 * v_y * v_yy + shear * (u_yy + v_xy)) / gamma_dot
    eta, by_gamma, by_p = viscosity(gamma_dot, p)
    eta_x, eta_y = by_gamma * gamma_x + by_p * p_x, by_gamma * gamma_y + by_p * p_y
    div_x = eta * (2 * u_xx + u_yy + v_xy) + 2 * eta_x * u_x + eta_y * shear
    div_y = eta * (v_xx + u_xy + 2 * v_yy) + eta_x * shear + 2 * eta_y * v_y
    return [
        u_t + u * u_x + v * u_y + p_x - div_x - G_X,
        v_t + u * v_x + v * v_y + p_y - div_y - G_Y,
        u_x + v_y,
    ]


def mixed(
    jet: list[Array],
    friction: Callable[[Array, Array], Array],
    sqrt: Function,
    sigmoid: Function,
    softplus: Function,
) -> list[Array]:
    """Residuals of the mixed form from raw outputs.

    Args:
        friction: (gamma_dot, p) -> mu(I).
    """
    u, u_x, u_y, u_t = (U * c[:, 0] for c in jet)
    v, v_x, v_y, v_t = (U * c[:, 1] for c in jet)
    slope = P * sigmoid(jet[0][:, 2])
    p, p_x, p_y = P * softplus(jet[0][:, 2]), slope * jet[1][:, 2], slope * jet[2][:, 2]
    s1, s1_x, s1_y, _ = (c[:, 3] for c in jet)
    s2, s2_x, s2_y, _ = (c[:, 4] for c in jet)
    two_D_1, two_D_2 = u_x - v_y, u_y + v_x
    gamma_dot = sqrt(two_D_1**2 + two_D_2**2 + SMOOTHING)
    rate = gamma_dot / friction(gamma_dot, p)
    return [
        u_t + u * u_x + v * u_y + p_x - p_x * s1 - p * s1_x - p_y * s2 - p * s2_y - G_X,
        v_t + u * v_x + v * v_y + p_y - p_x * s2 - p * s2_x + p_y * s1 + p * s1_y - G_Y,
        u_x + v_y,
        rate * s1 - two_D_1,
        rate * s2 - two_D_2,
    ]
