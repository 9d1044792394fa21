"""The file network.safetensors of a trained network.

The file holds the parameters of the network and of the law as they are after the whole training,
and the constants to evaluate both. Reading it executes no code.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import torch

from granpinn.data.flow import Units
from granpinn.errors import BadInput
from granpinn.fit.network import TrainedNetwork
from granpinn.kernels.network import NetworkSpec
from granpinn.output import write_bytes
from granpinn.physics.axes import Axes
from granpinn.physics.constants import Physics
from granpinn.physics.laws import LAWS
from granpinn.physics.scales import Scales
from granpinn.regular import UnsafeFileError, read_regular_file
from granpinn.training.tensor_file import packed, unpacked

FILE = "network.safetensors"
FORMAT = "granpinn-network", 2  # name and version
MAX_BYTES = 2**30


class NetworkFileError(BadInput):
    """network.safetensors is missing, damaged or of another version; one sentence."""


@dataclass(frozen=True)
class _Record:
    """What is no tensor; the constants may be infinite, so their values are one."""

    law: str
    form: str
    widths: tuple[int, ...]
    input_shift: tuple[float, float, float]
    input_scale: tuple[float, float, float]
    constants: tuple[str, ...]
    scales: Scales
    axes: Axes
    units: Units


def write_network(network: TrainedNetwork, path: str | Path) -> None:
    """Write network.safetensors; OutputError if it cannot be written."""
    spec = network.spec
    record = _Record(
        law=network.law.name,
        form=spec.form,
        widths=spec.widths,
        input_shift=spec.input_shift,  # type: ignore[arg-type]  # of one network, no tensor
        input_scale=spec.input_scale,  # type: ignore[arg-type]
        constants=Physics._fields,
        scales=network.scales,
        axes=network.axes,
        units=network.units,
    )
    physics = torch.tensor(network.physics, dtype=torch.float64)
    tensors = {"physics": physics, "params": network.params, "theta": network.theta}
    write_bytes(path, packed(*FORMAT, record, tensors))


def read_network(path: str | Path) -> TrainedNetwork:
    """Read network.safetensors; the message of NetworkFileError is one sentence."""
    path = Path(path)
    try:
        content = read_regular_file(path, MAX_BYTES, "it is no network of granpinn")
    except UnsafeFileError as error:
        raise NetworkFileError(f"{path}: {error}") from None
    try:
        return _unpacked(content)
    except (ValueError, TypeError, LookupError) as error:
        reason = " ".join(str(error).split())[:160]
        raise NetworkFileError(
            f"{path} cannot be read as {FORMAT[0]} ({reason}): take the file of the run again"
        ) from None


def _unpacked(content: bytes) -> TrainedNetwork:
    record, tensors = unpacked(content, *FORMAT, _Record)
    if record.law not in LAWS:
        raise ValueError(f"the law {record.law} is not known: granpinn.laws.register adds it")
    if record.constants != Physics._fields:
        raise ValueError("another version of granpinn wrote it")
    spec = NetworkSpec(record.widths, record.input_shift, record.input_scale, record.form)
    params, theta, law = tensors["params"], tensors["theta"], LAWS[record.law]
    if params.shape != (spec.n_params,) or theta.shape != (len(law.names),):
        raise ValueError(f"params {list(params.shape)} and theta {list(theta.shape)} do not fit")
    if not (torch.isfinite(params).all() and torch.isfinite(theta).all()):
        raise ValueError("it holds a NaN or an infinity")
    if params.dtype != theta.dtype or params.dtype not in (torch.float32, torch.float64):
        raise ValueError(f"params must be float32 or float64 like theta, got {params.dtype}")
    physics = Physics(*tensors["physics"].tolist())
    return TrainedNetwork(
        spec, physics, params, theta, record.scales, law, record.axes, record.units
    )
