"""The compiled operators: one library for each minor release of torch, chosen at import.

The C++ interface of torch changes from one minor release to the next. So the operators of csrc/ops
are compiled for each of them, while all share the kernels, which do not depend on torch:

    libgranpinn_torch_2.13.so       the operators for torch 2.13, with the kernels for CPUs
    libgranpinn_torch_2.13_cuda.so  those for GPUs, loaded into a torch with the same CUDA

A wheel has several of them. A build from source has that of the torch it was built against.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path

import torch

from granpinn.config import ConfigError
from granpinn.errors import CannotGoOn

REBUILD = "build granpinn from source against this torch (pip install --no-build-isolation .)"


class WrongTorch(CannotGoOn, ImportError):
    """There are no operators for the torch that is installed."""


def choose(found: str, built: Sequence[str]) -> str:
    """The version of torch in `built` whose operators fit torch `found`.

    Args:
        found: a version such as 2.13.0+cpu.
        built: the versions that operators were compiled for, the oldest first.

    Raises:
        WrongTorch: there are none; the message says which torch to install.
    """
    for version in built:
        if _minor(version) == _minor(found):
            return version
    oldest, newest = (_minor(built[i]) for i in (0, -1))
    after = f"{newest[0]}.{newest[1] + 1}"
    first, last = (".".join(map(str, minor)) for minor in (oldest, newest))
    which = f"torch {first}" + (f" to {last}" if first != last else "")
    raise WrongTorch(
        f"granpinn's operators are compiled for {which}, but torch {found} is installed: "
        f"run pip install 'torch>={first},<{after}', or {REBUILD}"
    )


def why_no_cuda(found: str | None, compiler: str, missing: str) -> str:
    """Why the operators for GPUs cannot be used; empty where they can.

    Args:
        found: version of CUDA of the torch that is installed; None in a build without CUDA.
        compiler: the CUDA compiler of the kernels, such as NVIDIA 13.0.88.
        missing: why the kernels were not built; empty where they were.
    """
    if missing:
        return missing
    built = compiler.split()[-1].split(".")[0]
    if found is None:
        return f"torch is a build without CUDA, install one for CUDA {built}"
    if found.split(".")[0] != built:
        return f"they are built for CUDA {built}, but torch for CUDA {found}"
    return ""


def load() -> None:
    """Registers torch.ops.granpinn for the torch that is installed.

    Raises:
        ImportError: the operators are not built, or do not fit this torch (WrongTorch).
    """
    try:
        module = import_module("granpinn._C")
    except ImportError as error:
        raise ImportError(
            "granpinn's kernels are not built for this Python: build them from a clone with "
            "pip install --no-build-isolation -e . (python -m granpinn.doctor says more)"
        ) from error
    folder = Path(str(module.__file__)).parent
    name = f"libgranpinn_torch_{'{}.{}'.format(*_minor(torch_build()))}"
    _load(folder / f"{name}.so")
    if not cuda_missing():
        _load(folder / f"{name}_cuda.so")


def torch_build() -> str:
    """The version of torch that the operators in use were compiled for; WrongTorch if none fit."""
    return choose(torch.__version__, _build_info()["torch_versions"].split())


def cuda_missing() -> str:
    """Why the operators for GPUs cannot be used with this granpinn and torch; empty: they can."""
    info = _build_info()
    return why_no_cuda(torch.version.cuda, info["cuda_compiler"], info["cuda_missing"])


def choose_device(name: str) -> torch.device:
    """The device for "auto", "cpu" or "cuda"; ConfigError if it cannot be used."""
    kernels = torch._C._dispatch_has_kernel_for_dispatch_key("granpinn::residual_loss", "CUDA")
    if name == "cuda" and not kernels:
        raise ConfigError(
            f"--device cuda needs the CUDA kernels ({cuda_missing()}): install the wheel "
            "with them, or build granpinn where nvcc is, or use --device cpu"
        )
    if name == "cuda" and not torch.cuda.is_available():
        raise ConfigError(
            "--device cuda needs a GPU that torch can use, and torch.cuda.is_available() is false: "
            "python -m granpinn.doctor says why; or use --device cpu"
        )
    usable = kernels and torch.cuda.is_available()
    return torch.device("cuda" if usable and name != "cpu" else "cpu")


def wake(name: str) -> None:
    """Create the context of the GPU, in a thread beside other work: it takes 0.4 s."""
    with suppress(ConfigError, RuntimeError):  # the training says why there is none
        torch.empty(1, device=choose_device(name))


def _build_info() -> dict[str, str]:
    found: dict[str, str] = import_module("granpinn._C").build_info()
    return found


def _minor(version: str) -> tuple[int, int]:
    major, minor = version.split(".")[:2]
    return int(major), int(minor)


def _load(path: Path) -> None:
    try:
        torch.ops.load_library(str(path))  # type: ignore[no-untyped-call]
    except OSError as error:
        raise WrongTorch(
            f"granpinn's operators do not fit torch {torch.__version__}, which differs from the "
            f"release of that number ({error}): install the release, or {REBUILD}"
        ) from error
