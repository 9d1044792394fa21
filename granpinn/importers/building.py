"""A flow from vectors in SI units: grains, free surface, standard deviations."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from granpinn.arrays import Bool
from granpinn.data.flow import SURFACE_SD, Flow, FlowFileWarning, Particles, Surface
from granpinn.data.particles import particle_flow
from granpinn.data.surface_line import folded
from granpinn.importers import surface as surfaces
from granpinn.importers.density import surface_of_grains
from granpinn.importers.frame import Frame
from granpinn.importers.grains import FULL, Grains, below_line, grains_of
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
    grains = grains_of(fields)
    if line is not None and grains.source == "vectors":
        if folded(fields.t, fields.x, line.t, line.x, line.y).any():
            _warn(
                "the line of --surface is vertical or folds back, so that it does not say alone "
                "which cells hold grains there: give --mask"
            )
        inside = below_line(fields, line.t, line.x, line.y)
        grains = Grains(np.where(inside, 1.0, 0.0), "line")
    surface = line or _surface(fields, settings, frame, grains)
    usable = fields.usable & (grains.c == 1)
    kept = usable.any(axis=(1, 2))
    if kept.sum() < settings.fewest_frames:
        raise DataFileError(
            f"{settings.fewest_words} must hold measured vectors among the grains, got "
            f"{int(kept.sum())}: check the mask, the frames and the validity of the vectors"
        )
    if not kept.all():
        _warn(f"{int((~kept).sum())} of {kept.size} frames hold no valid vector and are left out")
    constants |= _sigmas(fields, settings, frame, usable)
    for name in ("sigma_u", "sigma_v"):
        if isinstance(constants.get(name), np.ndarray):
            constants[name] = constants[name][kept]
    # The unit of a pressure is unknown, and a pressure is for scoring only.
    p = fields.p if settings.dimensionless else None
    if p is not None and not np.isfinite(p[kept][grains.c[kept] == 1]).all():
        p = None
    # A vector that is not measured is NaN in both components, also without grains.
    u, v = (np.where(fields.usable, a, np.nan)[kept] for a in (fields.u, fields.v))
    return Flow(
        t=fields.t[kept],
        y=fields.y,
        x=fields.x,
        u=u,
        v=v,
        c=grains.c[kept].astype(np.float32),
        p=None if p is None else p[kept].astype(np.float32),
        surface=_within(surface, fields.t[kept]),
        **constants,
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


def _surface(
    fields: VectorFields, settings: Settings, frame: Frame, grains: Grains
) -> Surface | None:
    """The free surface of the grains by the method of the settings."""
    wanted = settings.surface
    if wanted == "none" or (wanted == "auto" and grains.source in ("vectors", "line")):
        if wanted == "auto":
            _warn(
                "the free surface is not known, because there is neither a mask nor a fraction "
                "field: train with --level V0, or give --mask or --surface"
            )
        return None
    if wanted != "auto" and wanted != grains.source:
        raise DataFileError(
            f"--surface {wanted} needs a {wanted}, got none: give --mask, or a CSV file of points"
        )
    c, t = grains.c, fields.t
    found = surfaces.from_fraction(c, t, fields.y, fields.x, frame.gravity)
    if found is None:
        _warn(
            "no edge of the grains faces up inside the field of view, so that no free surface was "
            "found: train with --level V0, or give --surface"
        )
    return found


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
    if not usable.any():
        raise DataFileError("no vector is valid: check the tracks, or lower --track-window")
    surface, wanted = line, settings.surface
    if surface is None and wanted in ("auto", "fraction") and fields.c is not None:
        surface = surfaces.from_scattered(fields)
    elif surface is None and wanted == "auto":
        t, x, y = (getattr(fields, name)[usable] for name in ("t", "x", "y"))
        traced = surface_of_grains(t, x, y, constants["grain_diameter"], frame.gravity)
        if traced is not None:
            surface, sd = traced
            constants["attributes"] = {SURFACE_SD: sd, **constants["attributes"]}
    if surface is None and wanted != "none":
        _warn(
            "the free surface is not known, as the grains have no edge that faces up and moves: "
            "train with --level V0, or give --surface with the points of a line"
        )
    times = np.unique(fields.t[usable]).size
    if times < settings.fewest_frames:
        raise DataFileError(
            f"{settings.fewest_words} must hold valid vectors, got {times}: give more of the flow"
        )
    sigmas = _sigmas(fields, settings, frame, usable)
    parts = {name: getattr(fields, name) for name in ("t", "x", "y", "u", "v")}
    parts |= {name: s for name, s in sigmas.items() if isinstance(s, np.ndarray)}
    particles = Particles(**{name: values[usable] for name, values in parts.items()})
    constants |= {name: v for name, v in sigmas.items() if not isinstance(v, np.ndarray)}
    return particle_flow(particles, surface=_within(surface, np.unique(particles.t)), **constants)


def _sigmas(fields: VectorFields, settings: Settings, frame: Frame, usable: Bool) -> dict[str, Any]:
    """Standard deviations from the files, or one number from the settings."""
    if settings.sigma is not None:
        sigma = frame.sigma(settings)
        return {"sigma_u": sigma, "sigma_v": sigma}
    found: dict[str, Any] = {}
    for name in ("sigma_u", "sigma_v"):
        values = getattr(fields, name)
        wrong = None if values is None else usable & (np.isinf(values) | (values < 0))
        if values is not None and wrong is not None and wrong.any():
            raise DataFileError(
                f"{name} must be positive, and NaN where it is not known, got {values[wrong][0]:g} "
                f"at {int(wrong.sum())} vectors: correct it, or leave sigma_u and sigma_v out"
            )
        good = None if values is None else usable & np.isfinite(values) & (values > 0)
        if values is None or good is None or not good.any():
            return {}
        # A measured vector without a standard deviation has the largest one.
        worst = values[good].max()
        good = np.isfinite(values) & (values > 0)
        found[name] = np.where(good, values, worst).astype(np.float32)
    return found


def _warn(text: str) -> None:
    warnings.warn(text, FlowFileWarning, stacklevel=4)
