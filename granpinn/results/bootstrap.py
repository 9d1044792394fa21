"""The record of a parametric bootstrap: laws identified in simulations with the identified law.

It is a statement about flows of exactly this law, made by the simulator of granpinn and sampled as
the data are (identification/bootstrap.py). It contains neither the departure of nature from the law
nor the errors of another solver.
"""

from __future__ import annotations

from dataclasses import dataclass, field

FEWEST = 2  # flows that have a scatter
HEAD = ("", "bias", "scatter", "rms error", "stated std")


@dataclass(frozen=True)
class Recovery:
    """How far identifications were off one number of the law.

    Attributes:
        value: of the identified law, with which the flows were simulated.
        bias: mean error over the flows; scatter: standard deviation of the errors; rms: root mean
            square error.
        bias_error, scatter_error, rms_error: their standard errors.
        std: standard deviation by the error bars of the result; None where there are none.
    """

    value: float
    bias: float
    bias_error: float
    scatter: float
    scatter_error: float
    rms: float
    rms_error: float
    std: float | None = None

    def __post_init__(self) -> None:
        for name in ("bias_error", "scatter", "scatter_error", "rms", "rms_error", "std"):
            if (value := getattr(self, name)) is not None and value < 0:
                raise ValueError(f"{name} must not be negative, got {value}")

    @property
    def exceeds(self) -> bool:
        """Whether the rms error is larger than the stated standard deviation, by more than two
        standard errors."""
        return self.std is not None and self.rms - 2 * self.rms_error > self.std

    @property
    def texts(self) -> tuple[str, ...]:
        """Bias, scatter, rms error and stated standard deviation with four digits."""
        return (
            f"{self.bias:+.4f} +- {self.bias_error:.4f}",
            f"{self.scatter:.4f} +- {self.scatter_error:.4f}",
            f"{self.rms:.4f} +- {self.rms_error:.4f}",
            "-" if self.std is None else f"{self.std:.4f}",
        )


@dataclass(frozen=True)
class Bootstrap:
    """Identifications of simulated flows (identification/bootstrap.py).

    `objection` is the reason for the lack of a simulation; the record is then empty.

    Attributes:
        flows: number of simulated flows whose identification ended.
        diverged: number of those whose training diverged; they do not count.
        cells: across the box, or across the layer.
        steps: of every training.
        noise_percent: standard deviation of the noise that was drawn for u and for v, relative to
            the rms speed of the data; `--noise` comes on top.
        vectors_per_independent: of this noise, 1 for white noise.
        noise_left_out: the number that was measured where the drawn noise is white all the same.
        seconds: for simulations and trainings.
        parameters: the identified parameters.
        I: inertial numbers of the data [n]; friction: mu at each of them.
    """

    objection: str | None
    flows: int = 0
    diverged: int = 0
    cells: int | None = None
    steps: int | None = None
    noise_percent: float | None = None
    vectors_per_independent: float = 1.0
    noise_left_out: float | None = None
    seconds: float | None = None
    parameters: dict[str, Recovery] = field(default_factory=dict)
    I: tuple[float, ...] = ()  # noqa: E741 (the inertial number's own symbol)
    friction: tuple[Recovery, ...] = ()

    def __post_init__(self) -> None:
        if len(self.I) != len(self.friction):
            raise ValueError(
                f"I and friction must have equally many values, got {len(self.I)} and "
                f"{len(self.friction)}"
            )
        if self.objection is None and self.flows < FEWEST:
            raise ValueError(f"flows must be at least {FEWEST}, got {self.flows}")

    def __str__(self) -> str:
        """The lines for the terminal."""
        if self.objection is not None:
            return f"no flows simulated with this law: {self.objection}"
        rows = [HEAD, *((name, *row.texts) for name, row in self.rows)]
        lines = [self.words, *("{:12s}{:>18s}{:>17s}{:>17s}{:>12s}".format(*row) for row in rows)]
        return "\n".join(lines)

    @property
    def rows(self) -> list[tuple[str, Recovery]]:
        """The parameters, then mu at every I, with their names."""
        names = [f"mu({number:.2g})" for number in self.I]
        return [*self.parameters.items(), *zip(names, self.friction, strict=True)]

    @property
    def words(self) -> str:
        """What was done, in words."""
        lost = f", {self.diverged} more diverged" if self.diverged else ""
        return (
            f"errors in {self.flows} flows that were simulated with this law and identified in the "
            f"same way ({self.cells} cells, {self.noise}{lost}):"
        )

    @property
    def noise(self) -> str:
        """The noise that was drawn, in words."""
        percent = f"{self.noise_percent or 0.0:.2f}"
        if not float(percent):
            return "no noise to draw"
        size = f"noise of {percent} % of the rms speed"
        if self.noise_left_out is not None:
            return (
                f"white {size}, although {self.noise_left_out:.2g} measured vectors count as one "
                f"independent one"
            )
        if self.vectors_per_independent > 1:
            number = f"{self.vectors_per_independent:.2g}"
            return f"correlated {size}, {number} vectors for one independent one"
        return f"white {size}"
