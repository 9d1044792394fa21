"""One flow to its friction law: the core that the command line and notebooks share."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from typing import Any

from granpinn.checks import wanted
from granpinn.config import Config, ConfigError
from granpinn.config.settings import config_of
from granpinn.data import Flow
from granpinn.declared import checked
from granpinn.fit.case import pose
from granpinn.identification.identified import Identification
from granpinn.identification.one_law import identify_one_law
from granpinn.identification.run import run
from granpinn.identification.start import folder_of, prepare
from granpinn.kernels.builds import choose_device
from granpinn.laws import register
from granpinn.output import owned
from granpinn.physics.laws import FrictionLaw
from granpinn.training.progress import Progress


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
            granpinn.training.progress has `automatic()`, a bar in a terminal, and `Progress()`,
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
    checks, case = wanted(config), pose(flow, config)
    with owned(folder):
        if folder is not None:
            prepare(folder, config)
        (found,) = run(
            [case],
            config,
            checks,
            folder,
            [folder],
            progress,
            begin,
            choose_device(config.device),
            alone=True,
        )
        return found
