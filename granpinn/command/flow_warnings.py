"""Warnings of flows in a command: each one is a line on stderr, once."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, cast

from granpinn.data import FlowFileWarning
from granpinn.terminal import say


@contextmanager
def in_one_line() -> Iterator[None]:
    """Inside, a FlowFileWarning is printed without the place in the program."""
    with warnings.catch_warnings():
        warnings.simplefilter("default", FlowFileWarning)
        shown = warnings.showwarning

        def show(message: Any, category: type[Warning], *place: Any) -> None:
            if issubclass(category, FlowFileWarning):
                say(f"warning: {message}")
            else:
                shown(message, category, *place)

        warnings.showwarning = cast(Any, show)
        yield
