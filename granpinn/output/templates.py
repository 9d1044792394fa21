"""Texts from templates: a name that has no value is an error."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import jinja2


def environment(folder: Path, **options: Any) -> jinja2.Environment:
    """The templates of a folder; `options` as for jinja2.Environment, such as `autoescape`."""
    import jinja2  # slow to import

    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(folder),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        **options,
    )
