"""Reads mutants of files and folders, each under 10 s and 3 GiB: run as a program of its own.

Each argument is a job: the format, the path, the first seed and the number of seeds, as JSON.
Prints one line of JSON for each mutant: the path, its seed and "read" or the message. A mutant that
takes too long, or that crashes the reader, kills the program: the next seed is the guilty one.
"""

from __future__ import annotations

import json
import os
import random
import resource
import signal
import sys
import warnings
from pathlib import Path

from granpinn.importers import DataFileError, read_vectors

SECONDS = 10  # of processor time
BYTES = 3 * 2**30


def mutant(content: bytes, draw: random.Random) -> bytes:
    """The content with some bytes changed, mostly one; text of JSON with a digit changed."""
    if draw.random() < 0.05:
        return content[: draw.randrange(len(content))]
    changed = bytearray(content)
    for _ in range(draw.choice([1, 1, 1, 1, 2, 8])):
        place = draw.randrange(draw.choice([len(content), min(len(content), 4096)]))
        while not changed[place] and draw.random() < 0.9:  # where the structure is
            place = draw.randrange(len(content))
        new = [0, 1, 127, 128, 255, ord("9"), changed[place] ^ 1 << draw.randrange(8)]
        changed[place] = draw.choice(new)
    return bytes(changed)


def main(kind: str, path: Path, first: int, count: int) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY,) * 2)
    files = [p for p in path.rglob("*") if p.is_file()] if path.is_dir() else [path]
    contents = {file: file.read_bytes() for file in sorted(files)}
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    read_vectors(path, kind)  # the imports, and proof that the file is valid
    resource.setrlimit(resource.RLIMIT_AS, (used + BYTES, resource.RLIM_INFINITY))
    warnings.simplefilter("ignore")
    for seed in range(first, first + count):
        draw = random.Random(seed)
        file = draw.choice([*contents])
        file.write_bytes(mutant(contents[file], draw))
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        try:
            read_vectors(path, kind)
            message = "read"
        except DataFileError as error:
            message = str(error)
        signal.setitimer(signal.ITIMER_PROF, 0)
        print(json.dumps([str(path), seed, message]), flush=True)
        file.write_bytes(contents[file])


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    for kind, path, first, count in map(json.loads, sys.argv[1:]):
        main(kind, Path(path), first, count)
