"""An inspection as text for the terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from granpinn.inspection.checks import FREE_FALL, NEGLIGIBLE_NOISE, Motion
from granpinn.inspection.gravity_slips import ASIDE
from granpinn.inspection.inspection import Inspection

WIDTH = 100
MOST_LINES = 28  # the command adds one or two


def lines_of(found: Inspection, facts: Sequence[str]) -> list[str]:
    """At most `MOST_LINES` lines: slips, numbers, and the facts with the momentum balance as the
    second."""
    c, k, m = found.counts, found.kinematics, found.motion
    unit = "" if found.flow.length_unit == "1" else f" {found.flow.length_unit}/"
    unit += found.flow.time_unit if unit else ""
    kind = "scattered" if c.particles else f"on {c.rows} x {c.columns} cells"
    gaps = "" if c.invalid_share is None else f", {c.invalid_share:.1%} of the grains without"
    rows = [
        ("frames", f"{c.frames}, {len(c.repeated)} repeated, {len(c.poor_frames)} mostly empty"),
        ("vectors", f"{c.vectors} {kind}{gaps}, {c.zero_share:.1%} exactly zero"),
        ("noise", _noise(found, unit)),
        ("motion", f"largest speed {m.speed:.3g}{unit}{_moves(m)}"),
        ("gravity", _gravity(found)),
        ("flowing", f"{k.flowing:.0%} of the vectors" + _shear(found)),
        ("free surface", _surface(found)),
        ("inertial number", _inertia(found)),
        ("expected sd", _precision(found)),
    ]
    if found.symmetries:
        rows.insert(0, ("symmetry", "; ".join(found.symmetries)))
    # Walls have a line each.
    rows[-2:-2] = [("" if k else "walls", str(wall)) for k, wall in enumerate(found.walls)]
    lines = []
    for slip in found.slips:
        lines += textwrap.wrap(f"{slip.severity}: {slip.text}", WIDTH, subsequent_indent="  ")
    lines += [f"{name:<16} {text}" for name, text in rows]
    lines.append("")
    for sentence in (facts[0], found.baseline.sentence, *facts[1:]):
        lines += textwrap.wrap(sentence, WIDTH, initial_indent="- ", subsequent_indent="  ")
    if len(lines) > MOST_LINES:
        lines = [*lines[: MOST_LINES - 1], "- ... more in inspect.json"]
    return lines


def _noise(found: Inspection, unit: str) -> str:
    relative, n = found.relative_noise, found.noise
    if n.sigma is None:
        return "unknown: too few vectors"
    if relative is None:
        return "none: nothing moves"
    if relative < NEGLIGIBLE_NOISE:
        return f"below {NEGLIGIBLE_NOISE:.2%} of the largest speed"
    text = f"{n.sigma * found.scales.velocity:.3g}{unit} per component of a typical vector = "
    text += f"{relative:.2%} of the largest speed"
    if n.vectors_per_independent > 1.5:
        text += f"; {n.vectors_per_independent:.1f} neighbors share one error"
    if found.stated_sigma is not None:
        whose = (
            "the file states" if found.flow.averaged == 1 else "the mean has a standard error of"
        )
        text += f"; {whose} {found.stated_sigma * found.scales.velocity:.3g}"
    return text


def _moves(motion: Motion) -> str:
    cells = motion.cells_per_frame
    return "" if cells is None else f"; {cells:.2g} cells per frame"


def _gravity(found: Inspection) -> str:
    a, fall = found.motion.acceleration, found.fall
    if fall is not None and fall.pull > ASIDE and fall.size >= FREE_FALL[0]:
        return (
            f"the {fall.side} of the grains falls with {fall.size:.3f} +- {fall.error:.1g} g, "
            f"{fall.tilt(found.flow.gravity):+.1f} degrees from it"
        )
    if a is None:
        return "not checked: noise hides the acceleration, or there are too few vectors"
    if a < FREE_FALL[0]:
        return f"not checked: nothing falls freely (largest acceleration {a:.2f} g)"
    return f"the fastest falling grains have {a:.2f} g, {found.motion.tilt:+.1f} degrees from it"


def _shear(found: Inspection) -> str:
    k = found.kinematics
    if k.shear_rate is None:
        return ""
    rate = k.shear_rate / found.scales.time
    return (
        f", shear rate {rate:.3g} (median, error {k.shear_rate_error / found.scales.time:.2g}; "
        f"windows of {k.window} cells), div v {k.divergence:.0%} of it"
    )


def _surface(found: Inspection) -> str:
    s = found.surface
    return "none" if s is None else f"{s.points} points in {s.frames:.0%} of the frames"


def _inertia(found: Inspection) -> str:
    i = found.inertia
    if i is None:
        return "unknown: nothing flows"
    scale = "" if i.above is None else f"; {i.above:.0%} above I0/3"
    return (
        f"{i.q05:.2g} to {i.q95:.2g} (5..95 %), median {i.q50:.2g}, with hydrostatic pressure "
        f"below the surface{scale}"
    )


def _precision(found: Inspection) -> str:
    p, relative = found.precision, found.relative_noise
    if p is None:
        return "none"
    if relative is None or relative < NEGLIGIBLE_NOISE:
        return "noise is negligible: only the scatter of a training limits the precision"
    law = found.law.friction_law
    text = "noise alone: " + ", ".join(f"{name} {getattr(p, name):.2%}" for name in law.free)
    fixed = [name for name in law.names if name not in law.free]
    if fixed and hasattr(p, f"{fixed[0]}_free"):
        free = [f"{getattr(p, f'{name}_free'):.2%}" for name in law.free]
        free += [f"{name} {getattr(p, f'{name}_free'):.2%}" for name in fixed]
        text += f"; {' and '.join(fixed)} free: {', '.join(free)}"
    return text
