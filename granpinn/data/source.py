"""The source term of the momentum equation at points of a training: `Flow.source`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch

from granpinn.data.flow import Flow, FlowFileError
from granpinn.data.symmetry import axes_of

if TYPE_CHECKING:
    from granpinn.physics.scales import Scales


def source_at(points: torch.Tensor, flow: Flow, scales: Scales) -> torch.Tensor | None:
    """(S_x, S_y) [N, 2], dimensionless, in the axes and with the type of the points; None: none.

    Args:
        points: (x, y, t) [N, 3] of the training.

    Raises:
        FlowFileError: the source is not finite, or has another shape than the points.
    """
    if flow.source is None:
        return None
    axes = axes_of(flow)
    x, y, t = points.double().cpu().numpy().T
    places = scales.points_to_physical(np.stack([*axes.undo(x, y), t], -1))
    force = np.stack(flow.source(*places.T), -1)
    if force.shape != (len(points), 2) or not np.isfinite(force).all():
        raise FlowFileError(
            f"the source of a flow must give finite numbers S_x [n], S_y [n] for x, y, t [n], got "
            f"{list(force.shape)} with {int((~np.isfinite(force)).sum())} not finite for "
            f"{len(points)} points: correct the function"
        )
    turned = np.stack(axes.turn(*scales.to_dimensionless(force, "acceleration").T), -1)
    return torch.as_tensor(turned).to(points)
