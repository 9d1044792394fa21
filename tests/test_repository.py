"""Rules that every source file keeps: no way to run foreign code, and no way to a network."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
NETWORK = {"socket", "ssl", "urllib", "http", "ftplib", "smtplib", "asyncio", "socketserver"}
NETWORK |= {"requests", "httpx", "aiohttp", "urllib3", "fsspec", "webbrowser", "xmlrpc", "paramiko"}
FORBIDDEN = {"eval", "exec", "torch.load", "torch.save", "os.system", "pickle.load", "pickle.loads"}
PICKLES = {"pickle", "cPickle", "dill", "joblib", "marshal", "shelve"}
PROGRAMS = {"subprocess", "ctypes", "pty"}


@cache
def package() -> dict[Path, ast.Module]:
    """The modules of granpinn."""
    paths = sorted((ROOT / "granpinn").rglob("*.py"))
    return {path: ast.parse(path.read_text()) for path in paths}


def calls(tree: ast.AST) -> Iterator[ast.Call]:
    return (node for node in ast.walk(tree) if isinstance(node, ast.Call))


def modules_of(tree: ast.AST) -> set[str]:
    """Modules that a file imports, and the names that it takes from them."""
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    modules = {alias.name for node in imports for alias in node.names}
    return modules | {n.module for n in imports if isinstance(n, ast.ImportFrom) and n.module}


def foreign_code(tree: ast.AST) -> set[str]:
    """What reads or runs foreign code."""
    names = {ast.unparse(call.func) for call in calls(tree)}
    keywords = {word.arg for call in calls(tree) for word in call.keywords if word.arg}
    return (
        (FORBIDDEN & names)
        | {name for name in names if re.search(r"_object(_list)?$", name)}  # torch pickles
        | (keywords & {"shell", "allow_pickle"})
        | (modules_of(tree) & PICKLES)
    )


def outside(tree: ast.AST) -> set[str]:
    """Imports that lead to a network or start programs."""
    return {name.partition(".")[0] for name in modules_of(tree)} & (NETWORK | PROGRAMS)


def writes(call: ast.Call) -> bool:
    """Whether a call opens a file to write it."""
    name = call.func.attr if isinstance(call.func, ast.Attribute) else ast.unparse(call.func)
    words = (
        re.fullmatch("'r?[wax+]b?[+]?b?'", ast.unparse(n)) for a in call.args for n in ast.walk(a)
    )
    return (
        (name in ("open", "File") and any(words))
        or "os.O_CREAT" in ast.unparse(call)
        or (isinstance(call.func, ast.Attribute) and name in ("write_text", "write_bytes"))
    )


def test_lines_of_cpp_are_short() -> None:
    """ruff measures those of Python."""
    suffixes = {".h", ".cpp", ".cu", ".cuh"}
    sources = [path for path in (ROOT / "csrc").rglob("*") if path.suffix in suffixes]
    assert sources
    assert not [p for p in sources if max(map(len, p.read_text().splitlines()), default=0) > 100]


def test_nothing_reads_or_runs_foreign_code() -> None:
    """Gate F-3: checkpoints are safetensors and JSON; no pickle, torch.load, eval, shell=True."""
    assert len(package()) > 100
    found = {path: foreign_code(tree) for path, tree in package().items()}
    assert not {path: names for path, names in found.items() if names}


def test_nothing_uses_the_network_or_starts_programs() -> None:
    """SECURITY.md: no module imports a network library; one starts Python, to read files in it; a
    pair of sockets inside the system connects both."""
    used = {path: outside(tree) for path, tree in package().items()}
    starts = {path.name: names for path, names in used.items() if names}
    expected = {"process.py": {"subprocess", "socket"}, "program.py": {"socket"}}
    assert starts == expected


def test_every_file_is_written_whole_or_not_at_all() -> None:
    """Gate F-5: granpinn.output writes all files but the history, which grows."""
    found = {path.name for path, tree in package().items() if any(map(writes, calls(tree)))}
    assert found == {"writing.py", "ownership.py", "hdf5.py", "history.py"}


def test_the_scan_finds_what_it_forbids() -> None:
    code = "p.open('wb')\nopen('a', 'r+')\nh5py.File(p, 'w')\np.write_text('')\np.open('rb')"
    assert list(map(writes, calls(ast.parse(code)))) == [True, True, True, True, False]
    network = ast.parse("from urllib.request import urlopen\nimport http.client, subprocess")
    assert outside(network) == {"urllib", "http", "subprocess"}
    code = (
        "import torch, pickle\ntorch.load('x', allow_pickle=True)\neval('1')\n"
        "torch.distributed.all_gather_object(1)\nrun('x', shell=True)"
    )
    assert foreign_code(ast.parse(code)) == {
        *("pickle", "torch.load", "allow_pickle", "eval", "shell"),
        "torch.distributed.all_gather_object",
    }
