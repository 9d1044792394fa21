"""The notebooks of examples/ as pages, with the outputs that they hold.

A page shows the last run of its notebook: text, tables and figures are in the file. Nothing is run
here.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

SUFFIX = ".ipynb"


class Image(NamedTuple):
    """A figure: name of its file beside the page, and its bytes."""

    name: str
    content: bytes


def on_files(files: Any, config: Any) -> Any:
    """Adds the figures; repository.py adds the pages."""
    from mkdocs.structure.files import File  # tests use this module without the extra `docs`

    for source in sorted((Path(config.docs_dir).parent / "examples").glob(f"*{SUFFIX}")):
        for image in images(source.stem, json.loads(source.read_text(encoding="utf-8"))):
            name = f"notebooks/{image.name}"
            files.append(File.generated(config, name, content=image.content))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """The text of a notebook is JSON until here."""
    source = Path(page.file.abs_src_path or "")
    return rendered(source.stem, json.loads(markdown)) if source.suffix == SUFFIX else markdown


def rendered(stem: str, notebook: Any) -> str:
    """A notebook in Markdown."""
    parts, figures = [], images(stem, notebook)
    for cell in notebook["cells"]:
        text = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(text)
            continue
        parts.append(f"```python\n{text}\n```")
        for output in cell["outputs"]:
            figure = "image/png" in data_of(output)
            parts.append(f"![]({next(figures).name})" if figure else shown(output))
    return "\n\n".join(parts) + "\n"


def images(stem: str, notebook: Any) -> Iterator[Image]:
    """The figures of a notebook, in their order."""
    outputs = (output for cell in notebook["cells"] for output in cell.get("outputs", []))
    encoded = (output["data"]["image/png"] for output in outputs if "image/png" in data_of(output))
    for k, text in enumerate(encoded, 1):
        yield Image(f"{stem.replace('_', '-')}-{k}.png", base64.b64decode("".join(text)))


def data_of(output: Any) -> dict[str, Any]:
    """The forms of an output by their types; none of printed text."""
    return dict(output.get("data", {}))


def shown(output: Any) -> str:
    """An output without a figure: a table of granpinn as HTML, anything else as text."""
    data = data_of(output)
    html = "".join(data.get("text/html", ""))
    if "<table>" in html:
        return f'<div class="output">\n{html}\n</div>'
    text = "".join(data.get("text/plain", output.get("text", "")))
    return f"```text\n{text.rstrip()}\n```"
