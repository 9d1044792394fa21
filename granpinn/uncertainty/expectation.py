"""What inspected data tell of a law before any training: facts, then advice on the measurement."""

from __future__ import annotations

import math

import numpy as np

from granpinn.data.rules import MAX_ZERO_SHARE
from granpinn.data.wall_points import contradictions
from granpinn.inspection.checks import FREE_FALL, LARGEST_MOVE, NEGLIGIBLE_NOISE
from granpinn.inspection.inspection import Inspection
from granpinn.physics.laws import mu_of_i
from granpinn.results.determined import NOT_DETERMINED
from granpinn.results.slip import IMPOSSIBLE, IMPROBABLE
from granpinn.uncertainty import error_bars, error_model
from granpinn.uncertainty.determined import Range, lost_of, range_of
from granpinn.uncertainty.error_model import Known, ends_of

NO_FRICTION = "No friction coefficient can be given"
POOR_REACH = 0.3  # I (95 %) / I0 below which mu_2 is an extrapolation
GOOD = 0.03  # standard deviation of a parameter
LIMITED = 1.2  # times the standard deviation without noise: noise limits the precision
MANY_INVALID = 0.1
# Of the shear rate. PIV of an incompressible flow left 8 % (bench/studies/experiment).
PIV_DIVERGENCE, LARGE_DIVERGENCE = 0.08, 0.12
TILT = 2.0  # degrees


def facts(found: Inspection) -> list[str]:
    """Sentences, the most important one first; without the slips of the flow file."""
    return [_answer(found), *_range(found), *_data(found), *_physics(found)]


def _answer(found: Inspection) -> str:
    p = found.precision
    if any(slip.severity == IMPOSSIBLE for slip in found.slips):
        return "Training refuses these data, which are impossible: mend the flow file first."
    if any(slip.severity == IMPROBABLE for slip in found.slips):
        return (
            "A law from these data is not to be used, as they are improbable: explain what stands "
            "above, or mend the flow file."
        )
    if found.undetermined is not None:
        what = "The velocity gives no friction coefficient"
        return f"{what if found.baseline.shown else NO_FRICTION}: {found.undetermined}."
    if found.baseline.carried:
        return "A law from these data is not to be used: walls carry the grains."
    if p is None:
        return f"No precision can be given: {found.reason}."
    level, law, sd = "V1" if found.surface else "V0", found.law.friction_law, expected(found)
    known = "".join(f", {name} known" for name in law.names if name not in law.free)
    about = " and ".join(f"{name} to {value:.1%}" for name, value in sd.items())
    if law.curve:
        ends = f"{min(sd.values()):.1%} to {max(sd.values()):.1%}"
        about = f"{law.curve[0]} to {law.curve[-1]} to {ends}"
    grains = "" if found.flow.of_solver else ", with what real grains depart from a law"
    sure = f"one standard deviation{known}{grains}"
    return f"Expected of a training at level {level}: {about} ({sure})."


def expected(found: Inspection, noise: float = 1.0) -> dict[str, float]:
    """Relative standard deviations of the parameters after a training, by name.

    Those of mu(I) are the error bars of the error model for a good fit. For another law it
    is the larger error of mu at either end of the range of I, beside the bound by noise.

    Args:
        noise: over that of the data.
    """
    law, p, known = found.law.friction_law, found.precision, _known(found, noise)
    if known is None or p is None:
        return {}
    model = error_model.load()
    if law.name == mu_of_i.LAW.name:
        pairs = zip(law.free, error_bars.sd_of([known], model), known.mu, strict=True)
        return {name: s / mu for name, s, mu in pairs}
    most = math.sqrt(np.diag(model.method(known) + model.grains(known)).max())
    return {name: math.hypot(noise * getattr(p, name), most) for name in law.free}


def _known(found: Inspection, part: float) -> Known | None:
    """What a training is expected to know of its accuracy; None if no grains shear.

    The friction of the assumed law at both ends of the range of I is continued as that of mu(I).

    Args:
        part: noise over that of the data.
    """
    shear = _shear(found)
    if shear is None or found.precision is None:
        return None
    I0 = found.law.inertial_scale or mu_of_i.LAW.parameter("I0").start
    x = ends_of((shear.low, shear.high), I0)
    mu = found.law.friction_law.friction(np.array([shear.low, shear.high]), *found.law.theta)
    mu_s, mu_2 = np.linalg.solve(error_model.line(x), mu * np.ones(2)).tolist()
    speed = float(np.sqrt(np.mean(np.hypot(found.gradients.u, found.gradients.v) ** 2)))
    noise = part * (found.noise.sigma or 0.0) * math.sqrt(2) / speed
    vectors = found.precision.independent_vectors
    known = Known(x, (mu_s, mu_2), misfit=noise, noise=noise, vectors=vectors)
    return known._replace(outline=found.surface is None, real=not found.flow.of_solver)


def _data(found: Inspection) -> list[str]:
    c, lines, unit = found.counts, [], found.flow.time_unit
    unit = "" if unit == "1" else f" {unit}"
    move = found.motion.largest_move
    if found.motion.sparse is not None and move is not None:
        start, end = found.motion.sparse
        factor = math.ceil(move / LARGEST_MOVE)
        lines.append(
            f"Add frames between t = {start:.4g} and {end:.4g}{unit}: grains move up to "
            f"{move:.2f} of the initial height from one to the next; "
            f"a frame rate {factor} times higher resolves the motion."
        )
    if c.zero_share > MAX_ZERO_SHARE:
        lines.append(
            f"{c.zero_share:.1%} of the vectors are exactly zero: if these are gaps, write NaN, "
            "because a zero looks like grains at rest."
        )
    if c.repeated:
        lines.append(
            f"{len(c.repeated)} frames repeat the one before (first: t = "
            f"{found.flow.t[c.repeated[0]]:.4g}{unit}): leave them out."
        )
    if c.poor_frames:
        lines.append(
            f"{len(c.poor_frames)} frames lack vectors in more than half of the grains (first: "
            f"t = {found.flow.t[c.poor_frames[0]]:.4g}{unit}): leave them out."
        )
    if c.invalid_share is not None and c.invalid_share > MANY_INVALID:
        lines.append(
            f"{c.invalid_share:.0%} of the grains have no valid vector: see validity.png; more "
            "light, more texture or larger windows help."
        )
    return lines + _noise(found)


