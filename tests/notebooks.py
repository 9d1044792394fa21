"""The notebooks of examples/ as programs with other settings."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

NOTEBOOKS = sorted((Path(__file__).parents[1] / "examples").glob("*.ipynb"))


def cells(path: Path, kind: str) -> list[Any]:
    content = json.loads(path.read_text(encoding="utf-8"))
    return [cell for cell in content["cells"] if cell["cell_type"] == kind]


def program(path: Path, settings: Mapping[str, Any]) -> str:
    """The code of a notebook, with the cell of its settings replaced by other values."""
    given = [f"{name} = {value!r}" for name, value in settings.items()]
    code = ["".join(cell["source"]) for cell in cells(path, "code")]
    tags = [cell["metadata"].get("tags", []) for cell in cells(path, "code")]
    code[tags.index(["settings"])] = "\n".join(given)
    return "\n\n".join(code)
