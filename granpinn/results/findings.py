"""Optional parts of a result beside the identified values: final loss, profile of I0, simulations.

Each field is None (null in results.json) if it was not computed or has no meaning.
"""

from __future__ import annotations

from dataclasses import dataclass

from granpinn.results.parameters import Parameters


@dataclass(frozen=True)
class Loss:
    """The loss at the end of a training, over many points (identification/final_loss.py).

    Attributes:
        n_points: points inside the grains.
        terms: half the mean square of every residual by `terms.NAMES`, dimensionless.
        weights: 1/sigma^2 of every term at the end of the training.
    """

    n_points: int
    terms: dict[str, float]
    weights: dict[str, float]

    def total(self, weights: dict[str, float] | None = None) -> float:
        """The sum of the weighted terms, by default with the weights of the training."""
        chosen = weights or self.weights
        return sum(chosen[name] * term for name, term in self.terms.items())


@dataclass(frozen=True)
class ProfilePoint:
    """One value of I0 of mu(I): the law that was identified with it, and whether it is excluded.

    Attributes:
        mu_s, mu_2, slope: means over the seeds; slope = (mu_2 - mu_s) / I0.
        loss_rise: loss minus the loss at the best I0 with the same seed, mean over the seeds.
        law_difference: largest |mu(I) - mu(I) at the best I0| over the I that the data cover.
        excluded: whether the data exclude this I0.
    """

    I0: float
    mu_s: float
    mu_2: float
    slope: float
    loss_rise: float
    law_difference: float
    excluded: bool


@dataclass(frozen=True)
class Profile:
    """The profile of the loss over I0 of mu(I) and its meaning (inertial_profile.py).

    Attributes:
        points: in increasing I0.
        n_seeds: number of finished trainings at each value.
        smallest_rise: a rise of the loss up to this is scatter of the training.
        law_accuracy: laws that differ by no more than this count as equal.
        I_low, I_high: the inertial numbers that the data cover (5 % and 95 % quantiles).
        best: I0 of the least loss where the data separate it, else None.
        allowed: lower and upper bound of I0; None where the grid excludes no value at that side.
        slope, slope_std: (mu_2 - mu_s) / I0 at the I0 of the run, and its scatter over the seeds.
        correlation: of mu_2 with I0 over all trainings at values that are not excluded.
        mu_2_by_I0: d mu_2 / d I0 at the I0 of the run.
        status: "separable", "lower bound", "upper bound", "not separable".
        answer: the status in a sentence.
        unknown: mu_s, slope and I0 where I0 is not known, each with a 90 % interval or not
            determined (uncertainty/unknown_I0.py); None: the run has no error bars.
    """

    points: tuple[ProfilePoint, ...]
    n_seeds: int
    smallest_rise: float
    law_accuracy: float
    I_low: float
    I_high: float
    best: float | None
    allowed: tuple[float | None, float | None]
    slope: float
    slope_std: float
    correlation: float | None
    mu_2_by_I0: float
    status: str
    answer: str
    unknown: Parameters | None = None

    def __post_init__(self) -> None:
        if not self.points:
            raise ValueError("points must hold at least one value of I0, got none")

    def __str__(self) -> str:
        """The lines for the terminal."""
        lines = [f"{'I0':>9s}{'mu_s':>9s}{'mu_2':>9s}{'slope':>9s}{'loss':>11s}{'law':>9s}"]
        for p in self.points:
            numbers = f"{p.I0:9.4f}{p.mu_s:9.4f}{p.mu_2:9.4f}{p.slope:9.3f}"
            lines.append(
                f"{numbers}{p.loss_rise:+11.2e}{p.law_difference:9.4f}"
                f"{'  excluded' if p.excluded else ''}"
            )
        correlation = "-" if self.correlation is None else f"{self.correlation:+.2f}"
        lines.append(
            f"slope (mu_2 - mu_s)/I0 {self.slope:.3f} +- {self.slope_std:.3f}, d mu_2/d I0 "
            f"{self.mu_2_by_I0:+.2f}, correlation of mu_2 with I0 {correlation}"
        )
        return "\n".join([*lines, self.answer, self._unknown()])

    def _unknown(self) -> str:
        """The line on the parameters where I0 is not known."""
        if self.unknown is None:
            return "with I0 unknown: no error bars, as the run has none"
        words = [f"{name} {p.words}" for name, p in self.unknown.items()]
        return f"with I0 unknown (90 % intervals): {', '.join(words)}"


