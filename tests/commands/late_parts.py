"""What tests of the parts after a training share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from granpinn import results
from granpinn.commands import train

FLAGS = ["--steps", "6", "--log-every", "2", "--network.widths", "6,5", "--batch.interior", "16"]
FILES = {"results.json", "fields.h5", "history.csv"}


def run(*argv: object) -> int:
    return train.main([*map(str, argv), *FLAGS])


def raising(error: BaseException) -> Callable[..., Any]:
    def fail(*args: object, **kwargs: object) -> Any:
        raise error

    return fail


def missing(result: results.Result) -> dict[str, str]:
    return result.not_done
