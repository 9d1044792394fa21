"""The sources of the site: its navigation, the generated pages, and CITATION.cff."""

from __future__ import annotations

import re
import sys
import tomllib
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import yaml

import granpinn
import granpinn.data
from granpinn.config import Config, flatten

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md"))


def hook(name: str) -> Any:
    """A module of docs/generate, which is no package."""
    spec = spec_from_file_location(f"docs_{name}", DOCS / "generate" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def settings() -> dict[str, Any]:
    return dict(yaml.safe_load((ROOT / "mkdocs.yml").read_text()))


def test_navigation_has_every_page_once() -> None:
    navigation = hook("navigation")
    pages = [*PAGES, *hook("repository").pages(ROOT).values()]
    listed = list(navigation.listed(navigation.completed(settings()["nav"], pages)))
    assert sorted(listed) == sorted(pages)


def test_the_note_of_a_study_is_a_page(tmp_path: Path) -> None:
    repository = hook("repository")
    note = tmp_path / "bench" / "studies" / "simulator_validation" / "note.md"
    note.parent.mkdir(parents=True)
    note.write_text("# Fit\n")
    source = "bench/studies/simulator_validation/note.md"
    assert repository.pages(tmp_path)[source] == "evidence/simulator-validation.md"
    assert repository.place_on_site(source, tmp_path) == "evidence/simulator-validation.md"
    assert repository.place_on_site("docs/index.md", tmp_path) == "index.md"


def test_command_reference_has_every_command_that_the_readme_names() -> None:
    commands = hook("commands").VERBS
    named = set(re.findall(r"python -m granpinn\.([a-z_]+)", (ROOT / "README.md").read_text()))
    assert named <= set(commands)
    assert [name for name in commands if name in ("convert", "train")] == ["convert", "train"]


def test_settings_have_every_setting_and_every_recipe() -> None:
    made = hook("settings")
    for key in flatten(Config()):
        assert f"| `{key.rsplit('.', 1)[-1]}` |" in made.reference()
    assert "| setting | default | paper |" in made.recipe_table()
    assert "| `batch.interior` | `1024` | `512` |" in made.recipe_table()


def test_python_page_has_every_public_function_and_flow_class() -> None:
    shown = {
        line.rsplit(".", 1)[-1]
        for line in (DOCS / "reference" / "api.md").read_text().splitlines()
        if line.startswith("::: ")
    }
    assert set(granpinn.__all__) - {"__version__"} <= shown
    assert {"Flow", "Surface", "Particles", "Truth", "read", "particle_flow"} <= shown


def test_what_a_page_loads_from_elsewhere_is_found() -> None:
    page = '<script src="https://a/b.js"></script><img src="images/x.png"><a href="https://c/">'
    assert hook("offline").loaded(page) == ["https://a/b.js"]


def test_citation_is_valid() -> None:
    """The entries that version 1.2.0 of the format demands, and those that must not go stale."""
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert citation["cff-version"] == "1.2.0"
    assert citation["version"] == granpinn.__version__
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert citation["license"] == project["license"]["text"]
    for author in [*citation["authors"], *citation["references"][0]["authors"]]:
        assert {"name"} == set(author) or {"family-names", "given-names"} == set(author)


def test_the_index_of_the_search_is_a_script_and_so_is_the_worker() -> None:
    """The search works on pages that are opened from files."""
    plugins, scripts = settings()["plugins"], settings()["extra"]["polyfills"]
    assert plugins.index("search") < plugins.index("offline")
    # The plugin loads the script from another host, unless one of this name is given.
    assert [name for name in scripts if "iframe-worker" in name]
    assert all((DOCS / name).is_file() for name in scripts)
