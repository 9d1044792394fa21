"""A flow from vectors in SI units: grains, free surface, standard deviations."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from granpinn.arrays import Bool
from granpinn.data.flow import SURFACE_SD, Flow, FlowFileWarning, Particles, Surface
from granpinn.data.particles import particle_flow
from granpinn.data.surface import folded
from granpinn.importers import surface as surfaces
from granpinn.importers.density import surface_of_grains
from granpinn.importers.frame import Frame
from granpinn.importers.grains import FULL, below_line, grains_of
from granpinn.importers.settings import Settings
from granpinn.importers.vectors import DataFileError, VectorFields

ROUNDING = 1e-6  # of times in float32


def grid_flow(
    fields: VectorFields,
    settings: Settings,
    frame: Frame,
    line: Surface | None,
    constants: dict[str, Any],
) -> Flow:
    """The flow of vectors on a grid.

    Args:
        line: points of the free surface that were given.
        constants: other fields of Flow.
    """
    c, source = grains_of(fields)
    surface, wanted = line, settings.surface
    if line is not None and source == "vectors":
        if folded(fields.t, fields.x, line).any():
            _warn(
                "the line of --surface is vertical or folds back, so that it does not say alone "
                "which cells hold grains there: give --mask"
            )
        c = np.where(below_line(fields, line), 1.0, 0.0)
    elif line is None and wanted == "auto" and source == "vectors":
        _warn_of_no_surface("there is neither a mask nor a fraction field")
    elif line is None and wanted != "none":
        surface = surfaces.from_fraction(c, fields.t, fields.y, fields.x, frame.gravity)
        if surface is None:
            _warn_of_no_surface("no edge of the grains faces up inside the field of view")
    usable = fields.usable & (c == 1)
    kept = usable.any(axis=(1, 2))
    _require_frames(int(kept.sum()), settings)
    if not kept.all():
        _warn(f"{int((~kept).sum())} of {kept.size} frames hold no valid vector and are left out")
    constants |= _sigmas(fields, settings, frame, usable)
    for name in ("sigma_u", "sigma_v"):
        if isinstance(constants.get(name), np.ndarray):
            constants[name] = constants[name][kept]
    # The unit of a pressure is unknown, and a pressure is for scoring only.
    p = fields.p if settings.dimensionless else None
    if p is not None and not np.isfinite(p[kept][c[kept] == 1]).all():
        p = None
    # A vector that is not measured is NaN in both components, also without grains.
    u, v = (np.where(fields.usable, a, np.nan)[kept] for a in (fields.u, fields.v))
    return Flow(
        t=fields.t[kept],
        y=fields.y,
        x=fields.x,
        u=u,
        v=v,
        c=c[kept].astype(np.float32),
        p=None if p is None else p[kept].astype(np.float32),
        surface=_within(surface, fields.t[kept]),
        **constants,
    )


def scattered_flow(
    fields: VectorFields,
    settings: Settings,
    frame: Frame,
    line: Surface | None,
    constants: dict[str, Any],
) -> Flow:
    """The flow of scattered vectors; arguments as in `grid_flow`."""
    usable = fields.usable
    if fields.c is not None:
        usable = usable & (fields.c > 1 - FULL)
    _require_frames(np.unique(fields.t[usable]).size, settings)
    surface, wanted = line, settings.surface
    if surface is None and wanted == "auto" and fields.c is not None:
        surface = surfaces.from_scattered(fields)
    elif surface is None and wanted == "auto":
        t, x, y = (getattr(fields, name)[usable] for name in ("t", "x", "y"))
        traced = surface_of_grains(t, x, y, constants["grain_diameter"], frame.gravity)
        if traced is not None:
            surface, sd = traced
            constants["attributes"] = {SURFACE_SD: sd, **constants["attributes"]}
    if surface is None and wanted != "none":
        _warn_of_no_surface("the grains have no edge that faces up and moves")
    sigmas = _sigmas(fields, settings, frame, usable)
    parts = {name: getattr(fields, name) for name in ("t", "x", "y", "u", "v")}
    parts |= {name: s for name, s in sigmas.items() if isinstance(s, np.ndarray)}
    particles = Particles(**{name: values[usable] for name, values in parts.items()})
    constants |= {name: s for name, s in sigmas.items() if name not in parts}
    return particle_flow(particles, surface=_within(surface, np.unique(particles.t)), **constants)


def _require_frames(count: int, settings: Settings) -> None:
    if count < settings.fewest_frames:
        raise DataFileError(
            f"{settings.fewest_words} must hold measured vectors among the grains, got {count}: "
            "check the mask, the frames and the validity of the vectors, or lower --track-window"
        )


def _within(surface: Surface | None, t: Any) -> Surface | None:
    """The points at the times of the frames, without those of frames that are left out."""
    if surface is None:
        return None
    margin = ROUNDING * float(np.abs(t).max())
    if t.size > 1:
        margin = min(margin, float(np.diff(t).min()) / 2)
    inside = (surface.t >= t[0] - margin) & (surface.t <= t[-1] + margin)
    if not inside.any():
        raise DataFileError(
            f"the free surface must be given between the times {t[0]:g} and {t[-1]:g} of the "
            f"vectors, got {surface.t.min():g} to {surface.t.max():g}: check its unit of time"
        )
    return Surface(t=surface.t[inside], x=surface.x[inside], y=surface.y[inside])


def _sigmas(fields: VectorFields, settings: Settings, frame: Frame, usable: Bool) -> dict[str, Any]:
    """Standard deviations from the files, or one number from the settings."""
    if settings.sigma is not None:
        sigma = frame.number(settings.sigma, "velocity", "--sigma")
        return dict.fromkeys(("sigma_u", "sigma_v"), sigma)
    found: dict[str, Any] = {}
    for name in ("sigma_u", "sigma_v"):
        values = getattr(fields, name)
        if values is None:
            return {}
        wrong = usable & (np.isinf(values) | (values < 0))
        if wrong.any():
            raise DataFileError(
                f"{name} must be positive, and NaN where it is not known, got {values[wrong][0]:g} "
                f"at {int(wrong.sum())} vectors: correct it, or leave sigma_u and sigma_v out"
            )
        good = np.isfinite(values) & (values > 0)
        if not (usable & good).any():
            return {}
        # A measured vector without a standard deviation has the largest one.
        found[name] = np.where(good, values, values[usable & good].max()).astype(np.float32)
    return found


def _warn_of_no_surface(why: str) -> None:
    _warn(
        f"the free surface is not known, as {why}: train with --level V0, or give --mask or "
        "--surface with the points of a line"
    )


def _warn(text: str) -> None:
    warnings.warn(text, FlowFileWarning, stacklevel=4)
