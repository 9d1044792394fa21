"""Rules that every source file keeps: short enough to read, and no way to run foreign code."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = sorted(
    path
    for folder in ("granpinn", "csrc", "bench", "tests")
    for path in (ROOT / folder).rglob("*")
    if path.suffix in {".py", ".h", ".cpp", ".cu", ".cuh"}
)
PACKAGE = sorted((ROOT / "granpinn").rglob("*.py"))
NETWORK = {"socket", "ssl", "urllib", "http", "ftplib", "smtplib", "asyncio", "socketserver"}
NETWORK |= {"requests", "httpx", "aiohttp", "urllib3", "fsspec", "webbrowser", "xmlrpc", "paramiko"}
FORBIDDEN = {"eval", "exec", "torch.load", "torch.save", "os.system", "pickle.load", "pickle.loads"}


def calls(tree: ast.AST) -> Iterator[ast.Call]:
    return (node for node in ast.walk(tree) if isinstance(node, ast.Call))


def modules_of(tree: ast.AST) -> set[str]:
    """Modules that a file imports, and the names that it takes from them."""
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    modules = {alias.name for node in imports for alias in node.names}
    return modules | {n.module for n in imports if isinstance(n, ast.ImportFrom) and n.module}


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_files_are_short(path: Path) -> None:
    lines = path.read_text().splitlines()
    assert len(lines) <= 400
    if path.suffix != ".py":  # ruff measures those
        assert max(map(len, lines), default=0) <= 100


@pytest.mark.parametrize("path", PACKAGE, ids=lambda p: str(p.relative_to(ROOT)))
def test_nothing_reads_or_runs_foreign_code(path: Path) -> None:
    """Gate F-3: checkpoints are safetensors and JSON; no pickle, torch.load, eval, shell=True."""
    tree = ast.parse(path.read_text())
    names = {ast.unparse(call.func) for call in calls(tree)}
    assert not FORBIDDEN & names
    assert not {name for name in names if re.search(r"_object(_list)?$", name)}  # torch pickles
    keywords = [word for call in calls(tree) for word in call.keywords]
    assert not [word for word in keywords if word.arg in {"shell", "allow_pickle"}]
    assert not modules_of(tree) & {"pickle", "cPickle", "dill", "joblib", "marshal", "shelve"}


@pytest.mark.parametrize("path", PACKAGE, ids=lambda p: str(p.relative_to(ROOT)))
def test_nothing_uses_the_network_or_starts_programs(path: Path) -> None:
    """SECURITY.md: no module imports a network library; two start Python, to read a file in it and
    to draw figures."""
    programs = {"subprocess", "ctypes", "pty"}
    if path.name in {"isolated.py", "painters.py"}:
        programs.remove("subprocess")
    used = {name.partition(".")[0] for name in modules_of(ast.parse(path.read_text()))}
    assert not used & (NETWORK | programs)


def test_the_scan_finds_what_it_forbids() -> None:
    network = ast.parse("from urllib.request import urlopen\nimport http.client")
    assert {name.partition(".")[0] for name in modules_of(network)} & NETWORK == {"urllib", "http"}
    tree = ast.parse("import torch\ntorch.load('x')")
    assert FORBIDDEN & {ast.unparse(call.func) for call in calls(tree)} == {"torch.load"}
