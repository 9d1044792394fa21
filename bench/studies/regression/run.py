r"""The yardstick without a network: smooth the velocity, differentiate it, regress on the momentum.

python -m bench.studies.regression.run FLOW.h5 ... --noise 0.02 --json regression.json

    rho (dv/dt + v.grad v - g) + grad p = mu_s div T_s + mu_2 div T_2,
    T_s = 2 (1 - phi) p D / gamma_dot,  T_2 = 2 phi p D / gamma_dot,  phi = I / (I + I0)

is linear in mu_s and mu_2: a robust regression where the grains flow, with (a) the true pressure of
the file and (b) the pressure integrated from the free surface down with the vertical momentum,
where stress and coefficients are those of the iteration before. Derivatives are differences
on the grid of the file, of velocities smoothed by Gaussians of several widths (0: not at all).
Defends: an identification by the network is better than what differences can do with the same file.
"""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.ndimage import binary_erosion, gaussian_filter

from bench.studies import raw
from bench.studies.simulator_validation.balance import Balance, regression
from granpinn.data import Flow, add_noise, read_flow
from granpinn.data.norms import relative_l2
from granpinn.data.scaling import scales_of
from granpinn.fit.scoring import difference

Array = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

FLOWING = 0.45  # shear rate above which the regression is done, in sqrt(g / H0)
ITERATIONS = 12  # of the pressure
KEPT = 0.5  # of the stress of the iteration before
START = (0.3, 0.6)
REACH = 2  # cells that a second difference looks away
WIDTHS = (0.0, 0.7, 1.5, 3.0)


class Kinematics(NamedTuple):
    """What the velocity says [T, Y, X], NaN outside of the grains.

    a_x, a_y: acceleration less gravity; D_1 = D_xx = -D_yy and D_2 = D_xy.
    """

    a_x: Array
    a_y: Array
    D_1: Array
    D_2: Array
    gamma_dot: Array


class Grid(NamedTuple):
    dt: float
    dy: float
    dx: float


def grid_of(flow: Flow) -> Grid:
    return Grid(*(float(np.median(np.diff(axis))) for axis in (flow.t, flow.y, flow.x)))


def smooth(values: Array, width: float) -> Array:
    """Gaussian mean over the valid points around, in frames and cells; NaN stays NaN."""
    valid = np.isfinite(values)
    if width == 0:
        return values
    total = gaussian_filter(np.where(valid, values, 0.0), width)
    share = gaussian_filter(valid.astype(np.float64), width)
    result: Array = np.where(valid, total / np.maximum(share, 1e-12), np.nan)
    return result


def kinematics(flow: Flow, width: float) -> Kinematics:
    """Acceleration and strain rate of the smoothed velocity."""
    valid, (dt, dy, dx) = flow.valid, grid_of(flow)
    u, v = (smooth(np.where(valid, f, np.nan).astype(np.float64), width) for f in (flow.u, flow.v))
    (u_t, u_y, u_x), (v_t, v_y, v_x) = (
        [difference(f, spacing, axis) for axis, spacing in enumerate((dt, dy, dx))] for f in (u, v)
    )
    D_1, D_2 = 0.5 * (u_x - v_y), 0.5 * (u_y + v_x)
    return Kinematics(
        u_t + u * u_x + v * u_y - flow.gravity[0],
        v_t + u * v_x + v * v_y - flow.gravity[1],
        D_1,
        D_2,
        2 * np.hypot(D_1, D_2) + 1e-12,
    )


def stress_parts(k: Kinematics, p: Array, flow: Flow, I0: float) -> tuple[Array, Array]:
    """div T_s and div T_2, each [T, Y, X, 2]."""
    _, dy, dx = grid_of(flow)
    positive = np.maximum(p, 1e-12)
    I = flow.grain_diameter * k.gamma_dot / np.sqrt(positive / flow.density)
    phi = I / (I + I0)

    def force(share: Array) -> Array:
        T_1, T_2 = (2 * share * positive * D / k.gamma_dot for D in (k.D_1, k.D_2))
        along = difference(T_1, dx, 2) + difference(T_2, dy, 1)
        return np.stack([along, difference(T_2, dx, 2) - difference(T_1, dy, 1)], -1)

    return force(1 - phi), force(phi)


