"""Reads flow files one by one, each under 15 s and 2 GiB: run as a program of its own.

Prints one line of JSON per file: its index, the kind of the outcome, the message, the seconds.
A file that takes longer kills the program, which is how a hang inside HDF5 shows.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import sys
import time
from pathlib import Path

from granpinn.data import read_flow

SECONDS = 15  # of processor time: the machine may be busy with other things
WAITING = 60  # in all, for a file that blocks
BYTES = 2 * 2**30


def main(paths: list[str]) -> None:
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + BYTES, used + BYTES))
    for path in paths:
        os.chdir(Path(path).parent)  # external storage is looked up from here
        signal.setitimer(signal.ITIMER_PROF, SECONDS)  # its signal is fatal if nobody handles it
        signal.setitimer(signal.ITIMER_REAL, WAITING)
        start = time.process_time()
        try:
            read_flow(path)
            kind, message = "accepted", ""
        except Exception as error:
            kind, message = type(error).__name__, str(error)
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
        seconds = time.process_time() - start
        print(json.dumps([path, kind, message, seconds]), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