@dataclass(frozen=True)
class SimulatorFit:
    """The mu(I) law whose simulation is closest to the data (second_opinion/simulator_fit.py).

    Attributes:
        mu_s, mu_2: at the least misfit.
        std: of both, by noise and the roughness of runs, without the error of the simulator.
        misfit_percent: of the velocity, relative to its root mean square.
        common_percent: share of the points that all simulations have.
        inside: whether the least misfit lies among the laws that were simulated.
        cells: across the box, in the last simulations; runs: number of all simulations.
        I0, I0_std, correlation: where I0 was fitted too, and its correlation with mu_2; else None.
    """

    mu_s: float
    mu_2: float
    std: tuple[float, float]
    misfit_percent: float
    common_percent: float
    inside: bool
    cells: int
    runs: int
    seconds: float
    I0: float | None = None
    I0_std: float | None = None
    correlation: float | None = None

    def __str__(self) -> str:
        """The line for the terminal."""
        doubt = "" if self.inside else "; NOT a minimum: it lies outside of the simulated laws"
        third = "" if self.I0 is None else f", I0 {self.I0:.4f}"
        third_std = "" if self.I0_std is None else f", {self.I0_std:.4f}"
        if self.correlation is not None:
            third_std += f", correlation of mu_2 with I0 {self.correlation:+.2f}"
        return (
            f"fitted by the simulator: mu_s {self.mu_s:.4f}, mu_2 {self.mu_2:.4f}{third} (noise "
            f"and rough runs: +- {self.std[0]:.4f}, {self.std[1]:.4f}{third_std}; {self.runs} "
            f"runs, the last on {self.cells} cells, misfit {self.misfit_percent:.2f} %{doubt})"
        )


NO_FIT_OF_LAYERS = "no fit of the simulator, which exists for collapses alone"


@dataclass(frozen=True)
class Resimulation:
    """The data against a simulation with the identified law (second_opinion/resimulation.py).

    `objection` is the reason for the lack of a simulation; all numbers are then None.

    Attributes:
        cells: across the box.
        column: width and height of the column at the start, in the units of the file; None for a
            layer on a slope, which has no front either.
        layer: depth of this layer.
        velocity_percent: relative L2 error of the velocity over the common points, eq. (errorL2).
        common_percent: share of the points of the data that the simulation has too.
        front_percent, front_worst_percent: rms and largest difference of the fronts, relative to
            the initial height.
        profile_percent: rms difference of the surface profiles, relative to the initial height.
        fit: the law whose simulation is closest to the data.
    """

    objection: str | None
    cells: int | None = None
    column: tuple[float, float] | None = None
    seconds: float | None = None
    velocity_percent: float | None = None
    common_percent: float | None = None
    front_percent: float | None = None
    front_worst_percent: float | None = None
    profile_percent: float | None = None
    layer: float | None = None
    fit: SimulatorFit | None = None

    def __str__(self) -> str:
        """The lines for the terminal."""
        if self.objection is not None:
            return f"not simulated again: {self.objection}"
        check = (
            f"simulated again with this law: velocity off by {self.velocity_percent:.2f} % on "
            f"{self.common_percent:.0f} % of the points"
        )
        if self.layer is not None:
            return f"{check}; {NO_FIT_OF_LAYERS}"
        check += (
            f", front by {self.front_percent:.2f} % and surface by {self.profile_percent:.2f} % of "
            f"the initial height (rms)"
        )
        return check if self.fit is None else f"{check}\n{self.fit}"


@dataclass(frozen=True)
class SimulatedPressure:
    """The simulated pressure at some frames (second_opinion/simulated_pressure.py).

    Attributes:
        objection: the reason for its absence; all numbers are then None.
        cells: across the box.
        frames: indices of the frames that have a simulated pressure.
        failed: frames at which a solve did not converge.
        late: frames that the time limit left out.
        seconds: for all frames.
        flowing_percent, stagnant_percent: rms difference of the predicted and the simulated
            pressure over the rms of the simulated one, by zones (identification/scoring.py); None
            for an empty zone.
    """

    objection: str | None
    cells: int | None = None
    frames: tuple[int, ...] = ()
    failed: int = 0
    late: int = 0
    seconds: float | None = None
    flowing_percent: float | None = None
    stagnant_percent: float | None = None

    def __str__(self) -> str:
        """The line for the terminal."""
        if self.objection is not None:
            return f"no simulated pressure: {self.objection}"
        if not self.frames:
            return f"no simulated pressure{self.left_out}"
        zones = {"flowing": self.flowing_percent, "resting": self.stagnant_percent}
        parts = [f"{p:.1f} % in {zone} grains" for zone, p in zones.items() if p is not None]
        return (
            f"simulated pressure at {len(self.frames)} times: the predicted pressure differs by "
            f"{' and '.join(parts) or 'an unknown amount'}{self.left_out}"
        )

    @property
    def left_out(self) -> str:
        """The number of frames without a simulated pressure and the reasons, in brackets, or ""."""
        parts = [f"{self.failed} did not converge"] if self.failed else []
        parts += [f"{self.late} had no time left"] if self.late else []
        return f" (left out: {', '.join(parts)})" if parts else ""
