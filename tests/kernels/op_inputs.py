"""Valid inputs of every operator: the table that opcheck and the hostile calls run through.

`INPUTS[operator]` holds functions that make the arguments, by name. A test requires a row for every
operator of the namespace `granpinn`.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Any

import torch
from torch import Tensor
from torch.utils._pytree import tree_map_only

from granpinn.physics.laws import LAWS

from . import step_inputs
from .configurations import SHARED, Form, Problem, problem, small

LAW = (0.02, 1e-3, 1e3, 1e-4)
OWN = {name: [p.typical for p in law.parameters] for name, law in LAWS.items()}
CHANNELS = {0: 1, 1: 4, 2: 7}

Arguments = tuple[Any, ...]
Make = Callable[[], Arguments]
FLOATS = (torch.float64, torch.float32)


def tiny(form: Form = "mixed", **changes: Any) -> Problem:
    return problem(small(form, **({"points": 5, "hidden": (6, 4)} | changes)))


def learning(case: Problem) -> Problem:
    return case._replace(params=case.params.requires_grad_(), theta=case.theta.requires_grad_())


def strided(tensor: Tensor) -> Tensor:
    """The same values with gaps between them, last axis not contiguous."""
    wide = tensor.new_zeros(*tensor.shape[:-1], 2 * tensor.shape[-1])
    wide[..., ::2] = tensor
    return wide[..., ::2]


def with_gaps(case: Problem) -> Problem:
    gaps: Problem = tree_map_only(Tensor, strided, case)
    return gaps


# Changes of `tiny` that make each kind of problem.
KINDS: dict[str, dict[str, Any]] = {
    "plain": {},
    "no points": {"points": 0},
    "one point": {"points": 1},
    "more points than a tile": {"points": 33},
    "no hidden layer": {"hidden": ()},
    "ensemble": {"members": 3},
    "shared points": {"members": 2, "index": SHARED},
}
LAW_KINDS = {f"the law {name}": {"law": name} for name in LAWS}


def jets(kind: str, order: int) -> Arguments:
    """Odd orders in float32; every other kind learns; plain ones have gaps in order 1."""
    case = tiny(**KINDS[kind])
    case = case.to(torch.float32) if order == 1 else learning(case)
    case = with_gaps(case) if kind == "plain" and order == 1 else case
    return (*case.network, order)


def jet_backward(case: Problem, order: int) -> Arguments:
    """The adjoint of a jet with an adjoint of ones."""
    points, params, widths, *scaling = case.network
    shape = (*params.shape[:-1], CHANNELS[order], points.shape[-2], widths[-1])
    grad = torch.ones(*shape, dtype=params.dtype)
    return (grad, points.detach(), params.detach(), widths, *scaling, order)


def jet_adjoints(kind: str, order: int) -> Arguments:
    """Odd orders in float32; one point has gaps."""
    case = tiny(**KINDS[kind])
    grad, *rest = jet_backward(case.to(torch.float32) if order == 1 else case, order)
    return (strided(grad) if kind == "one point" else grad, *rest)


def operands(case: Problem, precision: str = "fp32", equations: bool = True) -> dict[str, Any]:
    """The arguments of the operator residual_loss, in the order of its schema."""
    points, spec = case.batch._asdict(), case.spec
    source = points.pop("source")
    numbers = {"input_shift": spec.input_shift, "input_scale": spec.input_scale}
    numbers["physics"] = case.physics
    return {
        "params": case.params,
        "theta": case.theta,
        **points,
        "term_weights": case.term_weights,
        "widths": list(spec.widths),
        **{name: case.params.new_tensor(values) for name, values in numbers.items()},
        "form": spec.form if equations else "data",
        "law": case.law,
        "precision": precision,
        "source": source,
    }


def losses(kind: str, form: str, source: str = "") -> Arguments:
    sourced = {"source": bool(source)}
    case = tiny("strong" if form == "strong" else "mixed", **sourced, **(KINDS | LAW_KINDS)[kind])
    case = case.to(torch.float32) if kind == "one point" else learning(case)
    if kind == "plain" and form == "mixed":
        case = with_gaps(tiny(**sourced))
    if kind == "no points" and form != "mixed":
        case = case.part(0, 0)  # nothing at all
    precision = "fast" if kind == "shared points" else "fp32"
    return tuple(operands(case, precision, form != "data").values())


def flow(
    n: int, dtype: torch.dtype = torch.float64, law: str = "mu_of_i", learn: bool = False
) -> Arguments:
    gamma_dot, p = (torch.linspace(a, 2, n, dtype=dtype) for a in (0.5, 0.25))
    theta = torch.tensor(OWN[law], dtype=dtype)
    return (*(x.requires_grad_(learn) for x in (gamma_dot, p, theta)), law, *LAW)


def viscosities(n: int, dtype: torch.dtype, law: str, learn: bool) -> Arguments:
    case = flow(n, dtype, law, learn)
    return case if learn or n != 7 else (*(strided(x) for x in case[:3]), *case[3:])


def raw_jets(form: Form, N: int, K: int, dtype: torch.dtype = torch.float64) -> Arguments:
    case = tiny(form)
    C = 7 if form == "strong" else 4
    values = torch.linspace(-1, 1, C * N * K, dtype=dtype).reshape(C, N, K)
    theta = case.theta.to(dtype)
    return (strided(values) if N == 3 else values, theta, case.physics, form, case.law)


def matrices(shape: tuple[int, ...], dtype: torch.dtype, precision: str) -> Arguments:
    G = torch.linspace(-1, 1, torch.Size(shape).numel(), dtype=dtype).reshape(shape)
    return (G.mT if shape[0] == 3 else G, precision)


def rows(make: Callable[..., Arguments], *axes: Any, share: int = 1) -> dict[str, Make]:
    """One input for every combination of the axes, named after it; with `share` n, one of n, in
    which every choice still meets every choice of every other axis."""

    def bound(values: tuple[Any, ...]) -> Make:
        return lambda: make(*values)

    return {
        ", ".join(str(value).removeprefix("torch.") for _, value in chosen): bound(
            tuple(value for _, value in chosen)
        )
        for chosen in product(*(list(enumerate(axis)) for axis in axes))
        if sum(index for index, _ in chosen) % share == 0
    }


SIZES = [(0, 4), (4, 4), (1, 1), (5, 7), (33, 31)]
STEPS = [torch.tensor(3), torch.tensor([2**63 - 1]), torch.tensor([[-(2**63)]])]

INPUTS: dict[str, dict[str, Make]] = {
    "network_jet": rows(jets, KINDS, CHANNELS),
    "network_jet_backward": rows(jet_adjoints, KINDS, CHANNELS),
    "residual_loss": rows(losses, KINDS, ("mixed", "strong", "data"))
    | rows(losses, LAW_KINDS, ("mixed", "strong"), share=2)
    | rows(losses, ("plain", "shared points"), ("mixed", "strong"), ("source",)),
    "viscosity": rows(viscosities, (0, 1, 7), FLOATS, OWN, (False, True), share=3),
    "viscosity_backward": {
        name: lambda make=make: ((c := make())[0].detach().cos(), *map(_detached, c))
        for name, make in rows(
            viscosities, (0, 1, 7, 33), FLOATS, OWN, (False, True), share=3
        ).items()
    },
    "pointwise_residuals": rows(raw_jets, ("strong",), (0, 1, 3, 4, 33), (3, 5), FLOATS)
    | rows(raw_jets, ("mixed",), (0, 1, 3, 33), (5,), FLOATS),
    "sample_indices": rows(
        lambda step, seed, count, population: (step, seed, 1, count, population),
        STEPS,
        (-(2**63), 2**63 - 1),
        (0, 9),
        (1, 2**32 - 1),
    ),
    "orthogonalize": rows(
        matrices, [(0, 4), (4, 4), (3, 5, 2), (2, 1, 33, 4), (0, 2, 3)], FLOATS, ("fp32", "fast")
    ),
    "draw_batch": rows(step_inputs.draw, SIZES, FLOATS, (False, True)),
    "batch_loss": rows(
        step_inputs.batch_loss, SIZES, FLOATS, ("mixed", "data"), (False, True), share=2
    ),
    "update": rows(step_inputs.update, (0, 1, 3), (10, 33), FLOATS, (False, True)),
    "descend": rows(step_inputs.descend, (0, 1, 3), (0, 2), FLOATS, ("fp32", "fast")),
}


def _detached(x: Any) -> Any:
    return x.detach() if isinstance(x, Tensor) else x
