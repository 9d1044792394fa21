r"""A trained network with its law, and what it predicts at any point.

From the network and the identified parameters,

$$ D_2 = \sqrt{D:D}, \quad \dot\gamma = \sqrt{2}\,D_2, \quad I = d\,\dot\gamma/\sqrt{|p|/\rho},
   \quad \eta = \mu(I)\,p/\dot\gamma \ \text{inside its limits,} $$

the deviatoric stress tau (an output of the network in the mixed form, 2 eta D in the strong form),
and the residual of the strong momentum equation, for both forms.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from granpinn.arrays import Float32, Float64, plain_array
from granpinn.data.flow import Particles, Units
from granpinn.errors import BadInput
from granpinn.kernels import ops
from granpinn.kernels.network import NetworkSpec
from granpinn.physics.axes import Axes
from granpinn.physics.constants import Physics
from granpinn.physics.laws import FrictionLaw
from granpinn.physics.scales import Quantity, Scales
from granpinn.results.fields import VARIABLES
from granpinn.training.operators import operators_of

CHUNK = 32768  # points per evaluation: bounds the memory and leaves the values as they are
SMOOTHING = 1e-12  # gamma_dot^2 + SMOOTHING, as in the residuals: no division by zero at rest


@dataclass(frozen=True)
class TrainedNetwork:
    """A trained network with the friction law that was identified with it.

    Attributes:
        spec: widths, input map and form of the network.
        physics: constants of the equations.
        params: parameters of the network [P].
        theta: parameters of the law, in its order [N], dimensionless.
        scales: units of everything dimensionless.
        axes: of the training.
        units: of the flow.
    """

    spec: NetworkSpec
    physics: Physics
    params: Tensor
    theta: Tensor
    scales: Scales
    law: FrictionLaw
    axes: Axes
    units: Units

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
            points = self.scales.points_to_dimensionless(*plain)
        except ValueError as error:
            raise BadInput(
                f"x, y and t must be numbers of shapes that broadcast: {error}"
            ) from None
        shape = points.shape[:-1]
        found = self.at(torch.as_tensor(points.reshape(-1, 3)))
        return {name: values.reshape(shape) for name, values in found.items()}

    def apart(self) -> TrainedNetwork:
        """The same on the CPU, without memory in common with the training."""
        params, theta = (part.detach().cpu().clone() for part in (self.params, self.theta))
        return replace(self, params=params, theta=theta)

    def at(self, points: Tensor) -> dict[str, Float32]:
        """The predicted `fields.VARIABLES` [N] in the units and axes of the flow.

        Args:
            points: (x, y, t) [N, 3] in the axes of the flow, dimensionless.
        """
        values: dict[str, Float32] = {}
        for start in range(0, len(points), CHUNK):
            found = self.evaluate(self._turned(points[start : start + CHUNK]))
            for name, value in self._turned_back(found).items():
                if name not in values:
                    values[name] = np.empty(len(points), np.float32)
                kind = VARIABLES[name][0]
                if kind in get_args(Quantity):
                    value = self.scales.to_physical(value, kind)  # type: ignore[arg-type]
                values[name][start : start + CHUNK] = value.cpu().numpy()
        return values

    @torch.no_grad()
    def velocity_at(self, particles: Particles) -> Float64:
        """Predicted (u, v) at scattered vectors, [2, n] in their units."""
        points = self.scales.points_to_dimensionless(particles.x, particles.y, particles.t)
        parts = [
            ops.network_value(self._turned(part), self.params, *self._network)[:, :2].cpu()
            for part in torch.split(torch.as_tensor(points), CHUNK)
        ]
        scales = np.array(self.physics.velocity_scales)[:, None]
        turned = scales * torch.cat(parts).double().numpy().T
        predicted = np.stack(self.axes.undo(turned[0], turned[1]))
        return np.asarray(self.scales.to_physical(predicted, "velocity"))

    @property
    def _network(self) -> tuple[list[int], list[float], list[float]]:
        return list(self.spec.widths), list(self.spec.input_shift), list(self.spec.input_scale)

    def _turned(self, points: Tensor) -> Tensor:
        """Points [N, 3] = (x, y, t) in the axes of the training, like the parameters."""
        x, y, t = points.unbind(1)
        return torch.stack([*self.axes.turn(x, y), t], 1).to(self.params)

    def _turned_back(self, values: dict[str, Tensor]) -> dict[str, Tensor]:
        """The values of `evaluate` in the axes of the flow."""
        found = dict(values)
        for x, y in (("u", "v"), ("momentum_residual_x", "momentum_residual_y")):
            found[x], found[y] = self.axes.undo(values[x], values[y])
        stress = values["tau_xx"], values["tau_xy"]
        found["tau_xx"], found["tau_xy"] = self.axes.undo_stress(*stress)
        return found

    @torch.no_grad()
    def evaluate(self, points: Tensor) -> dict[str, Tensor]:
        """The predicted `fields.VARIABLES` at points [N, 3] = (x, y, t), each [N], dimensionless.

        All in the axes of the training.
        """
        spec, theta, physics = self.spec, self.theta, self.physics
        (U, V), P = physics.velocity_scales, physics.pressure_scale
        jets = ops.network_jet(points, self.params, *self._network, 2)
        z, z_x, z_y = jets[:3]
        u, v = U * z[:, 0], V * z[:, 1]
        D_xx, D_yy = U * z_x[:, 0], V * z_y[:, 1]
        D_xy = (U * z_y[:, 0] + V * z_x[:, 1]) / 2
        p = P * (torch.nn.functional.softplus(z[:, 2]) if spec.form == "mixed" else z[:, 2])
        D_squared = D_xx**2 + 2 * D_xy**2 + D_yy**2
        gamma_dot = torch.sqrt(2 * D_squared + SMOOTHING)
        d, floor = physics.grain_diameter, physics.pressure_floor
        limits = physics.eta_min, physics.eta_max
        operators, law = operators_of([self.law]), self.law.name
        eta = operators.viscosity(gamma_dot, p, theta, d, *limits, floor, law)
        if spec.form == "mixed":
            tau_xx, tau_xy = p * z[:, 3], p * z[:, 4]
        else:
            tau_xx, tau_xy = eta * (D_xx - D_yy), 2 * eta * D_xy
        residual = operators.pointwise_residuals(jets, theta, list(physics), "strong", law)
        e_u, e_v, divergence = residual.unbind(1)
        return {
            "u": u,
            "v": v,
            "p": p,
            "tau_xx": tau_xx,
            "tau_xy": tau_xy,
            "D2": torch.sqrt(D_squared),
            "I": physics.inertial_number(gamma_dot, p),
            "eta": eta,
            "momentum_residual_x": e_u,
            "momentum_residual_y": e_v,
            "divergence": divergence,
        }
