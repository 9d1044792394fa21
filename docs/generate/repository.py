"""Files of the repository outside docs/ on the site, so that links to them work.

README.md, CONTRIBUTING.md, CHANGELOG.md, SECURITY.md, the notes of the studies and the notebooks of
examples/ (notebooks.py) become pages. Any other file that a page links to, such as
../bench/results/steps.csv, is copied. Of links to a folder only the text stays, because a site
has no folders.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Any

PAGES = {
    "README.md": "readme.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "SECURITY.md": "security.md",
}
COPIES = "repository"  # folder of the copies on the site
NOTEBOOKS = "examples/*.ipynb"
NOTES = "bench/studies/**/note.md"  # that of inertial_number is evidence/inertial-number.md
_LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)#\s:]+)(#[^)\s]*)?\)")


def on_files(files: Any, config: Any) -> Any:
    """Adds the pages and copies."""
    from mkdocs.structure.files import File  # tests use this module without the extra `docs`

    root = Path(config.docs_dir).parent
    for source, page in pages(root).items():
        files.append(File.generated(config, page, abs_src_path=str(root / source)))
    for target in sorted({t for f in files.documentation_pages() for t in targets(f, root)}):
        if (root / target).is_file():
            place = f"{COPIES}/{target}"
            files.append(File.generated(config, place, abs_src_path=str(root / target)))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Turns the links between docs/ and the rest of the repository into links of the site."""
    root = Path(config.docs_dir).parent
    here = posixpath.dirname(page.file.src_uri)

    def turned(match: re.Match[str]) -> str:
        image, text, link, anchor = match.groups()
        target = in_repository(page.file, link, root)
        if target is None:
            return match[0]
        place = place_on_site(target, root)
        if place is None:
            return text
        return f"{image}[{text}]({posixpath.relpath(place, here or '.')}{anchor or ''})"

    return _LINK.sub(turned, markdown)


def pages(root: Path) -> dict[str, str]:
    """The page of every file of the repository that becomes one."""
    notes = [path.relative_to(root) for path in sorted(root.glob(NOTES))]
    found = {note: f"evidence/{note.parent.name}" for note in notes}
    found |= {
        path.relative_to(root): f"notebooks/{path.stem}" for path in sorted(root.glob(NOTEBOOKS))
    }
    return PAGES | {path.as_posix(): f"{page.replace('_', '-')}.md" for path, page in found.items()}


def place_on_site(target: str, root: Path) -> str | None:
    """Where a file of the repository is on the site; None for a folder."""
    if target in (page := pages(root)):
        return page[target]
    if target.startswith("docs/"):
        return target.removeprefix("docs/")
    return f"{COPIES}/{target}" if (root / target).is_file() else None


def targets(file: Any, root: Path) -> set[str]:
    """The files and folders outside docs/ that a page links to, without those that are pages."""
    found = {in_repository(file, match[3], root) for match in _LINK.finditer(file.content_string)}
    outside = {target for target in found if target is not None and not target.startswith("docs/")}
    return outside - set(pages(root))


def in_repository(file: Any, link: str, root: Path) -> str | None:
    """`link` of a page as a path in the repository; None if nothing is there."""
    path = (Path(file.abs_src_path).parent / link).resolve()
    if not path.exists() or not path.is_relative_to(root):
        return None
    return path.relative_to(root).as_posix()
