"""Outputs that must not be written to: devices, FIFOs, sockets, links, other files: gate F-5.

    python -m bench.studies.reliability.hostile_targets --out targets.json

Each command gets each kind of target. It must refuse in one sentence that names the target, or
write beside it; the target, and what it points to, must be as before.
"""

from __future__ import annotations

import argparse
import codecs
import os
import shutil
import socket
import stat
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from bench.studies.reliability import commands, sandbox
from bench.studies.reliability.judge import by_code
from bench.studies.reliability.outputs import CASES, Case
from bench.studies.reliability.record import recorded
from bench.studies.reliability.samples import Files, read_all, write_all

MODULE = "bench.studies.reliability.hostile_targets"
NOBODY = 65534
ALLOWED = {"refused", "could not go on", "ok"}
VICTIM = b"kept\n"

# What a command writes: its target, and whether that is a folder.
TARGETS: dict[str, tuple[str, bool]] = {
    "train": ("run", True),
    "convert": ("out.h5", False),
    "simulate": ("out.h5", False),
    "simulate, figures": ("figures", True),
    "inspect": ("inspection", True),
    "tables": ("tables", True),
}
# Files that a command writes into its folder.
INSIDE = {
    "train": ("run", "results.json"),
    "inspect": ("inspection", "inspect.json"),
    "report": ("run", "report.html"),
    "report, ParaView": ("run", "fields.vtkhdf"),
    "simulate, figures": (".", "out.gif"),
}


def _device(path: Path) -> None:
    os.mknod(path, 0o666 | stat.S_IFCHR, os.makedev(1, 3))


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(path.name)


def _folder_of_files(path: Path) -> None:
    path.mkdir()
    (path / "thesis.txt").write_bytes(VICTIM)


def _read_only(path: Path) -> None:
    path.parent.chmod(0o555)


def _other_run(path: Path) -> None:
    (path / "checkpoint").mkdir(parents=True)
    (path / "results.json").write_text('{"format_name": "granpinn-results"}\n')
    (path / "config.toml").write_text("steps = 7\n")


KINDS: dict[str, Callable[[Path], object]] = {
    "device": _device,
    "FIFO": os.mkfifo,
    "socket": _socket,
    "link to a file": lambda path: path.symlink_to("victim"),
    "link to a folder": lambda path: path.symlink_to("victims"),
    "dangling link": lambda path: path.symlink_to("nothing"),
    "folder of other files": _folder_of_files,
    "file": lambda path: path.write_bytes(VICTIM),
    "read-only folder": _read_only,
    "run of somebody else": _other_run,
}


def main(argv: list[str] | None = None) -> int:
    """Try all targets and write the record; exit code 1 if one is not as before."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, help="the record")
    options = parser.parse_args(argv)
    cache: dict[str | None, Files] = {}
    with recorded("F-5", MODULE, options.out) as record:
        for name, place, kind in combinations():
            case = CASES[name]
            if case.inputs not in cache:
                cache[case.inputs] = case.files()
            outcome, found = tried(case, place, kind, cache[case.inputs])
            what = f"{name}: {place} is a {kind}"
            failure = {"input": what, "outcome": outcome, "message": found.errors.strip()[-300:]}
            record.add(outcome, None if outcome in ALLOWED else failure)
            print(f"{outcome:<28}{what}", flush=True)
    return int(bool(record.failures))


def combinations() -> list[tuple[str, str, str]]:
    """Case, place and kind of target."""
    found = []
    for name, (place, folder) in TARGETS.items():
        for kind in KINDS:
            # A file is what a command may replace; a folder is what it may write into.
            if not (kind == "file" and not folder) and not (
                kind == "run of somebody else" and name != "train"
            ):
                found.append((name, place, kind))
    for name, (folder_name, file) in INSIDE.items():
        for kind in ("device", "FIFO", "link to a file", "folder of other files"):
            found.append((name, str(Path(folder_name) / file), kind))
    return found


def tried(case: Case, place: str, kind: str, files: Files) -> tuple[str, sandbox.Outcome]:
    """Run a command whose target is of that kind."""
    with tempfile.TemporaryDirectory(prefix="target") as made:
        work = Path(made).resolve() / "work"
        (work / "victims").mkdir(parents=True)
        write_all(files, work)
        (work / "victim").write_bytes(VICTIM)
        (work / "victims" / "thesis.txt").write_bytes(VICTIM)
        target = work / place
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.is_file():
            target.unlink()
        before = Path.cwd()
        os.chdir(target.parent)
        try:
            KINDS[kind](target)
        except PermissionError:
            return "ok", sandbox.Outcome(None, 0.0)  # devices need root
        finally:
            os.chdir(before)
        states = {path: state(path) for path in (target, work / "victim", work / "victims")}

        # In a folder that is read-only, it may name another of its outputs.
        names = case.arguments if kind == "read-only folder" else (Path(place).name,)

        def prepare() -> None:
            if kind == "read-only folder" and os.getuid() == 0:
                os.setgid(NOBODY)
                os.setuid(NOBODY)

        def command() -> int:
            with commands.without_drawing():
                return commands.MAINS[case.command](case.arguments)

        codecs.lookup("utf-8-sig")  # nobody may be unable to import it
        for folder in (Path(made), work):
            folder.chmod(folder.stat().st_mode | 0o055)
        found = sandbox.run(command, prepare, work)
        outcome = found.broken or by_code(found, case.command)
        if kind != "read-only folder" and not all(map(kept, states, states.values())):
            outcome = "target changed"
        elif found.code not in (0, None) and not any(name in found.errors for name in names):
            outcome = "target not named"
        if kind == "read-only folder":
            work.chmod(0o755)
        shutil.rmtree(work, ignore_errors=True)
        return outcome, found


State = tuple[int, str | int, Files] | None


def state(path: Path) -> State:
    """What a path is: its kind, its target or device, and its files."""
    if not os.path.lexists(path):
        return None
    entry = path.lstat()
    kind = stat.S_IFMT(entry.st_mode)
    if path.is_symlink():
        return kind, str(path.readlink()), {}
    files = read_all(path) if path.is_dir() else {"": path.read_bytes()} if path.is_file() else {}
    return kind, entry.st_rdev, files


def kept(path: Path, before: State) -> bool:
    """Whether a path is as before; a folder may have more files than before."""
    now = state(path)
    if before is None or now is None:
        return now is before
    return now[:2] == before[:2] and now[2] == now[2] | before[2]


if __name__ == "__main__":
    sys.exit(main())
