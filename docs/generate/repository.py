"""Files of the repository outside docs/ on the site, so that links to them lead somewhere.

CONTRIBUTING.md and CHANGELOG.md become pages. Any other file that a page links to, such as
../bench/results/cpu_step.json, is copied. Of links to a folder or to README.md only the text stays:
a site has no folders, and README.md is the front page of the repository as index.md is that of the
site.
"""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath
from typing import Any

from mkdocs.structure.files import File

PAGES = {"CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
COPIES = "repository"  # their folder on the site
_LINK = re.compile(r"(?<!!)\[([^\]]*)\]\(([^)#\s:]+)(#[^)\s]*)?\)")


def on_files(files: Any, config: Any) -> Any:
    """Adds the pages and copies."""
    root = Path(config.docs_dir).parent
    for source, page in PAGES.items():
        files.append(File.generated(config, page, abs_src_path=str(root / source)))
    for target in sorted({t for f in files.documentation_pages() for t in targets(f, root)}):
        if (root / target).is_file():
            place = f"{COPIES}/{target}"
            files.append(File.generated(config, place, abs_src_path=str(root / target)))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Turns the links of a page to what `on_files` has added."""
    root = Path(config.docs_dir).parent

    def turned(match: re.Match[str]) -> str:
        text, _, anchor = match.groups()
        target = outside(page.file, match[2], root)
        if target is None:
            return match[0]
        if target in PAGES:
            return f"[{text}]({PAGES[target]}{anchor or ''})"
        return f"[{text}]({COPIES}/{target})" if (root / target).is_file() else text

    return _LINK.sub(turned, markdown)


def targets(file: Any, root: Path) -> set[str]:
    """The files and folders outside docs/ that a page links to, without those that are pages."""
    found = {outside(file, match[2], root) for match in _LINK.finditer(file.content_string)}
    return {target for target in found if target is not None and target not in PAGES}


def outside(file: Any, link: str, root: Path) -> str | None:
    """`link` of a page as a path in the repository; None if it stays in docs/ or leads nowhere."""
    source = Path(file.abs_src_path)
    path = (source.parent / link).resolve()
    if not path.exists() or not path.is_relative_to(root) or path.is_relative_to(root / "docs"):
        return None
    return str(PurePosixPath(path.relative_to(root)))
