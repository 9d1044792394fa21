"""The report of a run: `python -m granpinn.report DIR`, or `build(DIR)`."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from granpinn.report.page import build

__all__ = ["build"]


def __getattr__(name: str) -> Any:
    """The page is loaded at its first use, so that the command can first prepare its process."""
    if name not in __all__:
        raise AttributeError(f"module 'granpinn.report' has no attribute {name!r}")
    return getattr(import_module("granpinn.report.page"), name)
