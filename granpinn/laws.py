r"""Friction laws of your own, in plain torch.

    def mu(I, theta):
        mu_s, rise, scale = theta
        return mu_s + rise * (1 - torch.exp(-I / scale))

    law = granpinn.laws.Law("exponential", mu, [Parameter("mu_s", 0.3), ...])
    result = granpinn.identify(flow, law=law)

The training is that of the other laws, in the mixed form: kernels give the network and its
derivatives, and torch gives the equations and their gradient (granpinn/training/operators.py).
docs/guides/own-law.md is the guide.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import torch
from torch import Tensor

from granpinn.declared import checked
from granpinn.errors import BadInput
from granpinn.physics.laws import LAWS, FrictionLaw, LawParameter
from granpinn.physics.laws.law import Values, together

Friction = Callable[[Tensor, Sequence[Tensor]], Tensor]

# The kernels update the parameters of a law, and have room for those of the largest one.
MOST_PARAMETERS = max(len(law.parameters) for law in LAWS.values())
TRIED = (0.0, 1e-30, 1e-3, 0.1, 1.0, 10.0)  # inertial numbers at which a new law is tried


class LawError(BadInput):
    """A friction law cannot be used; the message is one sentence."""


class Law(FrictionLaw):
    """A friction law mu(I; theta) in torch.

    Args:
        name: in settings and results, such as "exponential".
        mu: friction at inertial numbers I [n] for theta, a tuple with one tensor [n] for each
            parameter: [n]. It is made of torch operations alone, and is positive and finite at
            every I >= 0, with finite derivatives. Numbers that are known stand in it as constants.
        parameters: the unknowns, in the order of theta.
        title: in sentences and figures; by default the name.
        formula: in LaTeX.

    Raises:
        LawError: the law cannot be used, with the reason.
    """

    @checked
    def __init__(
        self,
        name: str,
        mu: Friction,
        parameters: Sequence[LawParameter],
        title: str = "",
        formula: str = "",
    ) -> None:
        super().__init__(
            name=name,
            title=title or name,
            formula=formula,
            parameters=tuple(parameters),
            friction=partial(_friction, mu),
            slope=partial(_slope, mu),
            compiled=False,
        )
        _require_names(self)
        _try(self, mu)


@checked
def Parameter(
    name: str,
    start: float,
    bounds: tuple[float, float] = (0.01, 3.0),
    *,
    above: bool = False,
    symbol: str = "",
) -> LawParameter:
    """One unknown of a law of your own, a positive number.

    Args:
        start: its value at the start of a training.
        bounds: between which it stays; with `above`, of its distance from the one before it.
        above: whether it exceeds the parameter before it, as mu_2 exceeds mu_s.
        symbol: in LaTeX, by default the name.

    Raises:
        LawError: the bounds are no range.
    """
    if len(bounds) != 2 or not 0 < bounds[0] < bounds[1] < float("inf"):
        raise LawError(
            f"the bounds of {name} must be two numbers, positive and ascending, got {bounds}"
        )
    return LawParameter(
        name=name,
        symbol=symbol or rf"\mathrm{{{name}}}".replace("_", r"\_"),
        start=start,
        variable="log_above" if above else "log",
        bounds=bounds,
        typical=start,
        help=f"parameter of a law of your own, {name}",
    )


@checked
def register(law: FrictionLaw) -> None:
    """Make a law known by its name: to `Config(law=NAME)` and to `read_results`.

    `granpinn.identify(flow, law=law)` does it. A law of your own replaces an earlier one of its
    name.

    Raises:
        LawError: granpinn has a law of that name.
    """
    known = LAWS.get(law.name)
    if known is not None and known.compiled and known is not law:
        raise LawError(f"{law.name} is a law of granpinn: give your law another name")
    LAWS[law.name] = law


def _friction(mu: Friction, I: Values, *theta: Values) -> Values:
    return _in_torch(lambda at, values: _spread(mu(at, values), at, values), I, theta)


def _slope(mu: Friction, I: Values, *theta: Values) -> Values:
    """I dmu/dI, without a graph."""

    def slope(at: Tensor, values: tuple[Tensor, ...]) -> Tensor:
        with torch.enable_grad():
            i = _spread(at, at, values).detach().requires_grad_()
            value = _spread(mu(i, values), i, values) + 0 * i  # a friction may be without I
            (derivative,) = torch.autograd.grad(value.sum(), i)
        return i.detach() * derivative

    return _in_torch(slope, I, theta)


def _spread(mu: Tensor, I: Tensor, theta: tuple[Tensor, ...]) -> Tensor:
    """Values in the shape of I and theta: a friction without I may have fewer axes."""
    return mu.expand(np.broadcast_shapes(mu.shape, I.shape, *(value.shape for value in theta)))


def _in_torch(
    work: Callable[[Tensor, tuple[Tensor, ...]], Tensor],
    I: Values,
    theta: tuple[Values, ...],
) -> Values:
    """`work` on tensors; numbers and NumPy arrays become tensors, and its result a NumPy array."""
    library, at, *values = together(I, *theta)
    if library is torch:
        return work(at, tuple(values))
    with torch.no_grad():
        at, *values = map(torch.as_tensor, (at, *values))
        return work(at, tuple(values)).numpy()


def _require_names(law: Law) -> None:
    names = law.names
    if not law.name.isidentifier():
        raise LawError(f"the name of a law must be one word of letters, digits and _: {law.name!r}")
    if not 1 <= len(names) <= MOST_PARAMETERS:
        raise LawError(
            f"the law {law.name} must have 1 to {MOST_PARAMETERS} parameters, got {len(names)}: "
            "write known numbers into mu"
        )
    if len(set(names)) < len(names) or not all(name.isidentifier() for name in names):
        raise LawError(
            f"the parameters of the law {law.name} must have different names, each one word, got "
            f"{', '.join(names)}"
        )
    if any(p.fixed for p in law.parameters) or law.parameters[0].variable == "log_above":
        raise LawError(
            f"the parameters of the law {law.name} must be free, and the first one has none before "
            "it that it could be above: write known numbers into mu"
        )
    if not law.admits([p.start for p in law.parameters]):
        starts = ", ".join(f"{p.name} = {p.start}" for p in law.parameters)
        raise LawError(f"the law {law.name} cannot start at {starts}")


def _try(law: Law, mu: Friction) -> None:
    """Refuse a law that has no finite friction and derivatives at its start values."""
    I = torch.tensor(TRIED, requires_grad=True)
    theta = tuple(torch.full((len(TRIED),), p.start, requires_grad=True) for p in law.parameters)
    where = f"mu of the law {law.name} at I = {', '.join(f'{i:g}' for i in TRIED)}"
    try:
        found = mu(I, theta)
        value = law.friction(I, *theta)
        slopes = [law.slope(I, *theta)]
        slopes += torch.autograd.grad(value.sum(), (I, *theta), materialize_grads=True)
    except Exception as error:  # code of a user: any error is a reason
        reason = " ".join(str(error).split())
        raise LawError(f"{where} failed: {type(error).__name__}: {reason}") from error
    if not isinstance(found, Tensor) or value.shape != I.shape:
        raise LawError(f"{where} must be one number for each I, as a tensor, got {found!r}")
    if not (torch.isfinite(value).all() and (value > 0).all()):
        raise LawError(f"{where} must be positive and finite, got {value.tolist()}")
    if not all(torch.isfinite(slope).all() for slope in slopes):
        raise LawError(
            f"{where} must have finite derivatives by I and theta: mend the one at I = 0"
        )


__all__ = ["MOST_PARAMETERS", "Law", "LawError", "LawParameter", "Parameter", "register"]
