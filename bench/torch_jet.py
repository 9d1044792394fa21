"""Taylor jets of the package torch-jet, in place of those written by hand.

Optional: needs `pip install jet-for-pytorch` (Python 3.12). The strong form needs u_xx, u_xy and
u_yy each, and a collapsed jet gives only a sum of second derivatives. The jets are therefore the
standard ones, of second order along x, y and x + y together and of first order along t: eight
channels, one more than by hand. The residuals, loss and Adam are those of `bench.jets`.
"""

from __future__ import annotations

import torch
from torch import Tensor

from bench.jets import Jet, Network
from bench.steps import Task, network_of


def _swish(x: Tensor) -> Tensor:
    """The activation by operations that torch-jet knows."""
    return x * torch.sigmoid(x)


def package_jets(task: Task, params: Tensor) -> Network:
    """The jets of the network by torch-jet, captured in a graph as the package recommends.

    2 u_xy is the second derivative along x + y less those along x and y.
    """
    from jet import capture_graph, jet

    taylor = jet(network_of(params, task.widths, _swish), (task.points,))
    x, y, t = torch.eye(3, dtype=task.points.dtype, device=task.points.device)
    strong = task.form == "strong"
    lines = torch.stack([x, y, x + y] if strong else [x, y, t])

    def jets(points: Tensor) -> Jet:
        second = [torch.zeros_like(points)] if strong else []

        def along(line: Tensor) -> tuple[Tensor, ...]:
            found: tuple[Tensor, ...] = taylor((points, line.expand_as(points), *second))
            return found

        value, first, *higher = torch.func.vmap(along)(lines)
        if not strong:
            return [value[0], *first]
        u_xx, u_yy, u_both = higher[0]
        _, u_t = taylor((points, t.expand_as(points)))
        return [value[0], first[0], first[1], u_t, u_xx, (u_both - u_xx - u_yy) / 2, u_yy]

    graph: Network = capture_graph(jets, (task.points,))[0]
    return graph
