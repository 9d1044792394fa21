"""Modules of commands that can be called like the function of the same name.

`import granpinn.inspect`, the command, replaces the attribute `granpinn.inspect`, the function.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any


def call_like(function: Callable[..., Any], module: str) -> None:
    """Let a call of the module be a call of the function."""

    class CallableModule(ModuleType):
        __call__ = staticmethod(function)

    sys.modules[module].__class__ = CallableModule
