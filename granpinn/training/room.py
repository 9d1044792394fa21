"""Memory of a training, estimated before it is taken.

The numbers come from the peak memory of trainings of many sizes, and differ from it by a factor of
at most 2 (tests/training/test_room.py). s is the size of a number, P the number of parameters of
a network, F the number of its last hidden units and the bias:

    networks     of each member 16 s P: parameters, gradient, both moments, direction of
                 the step, and a copy of what a rollback needs. A checkpoint takes half of that
                 again, and so does each copy that trains on with another assumption. Each thread
                 has a gradient and its sum in float64.
    batches      14 s for each point of each member
    last layer   56 F for each of its points (derivatives of F units, float64), and 4000 F^2 for the
                 normal equations of all halves of the data
    points       32 s for each: the data, and copies while they are made and pooled
    flow         240 for each cell: checks, estimates and fields
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import torch

from granpinn.config import Config, ConfigError
from granpinn.data.large import available
from granpinn.kernels.network import OUTPUTS, n_params
from granpinn.training.last_layer_sums import CHUNK, POINTS, SURFACE_POINTS
from granpinn.training.objective import Member

LEAST = 24_000_000  # of any training
POINT, CELL = 32, 240
REMEDIES = {
    "networks": "choose smaller --network.widths or fewer --members",
    "batches": "choose a smaller --batch.interior or --batch.surface, or fewer --members",
    "last_layer": "choose a narrower last layer in --network.widths",
    "points": "choose a smaller --batch.collocation or fewer frames",
    "flow": "choose fewer frames",
}


def total(need: Mapping[str, int]) -> int:
    """Bytes of all parts of a training."""
    return LEAST + sum(need.values())


def require(need: Mapping[str, int], free: int, where: str) -> None:
    """Raises ConfigError, with the numbers and what to change, if a training needs more."""
    if total(need) <= free:
        return
    shown = ", ".join(f"{n.replace('_', ' ')} {b / 1e9:.3g}" for n, b in need.items() if b)
    raise ConfigError(
        f"this training needs about {total(need) / 1e9:.3g} GB of {where} ({shown}), got "
        f"{free / 1e9:.3g} GB: {REMEDIES[max(need, key=need.__getitem__)]}, or use a larger machine"
    )


def need_of(
    config: Config, members: int, points: Sequence[int], device: str = "cpu", copies: int = 0
) -> dict[str, int]:
    """Bytes of the parts of `members` trainings side by side, beside their points and flows.

    Args:
        points: number of points of each data set, pooled.
        device: type of the device of the networks.
        copies: trainings that go on with another assumption, after these.
    """
    s, threads = getattr(torch, config.dtype).itemsize, torch.get_num_threads()
    widths = [3, *config.network.widths, OUTPUTS[config.form]]
    P, F, batch = n_params(widths), widths[-2] + 1, config.batch
    networks = P * s * (16 * members + max(8 * members, 16 * copies))
    if device == "cpu":
        networks += P * threads * (s + 8)
    last_layer, most = 0, max(points, default=0)
    if config.form == "mixed":
        rows = 56 * min(POINTS, most) + 8 * min(SURFACE_POINTS, most)
        last_layer = F * (rows + 200 * min(CHUNK[device], most)) + 4000 * F**2
    batches = 14 * s * members * (batch.interior + batch.surface)
    return {"networks": networks, "batches": batches, "last_layer": last_layer}


def require_room(members: Sequence[Member], config: Config, device: torch.device) -> None:
    """Raises ConfigError if members do not fit into the memory of their device, with their data."""
    sets = {id(m.data): m.data for m in members}.values()
    points = [len(s.points) + len(s.between) + len(s.strip) + len(s.wall_points) for s in sets]
    need = need_of(config, len(members), points, device.type)
    need["points"] = POINT // 2 * getattr(torch, config.dtype).itemsize * sum(points)
    if device.type == "cuda":
        require(need, torch.cuda.mem_get_info(device)[0], "memory of the GPU")
    else:
        require(need, available(), "memory")
