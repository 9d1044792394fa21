"""A friction law: a curve mu(I) with named parameters.

A law is one header in csrc/math/laws/ and one module here. Everything else asks the law for the
names, the bounds, the start and the number of its parameters, and for its curve.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal, Self

import numpy as np

from granpinn.arrays import Float64, plain_array

Values = Any  # a number, a NumPy array or a torch tensor
Curve = Callable[..., Values]  # (I, *parameters) -> values of the shape of I
Variable = Literal["log", "log_above", "logistic"]


@dataclass(frozen=True)
class LawParameter:
    """One parameter theta_k of a friction law.

    Attributes:
        name: in files, settings and results, such as "mu_s".
        symbol: in LaTeX, such as r"\\mu_s".
        start: value at the start of a training.
        variable: what an optimiser moves instead, an unbounded number q:
            "log": theta_k = exp(q); "log_above": theta_k = theta_(k-1) + exp(q);
            "logistic": theta_k = 1 / (1 + exp(-q)).
        bounds: of exp(q) for "log" and "log_above", so that a wild early step is not final.
        fixed: held at a given value unless the user asks for more.
        typical: of the paper's collapse; simulations and inspections use it by default.
        may_vanish: whether a material can have the value 0.
        quantile: a fixed parameter is this quantile of I in the flow, where the user gives none.
        help: its description.
    """

    name: str
    symbol: str
    start: float
    variable: Variable = "log"
    bounds: tuple[float, float] = (0.01, 3.0)
    fixed: bool = False
    typical: float = 0.4
    may_vanish: bool = False
    quantile: float | None = None
    help: str = ""


@dataclass(frozen=True)
class FrictionLaw:
    """A friction law mu(I; theta).

    Attributes:
        name: in settings and results, such as "mu_of_i"; that of its C++ header too.
        title: in sentences and figures, such as "mu(I)".
        formula: in LaTeX.
        parameters: theta, in the order of the C++ header.
        friction: mu at (I, *theta).
        slope: I dmu/dI at (I, *theta).
        inertial_scale: name of the parameter that is the I at which the curve bends, if any.
        cohesion: name of the parameter c of the yield stress c + mu(I) p, if any. c is a stress: it
            has the unit of the pressure of the flow file; its start, bounds and typical value
            are in units of rho |g| H (physics/scales.py).
        compiled: whether kernels and simulator have it (csrc/math/laws); others run in torch.
        curve: names of coefficients along ln I whose second differences are small for a smooth
            curve, if any.
    """

    name: str
    title: str
    formula: str
    parameters: tuple[LawParameter, ...]
    friction: Curve
    slope: Curve
    inertial_scale: str | None = None
    curve: tuple[str, ...] = ()
    cohesion: str | None = None
    compiled: bool = True

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters, in order."""
        return tuple(p.name for p in self.parameters)

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the parameters that are identified by default, in order."""
        return tuple(p.name for p in self.parameters if not p.fixed)

    def with_free(self, values: Mapping[str, float]) -> Self:
        """The law whose parameters of these names are free, too, with their start values."""
        made = (
            replace(p, fixed=False, start=values[p.name]) if p.name in values else p
            for p in self.parameters
        )
        return replace(self, parameters=tuple(made)) if values else self

    @property
    def quantiles(self) -> dict[str, float]:
        """Names of the parameters that are a quantile of I in the flow, with their levels."""
        return {p.name: p.quantile for p in self.parameters if p.quantile is not None}

    def parameter(self, name: str) -> LawParameter:
        """The parameter of that name; KeyError where the law has none."""
        for p in self.parameters:
            if p.name == name:
                return p
        raise KeyError(f"the law {self.name} has the parameters {', '.join(self.names)}: {name}?")

    def complete(self, given: Sequence[float | None]) -> tuple[float, ...]:
        """theta with typical values in the place of None.

        Raises:
            ValueError: a value is impossible; one sentence.
        """
        theta: list[float] = []
        for p, value in zip(self.parameters, given, strict=True):
            theta.append(p.typical if value is None else value)
            if not math.isfinite(theta[-1]) or theta[-1] < 0 or not (theta[-1] or p.may_vanish):
                wanted = "not be negative" if p.may_vanish else "be a positive number"
                raise ValueError(f"{p.name} must {wanted}, got {theta[-1]}")
            if p.variable == "log_above" and theta[-1] < theta[-2]:
                least = f"{self.names[len(theta) - 2]} = {theta[-2]}"
                raise ValueError(f"{p.name} must be at least {least}, got {theta[-1]}")
        self.check_range(dict(zip(self.names, theta, strict=True)))
        return tuple(theta)

    def check_range(self, values: Mapping[str, float]) -> None:
        """Refuses quantiles of I (`LawParameter.quantile`) that are not ascending: ValueError."""
        for low, high in pairwise(self.quantiles):
            if values[high] <= values[low]:
                raise ValueError(f"{high} must be above {low} = {values[low]}, got {values[high]}")

    def cohesion_of(self, theta: Values) -> Values:
        """c of the yield stress c + mu(I) p, in the unit of theta; 0 for laws without cohesion."""
        return theta[self.names.index(self.cohesion)] if self.cohesion else 0.0

    def to_physical(self, theta: Sequence[float], pressure: float) -> list[float]:
        """theta [N] of a training in the units of the flow file.

        Args:
            pressure: the unit of the pressure (`granpinn.physics.scales.Scales`).
        """
        named = zip(self.names, theta, strict=True)
        return [value * pressure if name == self.cohesion else value for name, value in named]

    def admits(self, theta: Sequence[float]) -> bool:
        """Whether all parameters are positive and each "log_above" exceeds the one before it."""
        before = (0.0, *theta)
        return all(
            value > (before[k] if p.variable == "log_above" else 0)
            for k, (p, value) in enumerate(zip(self.parameters, theta, strict=True))
        )

    def ill_posedness(self, I: Values, theta: Sequence[Values]) -> Values:
        """C(I), positive where the equations of the law are ill-posed, of the shape of I.

        There the shortest waves grow fastest. C = 4 a^2 - 4 a + mu^2 (1 - a/2)^2 with
        a = I mu'(I) / mu(I) (Barker, Schaeffer, Bohorquez, Gray, J. Fluid Mech. 779, 2015).
        """
        mu = self.friction(I, *theta)
        a = self.slope(I, *theta) / mu
        return 4 * a**2 - 4 * a + mu**2 * (1 - a / 2) ** 2

    def by_parameters(self, I: Float64, theta: Sequence[float] | Float64) -> Float64:
        """d mu / d theta at inertial numbers I [n], for all N parameters: [n, N]."""
        import torch  # slow to import

        rows = torch.tensor(theta, dtype=torch.float64).repeat(len(I), 1).requires_grad_()
        mu = self.friction(torch.as_tensor(I), *rows.unbind(1))
        (found,) = torch.autograd.grad(mu.sum(), rows)  # value k depends on row k alone
        return np.asarray(found.numpy())


LEAST_I = 1e-30
"""Added to an inertial number of which the logarithm is taken (csrc/math/scalar.h)."""


def together(*values: Any) -> tuple[Any, ...]:
    """The library, numpy or torch, and the values as its arrays.

    Torch where a value is a tensor; then all have its type and device.
    """
    torch = sys.modules.get("torch")  # not loaded: no value is a tensor
    tensor = torch and next((v for v in values if isinstance(v, torch.Tensor)), None)
    if torch is None or tensor is None:
        return (np, *(plain_array(v, "a value").astype(np.float64)[()] for v in values))
    dtype, device = tensor.dtype, tensor.device
    return (torch, *(torch.as_tensor(v, dtype=dtype, device=device) for v in values))
