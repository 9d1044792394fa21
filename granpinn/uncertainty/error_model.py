r"""One model of the errors of an identified mu(I), from what a run knows of its own accuracy.

With x = I/(I + I0) the law is a line, mu = mu_s (1 - x) + mu_2 x. Data determine it between the
smallest and the largest x that they hold (5 % and 95 % of the points that shear). The errors of
log mu at these two ends have Student's distribution with the standard deviations

$$ \log s_k = c_k + \sum_j b_{kj} f_j, \qquad k = \text{lower}, \text{upper}, $$

one correlation, and stated degrees of freedom. The features f_j are logarithms of six quantities:

- noise: $\sigma \sqrt{1000 / N} / \mu$, with the noise sigma of a vector over the rms velocity, N
  independent vectors, and mu at the lower end;
- misfit: the error of the fitted velocity, its misfit beyond the noise and a part of the noise;
- law: the residual of the friction law;
- steps: the usual number of steps over those of the training;
- reach: the largest x;
- contrast: mu at the upper end over mu at the lower end.

The first three count where they exceed a knee k, as f = log hypot(1, value/k). One more feature is
0 in most flows: the outline is 1/hypot(1, noise/k) without a line of the free surface (level V0).
Where noise prevails, it matters little where the surface is.

Real grains depart from mu(I) by a level and a tilt over the range of I, with a standard deviation
each. They count where no solver made the data. All else follows from both ends as from two points
of a line: mu_s and mu_2 at x = 0 and x = 1, mu(I) between the ends.

**Beyond the range of the fit** (`tested`) errors do not fall, and grow in proportion to the
quantity. `outside` names these quantities.

`python -m bench.studies.coverage.fit` fits all numbers of error_model.json, in one step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy

from granpinn.arrays import Float64
from granpinn.results.decoding import decoded, parsed

Pair = tuple[float, float]

PATH = Path(__file__).with_suffix(".json")
WORDS = {
    "noise": "noise of the vectors times sqrt(1000 / their number) over mu",
    "misfit": "error of the fitted velocity over its rms",
    "law": "residual of the friction law",
    "steps": "15,000 steps over those of the training",
    "reach": "largest I/(I + I0)",
    "contrast": "mu at the largest over mu at the smallest I",
    "friction": "mu at the smallest I",
}
# Below it a quantity adds nothing to the errors, at the lower and the upper end.
KNEES: dict[str, Pair] = {"noise": (0.03, 3e-4), "misfit": (0.02, 0.02), "law": (0.02, 0.02)}
USUAL = {"steps": 1.0, "reach": 0.25, "contrast": 1.3}  # where the logarithm counts as 0
STEPS = 15_000
# The features, and the sign of their coefficients: with which change of them errors grow.
FEATURES = {"noise": 1, "misfit": 1, "law": 1, "steps": 1, "reach": -1, "contrast": 1}
BETTER = (*KNEES, "steps")  # where less than tested needs no test
COEFFICIENTS = ("constant", "outline", *FEATURES)
NOISE_ERROR = 1.02  # mean square of noise in the data over the known one, at most
NOISE_PART = 0.03  # velocity error of a fit, as a part of the noise
LEAST_RANGE = 1e-6  # of x, where a flow has one I alone
LARGEST = 10.0  # half of an interval, in log mu


class Known(NamedTuple):
    """What a run knows of its own accuracy.

    Attributes:
        x: I/(I + I0) at the 5th and the 95th percentile of I over the points that shear.
        mu: mu_s and mu_2.
        misfit: of the velocity, rms over rms.
        law: rms residual of the friction law.
        noise: of the vectors, rms over rms, stated or else measured.
        vectors: number of independent ones.
        steps: of the training.
        I0: that was identified with mu_s and mu_2; None: it was given.
        outline: whether the outline of the grains is the free surface (level V0).
        real: whether no solver made the data.
    """

    x: Pair
    mu: Pair
    misfit: float = 0.0
    law: float = 0.0
    noise: float = 0.0
    vectors: float = 1.0
    steps: int = STEPS
    outline: bool = False
    real: bool = False
    I0: float | None = None

    @property
    def ends(self) -> Float64:
        """mu at both ends of the range [2]."""
        return np.asarray(line(self.x) @ np.array(self.mu))

    @property
    def parameters(self) -> dict[str, float]:
        """The L parameters that were identified."""
        mu_s, mu_2 = self.mu
        return {"mu_s": mu_s, "mu_2": mu_2} | ({} if self.I0 is None else {"I0": self.I0})

    @property
    def slopes(self) -> Float64:
        """d log mu / d theta at both ends, for the identified parameters [2, L]."""
        by_mu, (mu_s, mu_2) = line(self.x), self.mu
        if self.I0 is not None:
            by_I0 = -(mu_2 - mu_s) * by_mu[:, :1] * by_mu[:, 1:] / self.I0
            by_mu = np.concatenate([by_mu, by_I0], axis=1)
        return np.asarray(by_mu / self.ends[:, None])


@dataclass(frozen=True)
class ErrorModel:
    """
    Attributes:
        provenance: the trainings that gave the numbers.
        freedom: degrees of freedom of Student's distribution.
        lower, upper: coefficients of log s at the ends of the range of I, by `COEFFICIENTS`.
        correlation: of the errors of log mu at both ends.
        common: correlation of the level of two flows of one material.
        level, tilt: standard deviation of the departure of real grains from mu(I), of log mu.
        free_curve: errors of a free curve at both ends over those of mu(I).
        cohesion: rms cohesion that is found in grains without any, over rho |g| H.
        cohesion_part: rms relative error of the cohesion of cohesive grains.
        tested: least and largest value in the fit of every quantity, by `WORDS`.
    """

    provenance: str
    freedom: float
    lower: dict[str, float]
    upper: dict[str, float]
    correlation: float
    common: float
    level: float
    tilt: float
    free_curve: float
    cohesion: float
    cohesion_part: float
    tested: dict[str, Pair]

    def half_width(self, share: float = 0.9) -> float:
        """Half of the central part of Student's distribution, in standard deviations s."""
        return float(scipy.special.stdtrit(self.freedom, (1 + share) / 2))

    def sd(self, known: Known) -> Float64:
        """s of log mu at both ends in simulated flows of mu(I) [2]."""
        values = quantities(known)
        total = []
        for end, b in enumerate((self.lower, self.upper)):
            log_s = b["constant"] + b["outline"] * outline(known)
            for name, sign in FEATURES.items():
                least, most = self.tested[name]
                within = min(max(values[name], least), most)
                log_s += b[name] * feature(name, within, end)
                if sign * (values[name] - within) > 0:
                    log_s += sign * math.log(values[name] / within)
            total.append(math.exp(min(log_s, math.log(LARGEST))))
        return np.array(total)

    def method(self, known: Known) -> Float64:
        """Covariance of log mu at both ends in simulated flows of mu(I) [2, 2]."""
        s = self.sd(known)
        correlation = np.array([[1.0, self.correlation], [self.correlation, 1.0]])
        return np.asarray(np.outer(s, s) * correlation)

    def grains(self, known: Known) -> Float64:
        """Covariance of log mu at both ends by the departure of real grains from mu(I) [2, 2]."""
        return self.of_flows([known])[1]

    def of_flows(self, flows: Sequence[Known]) -> tuple[Float64, Float64]:
        """Covariance of log mu at both ends of F flows of one material [2 F, 2 F], in two parts.

        The first part is `method`. The second one is the departure of real grains from mu(I): all
        flows have a part of the level in common, and each has its own tilt.
        """
        alone, both = np.eye(len(flows)), np.ones((2, 2))
        level = self.level**2 * (self.common + (1 - self.common) * alone)
        tilt = self.tilt**2 * np.array([[1.0, -1.0], [-1.0, 1.0]])
        real = np.repeat([known.real for known in flows], 2)
        departure = np.kron(level, both) + np.kron(alone, tilt)
        return scipy.linalg.block_diag(*map(self.method, flows)), np.outer(real, real) * departure

    def outside(self, known: Known) -> tuple[str, ...]:
        """The quantities beyond the range of the fit, in words."""
        found = []
        for name, value in quantities(known).items():
            least, most = self.tested[name]
            better = name in BETTER and value < least
            if not (better or least <= value <= most):
                found.append(f"{WORDS[name]} = {value:.2g} (tested: {least:.2g} to {most:.2g})")
        return tuple(found)


