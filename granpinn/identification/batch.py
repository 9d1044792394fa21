"""Many identifications as one batch: cases, seeds, draws of noise, a grid of I0."""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from granpinn.checks import wanted
from granpinn.config import Config, ConfigError
from granpinn.config.settings import config_of
from granpinn.data import Flow
from granpinn.declared import checked
from granpinn.fit.case import Case, fixed_values, posed, sound
from granpinn.identification.identified import Identification
from granpinn.identification.run import run
from granpinn.identification.start import folder_of, prepare
from granpinn.kernels.builds import choose_device
from granpinn.output import owned
from granpinn.physics.laws import LAWS
from granpinn.simulation.threads import beside_gpu
from granpinn.training.progress import Progress

FlowLike = Flow | str | os.PathLike[str]


@checked
def identify_many(
    flows: Sequence[FlowLike],
    config: Config | Mapping[str, Any] | None = None,
    seeds: Sequence[int] | None = None,
    *,
    I0: Sequence[float] | None = None,
    laws: Sequence[str] | None = None,
    noise: Sequence[float] | None = None,
    run_dir: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
    **settings: Any,
) -> list[Identification]:
    """Identify many flows side by side, each as `identify` would, in one batch.

    The members share the settings, hence the shape of the network and the schedule. Each has its
    own data, friction law, I0 and seed (of the network, of the batches and of the noise). Members
    with the same flow and without noise share its data on the device. With `config.members` = K,
    each member is an ensemble of K networks.

    Args:
        flows: a flow or the path of a flow file for every member.
        config: settings of all as a `Config` or a dict, by default the default recipe.
        settings: single ones, which win, such as `steps=6000`.
        seeds, I0, laws, noise: one value for every member, by default the value in the settings.
        run_dir: folder for the checkpoints of the batch. Its subfolders 000, 001, ... get the files
            that `identify` writes, one subfolder for each member.
        progress: a listener, as in `identify`; it gets the medians over the members.

    Returns:
        The results in the order of `flows`. A member that diverged has a `failure`; the others
        continue. Without a folder, fields are predicted when they are asked for.

    Raises:
        As `identify`, except NonFiniteError.
    """
    begin = time.monotonic()
    config = config_of(config, settings)
    if not flows:
        raise ConfigError("flows must hold at least one flow, got none")
    configs = [
        dataclasses.replace(config, seed=seed, I0=value, law=law, noise=sd)
        for seed, value, law, sd in zip(
            _one_each("seeds", seeds, config.seed, len(flows)),
            _one_each("I0", I0, config.I0, len(flows)),
            _one_each("laws", laws, config.law, len(flows)),
            _one_each("noise", noise, config.noise, len(flows)),
            strict=True,
        )
    ]
    folder = folder_of(run_dir)
    return side_by_side(flows, configs, config, folder, progress, begin)


def side_by_side(
    flows: Sequence[FlowLike],
    configs: Sequence[Config],
    config: Config,
    root: Path | None,
    progress: Progress | None,
    begin: float,
) -> list[Identification]:
    """Identify flows, each with its own settings, in one batch with those that all share.

    The arguments are those of `identify_many` and `identify`; `begin`: where a time limit begins.
    """
    checks = wanted(config)
    device = choose_device(config.device)
    with owned(root):
        if root is not None:
            prepare(root, config)
        cases = _pose(flows, configs, device.type == "cuda")
        parts: list[Path | None] = [None] * len(cases)
        if root is not None:
            parts = [prepare(root / f"{e:03d}", case.config) for e, case in enumerate(cases)]
        return run(cases, config, checks, root, parts, progress, begin, device)


T = TypeVar("T")


def _one_each(name: str, values: Sequence[T] | None, default: T, count: int) -> Sequence[T]:
    if values is not None and len(values) != count:
        raise ConfigError(
            f"{name} must have one value for each of {count} flows, got {len(values)}"
        )
    return [default] * count if values is None else values


def _pose(flows: Sequence[FlowLike], configs: Sequence[Config], on_gpu: bool) -> list[Case]:
    """The cases; a repeated flow is read once, and without noise its cases share the data."""
    keys = [id(flow) if isinstance(flow, Flow) else str(flow) for flow in flows]
    distinct = dict(zip(keys, flows, strict=True))
    read = dict(zip(distinct, beside_gpu(sound, list(distinct.values()), on_gpu), strict=True))
    plain: dict[int | str, Config] = {}
    for key, config in zip(keys, configs, strict=True):
        if not config.noise:
            plain.setdefault(key, config)

    def alone(key: int | str, config: Config) -> Case:
        return posed(*read[key], config)

    posed_once = beside_gpu(lambda pair: alone(*pair), list(plain.items()), on_gpu)
    clean = dict(zip(plain, posed_once, strict=True))

    def case(key: int | str, config: Config) -> Case:
        if config.noise:
            return alone(key, config)
        first = clean[key]
        fixed = fixed_values(config, first.facts)
        law = LAWS[config.law]
        member = dataclasses.replace(first.member, seed=config.seed, law=law, fixed=fixed)
        return dataclasses.replace(first, config=config, member=member)

    pairs = list(zip(keys, configs, strict=True))
    return beside_gpu(lambda pair: case(*pair), pairs, on_gpu)
