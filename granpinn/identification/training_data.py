"""What the network is fitted to: the vectors of a flow, and equations between exact ones.

Equations between the vectors (granpinn/data/collocation.py) hold a network to the law at places
where no vector says what the velocity is. Where the vectors are those of a simulation, mu_2 is then
two to three times as near and scatters a third as much over seeds. Measured vectors do not allow
what goes with it, a lowest row without equations: on those of a PIV, 2 % off, mu_2 was then 8 % too
low, and else 1 % (docs/method.md, section 8). So it is done where the vectors have no noise to
speak of.
"""

from __future__ import annotations

import torch

from granpinn.config import Config
from granpinn.data import Flow, TrainingSet, known_sd, training_set, with_collocation
from granpinn.inspection.noise import grid_noise
from granpinn.inspection.view import view_of
from granpinn.scales import Scales

# Noise of a vector, in sqrt(g H0). Simulations have 3e-7 to 2e-5 by the same estimate, from their
# fronts and rounding; a PIV of 0.1 px has 5e-3, and the network itself resolves 3e-3.
EXACT = 1e-3


def training_data(flow: Flow, scales: Scales, config: Config) -> TrainingSet:
    """The training set of a flow as the training sees it.

    Raises:
        FlowFileError: the flow has not what the level needs.
    """
    data = training_set(flow, scales, config.level, getattr(torch, config.dtype))
    if config.batch.collocation == 0 or not is_exact(flow, scales):
        return data
    return with_collocation(data, flow, scales, config.batch.collocation)


def is_exact(flow: Flow, scales: Scales) -> bool:
    """Whether its vectors are on a grid, state no noise, and show none in their differences."""
    if flow.particles is not None or known_sd(flow) > 0:
        return False
    sigma = grid_noise(view_of(flow, scales)).sigma
    return sigma is not None and sigma < EXACT
