"""The rules for the numbers of a flow, each with one error that names the dataset and the remedy.

The rules for shapes and types are in `schema.py`.
"""

from __future__ import annotations

import numpy as np

from granpinn.arrays import Bool, Float64
from granpinn.data.constants import check_constants_of
from granpinn.data.flow import (
    LARGEST,
    PERIOD_X,
    STEADY,
    SURFACE_SD,
    Flow,
    FlowFileError,
    Surface,
)
from granpinn.data.large import slabs
from granpinn.data.particles import check_particles
from granpinn.data.scaling import initial_height
from granpinn.data.schema import arrays_of, check_layout, grid_arrays_of
from granpinn.data.wall_rules import check_walls
from granpinn.declared import checked

# Volume fractions of a solver exceed 0..1 by rounding errors; a larger excess is a mistake.
FRACTION_TOLERANCE = 1e-6
# Largest rounding of a coordinate, in units of its smallest step.
LARGEST_ROUNDING = 0.01
# Largest distance of surface points from the cell centers: part of their extent, or cells.
SURFACE_MARGIN, SURFACE_CELLS = 0.1, 1.0


@checked
def check_flow(flow: Flow) -> None:
    """Raises FlowFileError if the flow breaks a rule of the format."""
    for arrays in (arrays_of(flow), grid_arrays_of(flow)):
        check_layout(arrays)
    check_values(flow)


def check_values(flow: Flow) -> None:
    """Checks the numbers of a flow that has passed `check_layout`."""
    check_constants_of(flow)
    for name, values in (("t", flow.t), ("y", flow.y), ("x", flow.x)):
        _check_coordinate(name, values)
    _check_symmetries(flow)
    _check_fraction(flow)
    _check_sizes(flow)
    _check_velocity(flow)
    if flow.p is not None and not all(
        np.isfinite(flow.p[k][flow.c[k] >= 1]).all() for k in slabs(flow)
    ):
        raise FlowFileError(
            "p must be finite where c = 1, got NaN or infinity: give the reference pressure at "
            "every point with grains or leave p out"
        )
    _check_sigma(flow)
    if flow.particles is not None:
        check_particles(flow.particles)
    if flow.surface is not None:
        _check_surface(flow, flow.surface)
    if flow.walls is not None:
        check_walls(flow, flow.walls)


def _check_coordinate(name: str, values: Float64) -> None:
    if not np.isfinite(values).all():
        raise FlowFileError(
            f"{name} must be finite, got NaN or infinity at index "
            f"{int(np.argmin(np.isfinite(values)))}: correct the coordinate"
        )
    if (np.abs(values) > LARGEST).any():
        i = int(np.argmax(np.abs(values)))
        raise FlowFileError(
            f"{name} must be from {-LARGEST:g} to {LARGEST:g}, got {values[i]:g} at index {i}: "
            "check its unit"
        )
    steps = np.diff(values)
    if not (steps > 0).all():
        i = int(np.argmin(steps > 0))
        raise FlowFileError(
            f"{name} must increase strictly, got {values[i]:g} then {values[i + 1]:g} at index "
            f"{i}: sort the data along {name}"
        )
    if steps.size == 0:  # a steady flow: its time has no effect
        return
    rounding = float(np.spacing(np.abs(values).max()))
    if rounding > LARGEST_ROUNDING * steps.min():
        raise FlowFileError(
            f"{name} must be far more precise than its steps, got steps down to {steps.min():g} "
            f"around {values[int(np.argmin(steps))]:g}, where float64 has a spacing of "
            f"{rounding:g}: subtract the first value before the file is written"
        )


def _check_symmetries(flow: Flow) -> None:
    """What the file states about the whole flow must fit its grid."""
    if flow.t.size == 1 and flow.attributes.get(STEADY, 1) == 0:
        raise FlowFileError(
            f"a flow of one frame must be steady, got the attribute {STEADY} = 0: give more "
            "frames, or leave the attribute out"
        )
    period, width = flow.stated(PERIOD_X), float(flow.x[-1] - flow.x[0])
    if period is not None and not period > width:
        raise FlowFileError(
            f"the attribute {PERIOD_X} must be longer than x, which spans {width:g}, got "
            f"{period:g}: give the length of the period in the unit of x, and each place once"
        )


def _check_fraction(flow: Flow) -> None:
    parts = [flow.c[k] for k in slabs(flow)]
    lowest = float(np.min([c.min() for c in parts]))  # NaN if there is one
    highest = float(np.max([c.max() for c in parts]))
    if not (lowest >= -FRACTION_TOLERANCE and highest <= 1 + FRACTION_TOLERANCE):
        raise FlowFileError(
            f"c must be a volume fraction from 0 to 1 everywhere, got {lowest:g} to "
            f"{highest:g}: use 0 where there are no grains"
        )
    grains = np.concatenate([_in_any_cell(c >= 1) for c in parts])
    if not grains.any():
        raise FlowFileError(
            f"c must be 1 where there are only grains, got no such point (largest value "
            f"{highest:g}): set c to exactly 1 inside the material"
        )
    if not grains[0]:
        raise FlowFileError(
            "c must be 1 at some point of the first frame, whose height of grains sets the "
            "length scale, got none: leave out the frames before the grains are seen"
        )


