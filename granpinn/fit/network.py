"""A trained network in the units and axes of its flow, and its file network.safetensors.

The file holds the parameters of the network and of the law as they are after the whole training,
and the constants to evaluate both. Reading it executes no code.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy.typing as npt
import safetensors.torch as safetensors
import torch
from safetensors import SafetensorError

from granpinn.arrays import Float32, plain_array
from granpinn.data import Flow
from granpinn.data.symmetry import axes_of
from granpinn.errors import BadInput
from granpinn.fit.case import Model
from granpinn.fit.prediction import values_at
from granpinn.kernels.network import NetworkSpec
from granpinn.output import write_bytes
from granpinn.physics.axes import Axes
from granpinn.physics.constants import Physics
from granpinn.physics.laws import LAWS
from granpinn.physics.scales import Scales
from granpinn.regular import UnsafeFileError, read_regular_file
from granpinn.results.decoding import decode, encode
from granpinn.results.fields import Units

FILE = "network.safetensors"
FORMAT_NAME = "granpinn-network"
FORMAT_VERSION = 1
MAX_BYTES = 2**30
LENGTH = 8  # bytes at the start of a safetensors file: the length of its JSON header


class NetworkFileError(BadInput):
    """network.safetensors is missing, damaged or of another version; one sentence."""


@dataclass(frozen=True)
class TrainedNetwork:
    """A network with its law, on the CPU.

    Attributes:
        model: network and law, dimensionless.
        axes: of the training.
        units: of the flow.
    """

    model: Model
    axes: Axes
    units: Units

    @classmethod
    def of(cls, model: Model, flow: Flow) -> TrainedNetwork:
        """The network of a flow; it shares no memory with the training."""
        params, theta = (part.detach().cpu().clone() for part in (model.params, model.theta))
        kept = Model(model.spec, model.physics, params, theta, model.scales, model.law)
        units = Units(flow.length_unit, flow.time_unit, flow.density_unit)
        return cls(kept, axes_of(flow), units)

    def predict(self, x: npt.ArrayLike, y: npt.ArrayLike, t: npt.ArrayLike) -> dict[str, Float32]:
        """The predicted fields at points, in the units and axes of the flow.

        The network extrapolates where there are no grains, and after the last frame.

        Args:
            x, y, t: positions and times of shapes that broadcast.

        Returns:
            The variables of fields.h5 by name, without references, each in the common shape.
        """
        try:
            plain = (plain_array(a, name) for name, a in (("x", x), ("y", y), ("t", t)))
            points = self.model.scales.points_to_dimensionless(*plain)
        except ValueError as error:
            raise BadInput(
                f"x, y and t must be numbers of shapes that broadcast: {error}"
            ) from None
        shape = points.shape[:-1]
        found = values_at(torch.as_tensor(points.reshape(-1, 3)), self.axes, self.model)
        return {name: values.reshape(shape) for name, values in found.items()}


@dataclass(frozen=True)
class _Header:
    """The text of the file; numbers that may be infinite are in its tensors."""

    law: str
    form: str
    widths: tuple[int, ...]
    constants: tuple[str, ...]
    scales: dict[str, float]
    origin: tuple[float, float, float]
    axes: dict[str, float]
    gravity: tuple[float, float]
    units: dict[str, str]


def write_network(network: TrainedNetwork, path: str | Path) -> None:
    """Write network.safetensors; OutputError if it cannot be written."""
    model = network.model
    scales = asdict(model.scales)
    header = _Header(
        law=model.law.name,
        form=model.spec.form,
        widths=model.spec.widths,
        constants=Physics._fields,
        origin=scales.pop("origin"),
        scales=scales,
        axes={"cos": network.axes.cos, "sin": network.axes.sin},
        gravity=network.axes.gravity,
        units={name: unit for name, unit in asdict(network.units).items() if unit is not None},
    )
    head = {"format_name": FORMAT_NAME, "format_version": FORMAT_VERSION}
    text = json.dumps(head | encode(header), allow_nan=False)
    numbers = {
        "physics": tuple(model.physics),
        "input_shift": model.spec.input_shift,
        "input_scale": model.spec.input_scale,
    }
    tensors = {name: torch.tensor(v, dtype=torch.float64) for name, v in numbers.items()}
    tensors |= {"params": model.params.contiguous(), "theta": model.theta.contiguous()}
    write_bytes(path, safetensors.save(tensors, {"granpinn": text}))


def read_network(path: str | Path) -> TrainedNetwork:
    """Read network.safetensors; the message of NetworkFileError is one sentence."""
    path = Path(path)
    try:
        content = read_regular_file(path, MAX_BYTES, "it is no network of granpinn")
    except UnsafeFileError as error:
        raise NetworkFileError(f"{path}: {error}") from None
    try:
        return _decoded(content)
    except (SafetensorError, ValueError, TypeError, LookupError, RecursionError) as error:
        reason = " ".join(str(error).split())[:160]
        raise NetworkFileError(
            f"{path} cannot be read as {FORMAT_NAME} ({reason}): take the file of the run again"
        ) from None


def _decoded(content: bytes) -> TrainedNetwork:
    length = int.from_bytes(content[:LENGTH], "little")
    head: Any = json.loads(content[LENGTH : LENGTH + length])
    named: Any = json.loads(head["__metadata__"]["granpinn"])
    if not isinstance(named, dict):
        raise ValueError(f"expected an object, got {type(named).__name__}")
    found = named.pop("format_name", None), named.pop("format_version", None)
    if found != (FORMAT_NAME, FORMAT_VERSION):
        raise ValueError(f"expected version {FORMAT_VERSION}, got {found[0]} version {found[1]}")
    header = decode(_Header, named)
    if header.law not in LAWS:
        raise ValueError(f"the law {header.law} is not known: granpinn.laws.register adds it")
    if header.constants != Physics._fields:
        raise ValueError("another version of granpinn wrote it")
    tensors = safetensors.load(content)
    shift, scale, physics = (
        tuple(tensors[name].tolist()) for name in ("input_shift", "input_scale", "physics")
    )
    spec = NetworkSpec(header.widths, shift, scale, header.form)
    params, theta, law = tensors["params"], tensors["theta"], LAWS[header.law]
    fits = params.shape == (spec.n_params,) and theta.shape == (len(law.names),)
    if not (fits and len(shift) == len(scale) == 3):
        raise ValueError(f"params {list(params.shape)} and theta {list(theta.shape)} do not fit")
    if not (torch.isfinite(params).all() and torch.isfinite(theta).all()):
        raise ValueError("it holds a NaN or an infinity")
    if params.dtype != theta.dtype or params.dtype not in (torch.float32, torch.float64):
        raise ValueError(f"params must be float32 or float64 like theta, got {params.dtype}")
    scales = Scales(**header.scales, origin=header.origin)
    model = Model(spec, Physics(*physics), params, theta, scales, law)
    axes = Axes(**header.axes, gravity=header.gravity)
    return TrainedNetwork(model, axes, Units(**header.units))
