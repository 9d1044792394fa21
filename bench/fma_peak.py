"""The multiply-add peak of one core, measured by a small program that is compiled for it.

python -m bench.fma_peak

The benchmarks give the speed of a kernel on the CPU as a share of this rate.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import shlex
import subprocess
import tempfile
from functools import cache
from pathlib import Path

SOURCE = Path(__file__).with_suffix(".cpp")


@cache
def fma_peak(seconds: float = 1.0) -> float:
    """Rate of independent float32 multiply-adds on one core, GFLOP/s, in a run of `seconds`.

    The compiler is $CXX, or c++.

    Raises:
        RuntimeError: there is no such compiler, or it refuses the program.
    """
    compiler = shlex.split(os.environ.get("CXX", "c++"))
    flags = ["-O3", "-march=native", "-std=c++17", "-shared", "-fPIC"]
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "fma_peak.so"
        command = [*compiler, *flags, str(SOURCE), "-o", str(library)]
        try:
            subprocess.run(command, capture_output=True, text=True, check=True)
        except OSError as error:
            raise RuntimeError(
                f"{compiler[0]} must be a C++ compiler, got {error.strerror}: set CXX"
            ) from error
        except subprocess.CalledProcessError as error:
            raise RuntimeError(f"{shlex.join(command)} failed: {error.stderr.strip()}") from error
        measure = ctypes.CDLL(str(library)).fma_peak
    measure.argtypes, measure.restype = [ctypes.c_double], ctypes.c_double
    return float(measure(seconds))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--seconds", type=float, default=1.0)
    print(f"{fma_peak(parser.parse_args().seconds):.1f} GFLOP/s")


if __name__ == "__main__":
    main()