def _check_sizes(flow: Flow) -> None:
    height = initial_height(flow)
    sizes = {"grain_diameter": flow.grain_diameter}
    sizes |= {f"the attribute {SURFACE_SD}": flow.stated(SURFACE_SD) or 0.0}
    for name, size in sizes.items():
        if size > height:
            raise FlowFileError(
                f"{name} must be smaller than the height of the grains in the first frame, "
                f"{height:g}, got {size:g}: give both in the unit of length of the file"
            )


def _in_any_cell(mask: Bool) -> Bool:
    """Whether `mask` [T, Y, X] is true anywhere in each frame: [T]."""
    return np.asarray(mask.any(axis=(1, 2)))


def _check_velocity(flow: Flow) -> None:
    parts = slabs(flow)
    for name, values in (("u", flow.u), ("v", flow.v)):
        infinite = sum(int(np.isinf(values[k]).sum()) for k in parts)
        if infinite:
            raise FlowFileError(
                f"{name} must be finite, or NaN where there is no valid vector, got infinity at "
                f"{infinite} of {values.size} points: set u and v to NaN there"
            )
    one_sided = sum(int((np.isnan(flow.u[k]) != np.isnan(flow.v[k])).sum()) for k in parts)
    if one_sided:
        raise FlowFileError(
            f"u and v must be NaN at the same points, got {one_sided} where only one of them "
            "is: set both to NaN"
        )
    empty = np.concatenate([_without_vectors(flow, k) for k in parts])
    if empty.any():
        first = int(np.argmax(empty))
        raise FlowFileError(
            f"u and v must hold valid vectors among the grains in every frame, got only NaN in "
            f"{int(empty.sum())} of {len(empty)} frames (first: t = {flow.t[first]:g}): "
            "leave these frames out"
        )


def _without_vectors(flow: Flow, frames: slice) -> Bool:
    """Frames [K] without any vector, or without one among their grains."""
    empty = ~_in_any_cell(~np.isnan(flow.u[frames]))
    return empty | (_in_any_cell(flow.c[frames] >= 1) & ~_in_any_cell(flow.valid_in(frames)))


def _check_sigma(flow: Flow) -> None:
    pair = {"sigma_u": flow.sigma_u, "sigma_v": flow.sigma_v}
    missing = [name for name, sigma in pair.items() if sigma is None]
    if len(missing) == 1:
        raise FlowFileError(
            f"sigma_u and sigma_v must come together, got no {missing[0]}: add it or leave both out"
        )
    for name, sigma in pair.items():
        if sigma is None:
            continue
        for k in slabs(flow):
            used = np.asarray(sigma)
            if isinstance(sigma, np.ndarray):
                used = sigma[k][flow.valid_in(k)]
            if not (np.isfinite(used) & (used > 0)).all():
                raise FlowFileError(
                    f"{name} must be positive and finite at every valid vector, got "
                    f"{float(used.min()):g} as the least: give the standard deviation of the "
                    "measurement or leave sigma_u and sigma_v out"
                )


def _check_surface(flow: Flow, surface: Surface) -> None:
    grid = {"t": flow.t, "x": flow.x, "y": flow.y}
    parts = {"t": surface.t, "x": surface.x, "y": surface.y, "p": surface.p}
    for name, values in parts.items():
        if values is None:
            continue
        if not np.isfinite(values).all():
            raise FlowFileError(
                f"surface_{name} must be finite, got NaN or infinity at index "
                f"{int(np.argmin(np.isfinite(values)))}: leave this surface point out"
            )
        if name == "p" or (name == "t" and flow.steady):
            continue
        step, far = float(np.diff(grid[name]).min()), float(np.abs(values).max())
        with np.errstate(over="ignore"):
            rounded = far * 2.0**-23 > step and np.array_equal(values, values.astype(np.float32))
        if rounded:
            raise FlowFileError(
                f"surface_{name} must be as precise as {name}, got numbers of float32 around "
                f"{far:g} for steps of {step:g}: store surface_{name} as float64"
            )
        low, high = grid[name][0], grid[name][-1]
        cell = float(np.median(np.diff(grid[name])))
        margin = max(SURFACE_MARGIN * (high - low), SURFACE_CELLS * cell)
        if values.min() < low - margin or values.max() > high + margin:
            raise FlowFileError(
                f"surface_{name} must lie within {name}, {low:g} to {high:g}, got "
                f"{values.min():g} to {values.max():g}: check its unit, or leave out the points "
                "outside the grid"
            )
