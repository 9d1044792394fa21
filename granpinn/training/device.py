"""The device of a training, by the name in the settings."""

from __future__ import annotations

from contextlib import suppress

import torch

from granpinn.config import ConfigError
from granpinn.kernels import builds


def choose_device(name: str) -> torch.device:
    """The device for "auto", "cpu" or "cuda"; ConfigError if it cannot be used."""
    kernels = torch._C._dispatch_has_kernel_for_dispatch_key("granpinn::residual_loss", "CUDA")
    if name == "cuda" and not kernels:
        raise ConfigError(
            f"--device cuda needs the CUDA kernels ({builds.cuda_missing()}): install the wheel "
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