def balance(k: Kinematics, p: Array, flow: Flow, I0: float, threshold: float) -> Balance:
    """The momentum balance where all neighbours are grains; the residual is not used."""
    _, dy, dx = grid_of(flow)
    div_s, div_2 = stress_parts(k, p, flow, I0)
    rest = flow.density * np.stack([k.a_x, k.a_y], -1)
    rest += np.stack([difference(p, dx, 2), difference(p, dy, 1)], -1)
    whole = np.ones((3, 2 * REACH + 1, 2 * REACH + 1), bool)
    inside = binary_erosion(flow.valid, whole)
    inside &= np.isfinite(rest + div_s + div_2).all(axis=-1)
    # In the form of simulator_validation/balance.py: mu_s A + (mu_2 - mu_s) B.
    A, B = (div_s + div_2)[inside], div_2[inside]
    flowing = k.gamma_dot[inside] > threshold
    return Balance(rest[inside], A, B, np.zeros(len(A)), flowing)


def pressure(k: Kinematics, flow: Flow, friction: Array) -> Array:
    """p [T, Y, X] from the surface down: dp/dy = (div tau)_y - rho (Dv/Dt - g)_y.

    Cells that hold some grains weigh as much of the air-free weight as they hold.
    """
    _, dy, _ = grid_of(flow)
    full = np.nan_to_num(flow.density * k.a_y) - np.nan_to_num(friction)
    weight = np.where(flow.valid & np.isfinite(k.a_y), full, -flow.density * flow.gravity[1])
    load = weight * flow.c * dy
    above = np.cumsum(load[:, ::-1], axis=1)[:, ::-1] - load / 2
    return np.where(flow.valid, np.maximum(above, 0.0), np.nan)


def identify(flow: Flow, width: float, with_pressure: bool) -> dict[str, Any]:
    """mu_s and mu_2 with the pressure of the file, or without."""
    begin = time.monotonic()
    I0 = (flow.truth.I0 if flow.truth else None) or 0.3
    threshold = FLOWING / scales_of(flow).time
    k = kinematics(flow, width)
    found = START
    if with_pressure:
        assert flow.p is not None
        p = np.where(flow.valid, flow.p, np.nan).astype(np.float64)
        found = regression(balance(k, p, flow, I0, threshold))
    else:
        friction = np.zeros(k.a_y.shape)
        for _ in range(ITERATIONS):
            p = pressure(k, flow, friction)
            found = regression(balance(k, p, flow, I0, threshold))
            found = (min(max(found[0], 0.01), 2.0), min(max(found[1], found[0]), 4.0))
            div_s, div_2 = stress_parts(k, p, flow, I0)
            new = (found[0] * div_s + found[1] * div_2)[..., 1]
            friction = KEPT * friction + (1 - KEPT) * np.nan_to_num(new)
    row: dict[str, Any] = {
        "pressure": "true" if with_pressure else "integrated",
        "width": width,
        "mu_s": found[0],
        "mu_2": found[1],
        "seconds": time.monotonic() - begin,
    }
    if flow.p is not None and not with_pressure:
        late = flow.valid & (flow.t > 0)[:, None, None]
        row["error_p_percent"] = relative_l2(p[late], flow.p[late])
    if flow.truth is not None and flow.truth.mu_s and flow.truth.mu_2:
        row["error_mu_s_percent"] = 100 * (found[0] / flow.truth.mu_s - 1)
        row["error_mu_2_percent"] = 100 * (found[1] / flow.truth.mu_2 - 1)
    return row


def line(row: dict[str, Any]) -> str:
    errors = (row.get(f"error_{name}_percent", math.nan) for name in ("mu_s", "mu_2", "p"))
    return (
        f"{row['flow']:<28}{row['noise']:6.2f}{row['pressure']:>12}{row['width']:6.1f}"
        f"{row['mu_s']:9.4f}{row['mu_2']:9.4f}{''.join(f'{e:10.2f}' for e in errors)}"
        f"{row['seconds']:8.1f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("flows", type=Path, nargs="+")
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0], metavar="SD")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--widths", type=float, nargs="+", default=list(WIDTHS), help="sd in frames and cells"
    )
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    head = f"{'flow':<28}{'noise':>6}{'pressure':>12}{'width':>6}{'mu_s':>9}{'mu_2':>9}"
    print(f"{head}{'mu_s %':>10}{'mu_2 %':>10}{'p %':>10}{'s':>8}")
    rows = []
    for path in options.flows:
        clean = read_flow(path)
        for sd in options.noise:
            flow = add_noise(clean, sd, options.seed)
            for with_pressure in (True, False) if clean.p is not None else (False,):
                for width in options.widths:
                    row = {"flow": path.name, "noise": sd}
                    rows.append(row | identify(flow, width, with_pressure))
                    print(line(rows[-1]), flush=True)
    raw.write(options.json, {"rows": rows})


if __name__ == "__main__":
    main()
