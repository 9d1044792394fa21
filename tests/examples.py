"""A result, the fields of a flow and tiny networks, made up for tests: nothing is trained."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import torch

from granpinn.checks.momentum_balance import Difference, MomentumBalance
from granpinn.data import Flow, Truth
from granpinn.data.flow import Units
from granpinn.data.scaling import scales_of
from granpinn.data.symmetry import axes_of
from granpinn.fit.network import TrainedNetwork
from granpinn.inspection.momentum_balance import Baseline, Point
from granpinn.kernels.network import OUTPUTS, NetworkSpec, initial_parameters
from granpinn.physics.constants import Physics
from granpinn.physics.laws import DEFAULT
from granpinn.results import (
    Covariance,
    DataSummary,
    ErrorPercent,
    Fields,
    Input,
    Parameter,
    Parameters,
    Residuals,
    Result,
    Timing,
)
from granpinn.results.records import Curve, ErrorBars, IdentifiedLaw, Members, StressPoints

PARAMETERS = Parameters(
    mu_s=Parameter(0.41, fixed=False, std=0.012, interval_90=(0.39, 0.43)),
    mu_2=Parameter(0.61, fixed=False),
    I0=Parameter(0.3, fixed=True),
)
BASELINE = Baseline(
    points=(Point(0.01, 0.41, 0.01, 40), Point(0.06, 0.44, 0.01, 40), Point(0.2, 0.5, 0.01, 40)),
    mean=Point(0.05, 0.43, 0.01, 120),
    window=2,
    parts={"scatter": 0.01, "window": 0.0, "depth": 0.01, "model": 0.02},
)
BALANCE = MomentumBalance(BASELINE, (Difference(0.05, 1.5, 2.5),))
LAW = IdentifiedLaw(
    "mu_of_i",
    (0.01, 0.2),
    Curve((0.01, 0.045, 0.2), (0.42, 0.44, 0.49), (0.4, 0.42, 0.46), (0.44, 0.46, 0.52)),
    StressPoints((0.02, 0.1), (0.42, 0.46), (0.4, 0.43), (0.44, 0.5), (40, 50)),
)
# Changes that leave everything unknown that may be.
SPARSE: dict[str, Any] = {
    "truth": None,
    "covariance": None,
    "members": None,
    "residuals": None,
    "error_bars": None,
    "checks": {},
    "law": IdentifiedLaw(),
    "error_percent": ErrorPercent(),
    "settings": {},
}


def make_result(**changes: Any) -> Result:
    """A result with something in every field."""
    result = Result(
        parameters=PARAMETERS,
        level="V1",
        form="mixed",
        recipe="default",
        seed=7,
        data=DataSummary(n_points=1234, n_surface=56, noise=0.05, n_frames=12),
        timing=Timing(wall_s=1 / 3, steps=4000),
        device="cpu",
        versions={"python": "3.11.7", "torch": "2.11.0"},
        input=Input(name="Säule µ.h5", sha256="ab" * 32),
        law=LAW,
        settings={"network": {"widths": [40, 40], "units": "file"}, "max_time": None},
        stopped="max_time",
        truth=Truth(mu_s=0.4, mu_2=0.64, I0=0.3),
        error_percent=ErrorPercent(mu_s=2.5, mu_2=4.6875, velocity=0.8, pressure=4.0),
        covariance=Covariance(("mu_s", "mu_2"), ((1.44e-4, -1e-5), (-1e-5, 4e-4))),
        members=Members(
            (7, 11, 13),
            {"mu_s": (0.4, 0.41, 0.5), "mu_2": (0.6, 0.61, 0.7)},
            1,
            1,
        ),
        residuals=Residuals(
            velocity=0.004,
            noise=0.002,
            surface=1e-4,
            momentum=0.01,
            continuity=0.02,
            constitutive=0.03,
        ),
        error_bars=ErrorBars((0.011, 0.017), 8.0, 1.86, "made up", (0.008, 0.02), (0.004, 0.01)),
        checks={"momentum_balance": BALANCE},
    )
    return replace(result, **changes)


def residuals_with(
    velocity: float, noise: float = 0.0, momentum: float = 1.0, constitutive: float = 1.0
) -> Residuals:
    """Residuals of a training; those that no test changes are small."""
    return Residuals(
        velocity=velocity,
        noise=noise,
        surface=1e-4,
        momentum=momentum,
        continuity=0.01,
        constitutive=constitutive,
    )


def make_fields(flow: Flow, **values: Any) -> Fields:
    """The known fields of a flow beside predicted ones; `values` replaces some, a number or [K].

    Predicted are, unless replaced, the known velocity and pressure themselves, D2 = 1 and I = 0.1.
    """
    inside = flow.material
    scales = scales_of(flow)
    known = {"u": flow.u[inside], "v": flow.v[inside]}
    if flow.p is not None:
        known["p"] = flow.p[inside]
    found = known | {"D2": 1.0, "I": 0.1} | values
    found |= {f"{name}_reference": value for name, value in known.items()}
    n = int(inside.sum())
    return Fields(
        t=flow.t,
        y=flow.y,
        x=flow.x,
        c=flow.c,
        values={k: np.broadcast_to(f, n).astype(np.float32) for k, f in found.items()},
        units=Units(flow.length_unit, flow.time_unit),
        length=scales.length,
        time=scales.time,
        pressure=scales.pressure,
    )


def make_network(form: str, flow: Flow, seed: int = 0) -> TrainedNetwork:
    """A tiny network of a flow, float64; both limits of the viscosity bind at some points."""
    spec = NetworkSpec((3, 6, 5, OUTPUTS[form]), (0.5, 0.4, 0.3), (1.1, 1.3, 0.9), form)
    theta = torch.tensor([0.4, 0.64, 0.3], dtype=torch.float64)
    physics = Physics(0.05, 0.1, -0.99, 0.01, 0.5, 0.7, 0.9, 1e-4, 1.5, 0.4, 0.2)
    params, scales = initial_parameters(spec, seed), scales_of(flow)
    units = flow.units
    return TrainedNetwork(spec, physics, params, theta, scales, DEFAULT, axes_of(flow), units)