def _noise(found: Inspection) -> list[str]:
    n = found.noise
    lines: list[str] = []
    relative = found.relative_noise
    if relative is None or relative < NEGLIGIBLE_NOISE:
        return lines
    mean, error = found.flow.averaged > 1, found.stated_sigma
    if mean and error and n.in_space and error > 2 * n.in_space:
        lines.append(
            f"The frames of this steady flow differ by {error / n.in_space:.1f} times the noise of "
            "their vectors: the flow still drifts, or the record is too short for a mean."
        )
    if n.in_time and n.in_space and not 0.5 < n.in_time / n.in_space < 2:
        larger = n.in_time > n.in_space
        lines.append(
            f"Noise seen in time is {n.in_time / n.in_space:.1f} times that in space: "
            + (
                "neighboring vectors share their errors, or frames are too far apart."
                if larger
                else "the vectors of a frame are too sparse for the layers that shear."
                if found.counts.particles
                else "the cells are wider than the layers that shear; use smaller windows."
            )
        )
    if (
        error
        and not mean
        and not 0.67 < error * found.scales.velocity / (relative * found.motion.speed) < 1.5
    ):
        ratio = relative * found.motion.speed / (error * found.scales.velocity)
        lines.append(
            f"The file states a standard deviation that the vectors contradict: they scatter "
            f"{ratio:.2g} times as much. Correct sigma_u and sigma_v."
        )
    sd, without = expected(found), expected(found, noise=0.0)
    excess = {name: sd[name] / without[name] for name in sd if sd[name] > GOOD}
    name = max(excess, key=lambda name: excess[name], default="")
    if excess and excess[name] > LIMITED:
        lines.append(
            f"Noise limits {name}: without it about {without[name]:.1%} are expected in place of "
            f"{sd[name]:.1%}. More independent vectors, or less noise, help."
        )
    return lines


def _shear(found: Inspection) -> Range | None:
    """The range of I of the vectors that shear."""
    scale = found.law.inertial_scale or 1.0
    return range_of(found.I[found.flows], found.gradients.vectors[found.flows], scale)


def _range(found: Inspection) -> list[str]:
    """The parameters of mu(I) that the range of I does not determine."""
    law, shear = found.law, _shear(found)
    if law.law != mu_of_i.LAW.name or found.undetermined is not None or shear is None:
        return []
    mu_s, mu_2, I0 = law.theta
    lost = lost_of([Known(ends_of((shear.low, shear.high), I0), (mu_s, mu_2))])
    if not lost:
        return []
    return [
        f"{' and '.join(lost)} {NOT_DETERMINED}: the grains shear at I = {shear.low:.2g} to "
        f"{shear.high:.2g} only; a training gives mu at I = {shear.I:.2g}."
    ]


def _physics(found: Inspection) -> list[str]:
    lines, m, inertia = [], found.motion, found.inertia
    of_mu_of_i = found.law.law == mu_of_i.LAW.name  # the only law with an I0
    if of_mu_of_i and inertia is not None and found.precision is not None:
        if inertia.reach is not None and inertia.reach < POOR_REACH:
            lines.append(
                f"I reaches only {inertia.q95:.2g} (95 %) of I0 = {found.law.I0:g}: mu_2 cannot be "
                "separated from I0; only the slope (mu_2 - mu_s) / I0 is measured. Larger grains, "
                "a taller column or a steeper slope reach higher I."
            )
        elif (found.precision.correlation or 0.0) > 0.9:
            lines.append(
                "mu_2 and I0 cannot both be found (correlation "
                f"{found.precision.correlation:.2f}): give I0, or trust the law over the covered "
                "I only."
            )
    lines += [f"{text[0].upper()}{text[1:]}." for text in contradictions(found.walls)]
    if found.surface is None and found.undetermined is None:
        lines.append("No free surface: level V0 only; give the line, it fixes the pressure.")
    if found.slips:  # they say more about units and signs than what follows
        return lines
    divergence = found.kinematics.divergence
    if divergence is not None and divergence > LARGE_DIVERGENCE:
        lines.append(
            f"div v is {divergence:.0%} of the shear rate, and PIV of an incompressible flow left "
            f"{PIV_DIVERGENCE:.0%}: vectors at edges are wrong, grains leave the plane, their "
            "density changes, or x and y have different scales."
        )
    if m.acceleration is not None and m.acceleration > FREE_FALL[1]:
        lines.append(
            f"Grains accelerate at {m.acceleration:.2f} times the gravity of the file: check the "
            "scale, the frame rate and the gravity."
        )
    falls = m.acceleration is not None and FREE_FALL[0] <= m.acceleration <= FREE_FALL[1]
    if falls and m.tilt is not None and abs(m.tilt) > TILT:
        lines.append(
            f"Falling grains accelerate {abs(m.tilt):.1f} degrees "
            f"{'counter-' if m.tilt > 0 else ''}clockwise of gravity: check --tilt."
        )
    return lines
