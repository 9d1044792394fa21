"""The exit code of a command that trains, and one sentence for its error."""

from __future__ import annotations

from collections.abc import Callable

from granpinn.command.parser import fail
from granpinn.config import ConfigError
from granpinn.data import FlowFileError
from granpinn.simulation import SimulationError
from granpinn.training.checkpoint import CheckpointError
from granpinn.training.guard import Interrupted, NonFiniteError


def exit_code(command: str, run: Callable[[], int]) -> int:
    """The exit code of `run`, or the code for the error that it raises."""
    try:
        return run()
    except (ConfigError, FlowFileError) as error:
        return fail(command, 2, str(error))
    except (CheckpointError, NonFiniteError, SimulationError, OSError) as error:
        return fail(command, 1, str(error))
    except Interrupted as error:
        return fail(command, 128 + error.signum, str(error))
    except KeyboardInterrupt:
        return fail(command, 130, "stopped outside of the training")
