"""Flows to their friction laws: the core that the command line and notebooks share."""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from granpinn.config import Config, ConfigError
from granpinn.config.settings import config_of
from granpinn.data import Flow
from granpinn.declared import checked
from granpinn.identification.identified import Identification
from granpinn.identification.one_law import identify_one_law
from granpinn.identification.run import run
from granpinn.identification.start import folder_of
from granpinn.laws import register
from granpinn.physics.laws import FrictionLaw
from granpinn.progress import Progress

T = TypeVar("T")


@checked
def identify(
    flow: Flow | str | os.PathLike[str] | Sequence[Flow | str | os.PathLike[str]],
    config: Config | Mapping[str, Any] | None = None,
    *,
    run_dir: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
    law: FrictionLaw | str | None = None,
    one_law: bool = False,
    reserve: float = 0.0,
    **settings: Any,
) -> Identification:
    """Identify the friction law of a flow, with its velocity and pressure fields, and check it.

    Args:
        flow: a flow, or the path of a flow file; with `one_law` a list of them.
        config: settings as a `Config` or a dict, by default the default recipe.
        settings: single ones, which win, such as `steps=6000`, `level="V0"`, `checks="quick"`.
        run_dir: folder for results.json, fields.h5, history.csv, config.toml and checkpoints;
            without it nothing is written.
        progress: a listener; by default a bar in a notebook, and none elsewhere.
            granpinn.progress has `automatic()`, a bar in a terminal, and `Progress()`,
            which shows nothing.
        law: the name of a law, or a law of your own (granpinn/laws.py); by default the one in the
            settings.
        one_law: identify one friction law of several flows of one material. The result has this law
            and, in `flows`, what each flow is; its `each` has the fit of every flow.
        reserve: seconds of `max_time` that are over, or that the caller needs afterwards.

    Returns:
        The result, with the network, its fields, the history and figures.

    Raises:
        FlowFileError, ConfigError, LawError: bad input; the message is one sentence.
        NonFiniteError, CheckpointError: the run cannot go on.
        OutputError: the folder cannot be written to, or another process or thread uses it.
        Interrupted: SIGINT, SIGTERM or SIGHUP; a checkpoint has been written if there is a folder.
    """
    begin, folder = time.monotonic() - reserve, folder_of(run_dir)
    if isinstance(law, FrictionLaw):
        register(law)
    named = {} if law is None else {"law": law.name if isinstance(law, FrictionLaw) else law}
    config = config_of(config, settings | named)
    if not isinstance(flow, Flow | str | os.PathLike):
        if not flow or not one_law:
            raise ConfigError(
                f"flow must be one flow, got a list of {len(flow)}: add one_law=True for one law "
                "of all, or identify each with identify_many"
            )
        if len(flow) > 1:
            return identify_one_law(flow, config, folder, progress, begin)
        flow = flow[0]
    (found,) = run([flow], [config], config, folder, progress, begin, alone=True)
    return found


@checked
def identify_many(
    flows: Sequence[Flow | str | os.PathLike[str]],
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
    return run(flows, configs, config, folder, progress, begin)


def _one_each(name: str, values: Sequence[T] | None, default: T, count: int) -> Sequence[T]:
    if values is not None and len(values) != count:
        raise ConfigError(
            f"{name} must have one value for each of {count} flows, got {len(values)}"
        )
    return [default] * count if values is None else values