@cache
def load(path: Path = PATH) -> ErrorModel:
    """The model; ValueError names the error in a file."""
    return decoded(parsed(path.read_bytes()), ErrorModel)


def quantities(known: Known) -> dict[str, float]:
    """The quantities behind the features, by `WORDS`."""
    low, high = known.ends
    return {
        "noise": known.noise * math.sqrt(1000 / max(1.0, known.vectors)) / low,
        "misfit": math.hypot(beyond_noise(known.misfit, known.noise), NOISE_PART * known.noise),
        "law": known.law,
        "steps": STEPS / max(1, known.steps),
        "reach": known.x[1],
        "contrast": high / low,
        "friction": float(low),
    }


def feature(name: str, value: float, end: int) -> float:
    """The feature of a quantity at an end, 0: lower, 1: upper."""
    if name in KNEES:
        return math.log(math.hypot(1.0, value / KNEES[name][end]))
    return math.log(value / USUAL[name])


def outline(known: Known) -> float:
    """The feature of a surface that is the outline of the grains."""
    knee, _ = KNEES["noise"]
    return known.outline / math.hypot(1.0, quantities(known)["noise"] / knee)


def beyond_noise(misfit: float, noise: float) -> float:
    """Relative misfit of the velocity beyond its noise."""
    return math.sqrt(max(0.0, misfit**2 - NOISE_ERROR * min(misfit, noise) ** 2))


def ends_of(I_range: Pair, I0: float) -> Pair:
    """x = I/(I + I0) at both ends of a range of I, at least `LEAST_RANGE` apart."""
    low, high = (I / (I + I0) for I in I_range)
    return low, max(high, low + LEAST_RANGE)


def line(x: Pair) -> Float64:
    """mu at the ends by (mu_s, mu_2) [2, 2]."""
    ends = np.array(x)
    return np.stack([1 - ends, ends], axis=1)


def interval(value: float, sd: float, half_width: float) -> Pair:
    """From `value` over to `value` times a factor, so that friction stays positive."""
    reach = min(half_width * sd / value, LARGEST)
    return value * math.exp(-reach), value * math.exp(reach)
