"""Conversion of files, or of arrays, to a flow: vectors, calibration, grains, surface, material."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from granpinn.arrays import Bool
from granpinn.config import settings_of
from granpinn.config.fields import unknown
from granpinn.data.flow import (
    STEADY,
    SURFACE_SD,
    WALL_GAP,
    WINDOW,
    Flow,
    Particles,
    Surface,
)
from granpinn.data.large import chosen
from granpinn.data.particles import particle_flow
from granpinn.data.scaling import scales_of
from granpinn.data.surface import folded
from granpinn.declared import checked
from granpinn.errors import warn
from granpinn.importers import points
from granpinn.importers import surface as surfaces
from granpinn.importers.arrays import ARRAYS, from_dataset
from granpinn.importers.frame import (
    Frame,
    frame_of,
    require_agreement,
    require_complete,
    stated_calibration,
    with_units,
)
from granpinn.importers.limits import require_room
from granpinn.importers.series import Source, measured, selected_frames, vectors_of
from granpinn.importers.settings import SURFACES, Settings, material_of
from granpinn.importers.vectors import GAPS, DataFileError, Validity, VectorFields

S = TypeVar("S", bound=Settings)
SETTINGS = tuple(settings_of(Settings))
ROUNDING = 1e-6  # of times in float32
MENDED = 2.0  # spacings of a window that averaging mends (bench/studies/window)


def convert(
    source: Source,
    settings: Settings | None = None,
    report: Callable[[str], None] | None = None,
    line: Sequence[npt.ArrayLike] | None = None,
) -> Flow:
    """A flow in SI units (or none) from measurement files.

    Args:
        source: files, folders or patterns; or vectors in memory: `VectorFields`, or a mapping of
            arrays as in importers/arrays.py.
        settings: calibration, material and the rest.
        report: called with every line of a report.
        line: t, x, y [n] of the free surface, in the units and axes of the source, in place of
            the setting `surface`.

    Raises:
        DataFileError: files or settings cannot be used; the message is one sentence.
    """
    settings = settings or Settings()
    tell = report or str
    whole = vectors_of(source, settings)
    count = sum(a.size for name, a in whole.arrays().items() if name != "validity")
    require_room(count, whole.facts.get("format", "the arrays"))
    tell(_described(whole))
    fields = with_units(selected_frames(measured(whole, settings), settings), settings)
    require_complete(fields, settings)
    constants, lengths = material_of(settings)
    if settings.mask is not None:
        fields = surfaces.with_mask(fields, settings.mask)
    frame = frame_of(fields, settings)
    require_agreement(whole, settings, frame)
    si = frame.apply(fields)
    given = None
    if line is not None:
        given = points.surface_of(line, frame)
    elif settings.surface not in SURFACES:
        given = points.read_surface(Path(settings.surface), frame)
    constants["gravity"] = frame.gravity
    constants["attributes"] = _attributes(fields, settings) | lengths
    constants["attributes"] |= _window(whole, settings, frame)
    if settings.walls is not None:
        constants["walls"] = points.read_walls(Path(settings.walls), frame)
    make = scattered_flow if si.scattered else grid_flow
    flow = make(si, settings, frame, given, constants)
    if flow.surface is None and settings.surface != "none":
        warn(
            "the free surface is not known, as there is neither a mask nor a fraction field, or no "
            "edge of the grains faces up in the field of view: train with --level V0, or give "
            "--mask or --surface with the points of a line"
        )
    for name, text in _summary(flow).items():
        tell(f"{name}: {text}")
    inferred = fields.facts.get("mask") == GAPS and settings.mask is None and fields.c is None
    if inferred and given is None and flow.surface is not None:
        tell(
            "the files do not say what is masked: the free surface is the edge of the vectors; "
            "give --mask or --surface if the PIV program lost vectors there"
        )
    return flow


@checked
def read(source: Source, **settings: Any) -> Flow:
    """A flow from files of a PIV, PTV or simulation program, or from arrays.

        flow = granpinn.read(
            "run/PIVlab_*.txt",
            scale="0.12 mm/px",
            frame_rate="500 Hz",
            grain_diameter="0.8 mm",
            grain_density="2500 kg/m^3",
            solid_fraction=0.6,
        )

    Args:
        source: files, folders or patterns; or a mapping of arrays t, y, x, u, v (see
            granpinn.importers.arrays).
        settings: as of `python -m granpinn.convert`, with _ for - (see
            granpinn.importers.settings).

    Raises:
        granpinn.importers.DataFileError: files or settings cannot be used; one sentence.
    """
    return convert(source, settings_from(settings, Settings))


def flow(
    data: Any = None, /, *, surface: Sequence[npt.ArrayLike] | str | None = None, **given: Any
) -> Flow:
    """A flow from arrays in memory, or from xarray.

        flow = granpinn.flow(
            t=t, y=y, x=x, u=u, v=v,
            length_unit="mm", time_unit="s", velocity_unit="m/s",
            grain_diameter="0.8 mm",
            grain_density="2500 kg/m^3",
            solid_fraction=0.6,
        )
        flow = granpinn.flow(dataset, grain_diameter="0.8 mm", ...)

    The result is in SI. `dimensionless=True` takes arrays without units.

    Args:
        data: an xarray.Dataset with u and v over (t, y, x), whose `units` are read.
        surface: t, x and y [n] of points of the free surface, in the units and axes of the arrays;
            or the setting.
        given: arrays t [T], y [Y], x [X], u and v [T, Y, X], or all [n] for scattered vectors, NaN
            where there is no vector; optional ones as in granpinn.importers.arrays (c, mask,
            sigma_u, ...); and settings, as of `granpinn convert` with _ for -, numbers with units
            as text.

    Raises:
        DataFileError: arrays or settings cannot be used; the message is one sentence.
    """
    # The setting `mask` is the name of a file.
    arrays = [n for n in given if n in ARRAYS and not isinstance(given[n], str)]
    parts = {name: given.pop(name) for name in arrays}
    if data is not None and (parts or not hasattr(data, "data_vars")):
        raise DataFileError(
            "flow takes one xarray.Dataset with u and v, or arrays by their names as "
            f"flow(t=t, y=y, x=x, u=u, v=v, ...), got {', '.join(parts) or type(data).__name__}"
        )
    if isinstance(surface, str):
        given["surface"], surface = surface, None
    source = parts if data is None else from_dataset(data)
    return convert(source, settings_from(given, Settings), line=surface)


def settings_from(
    given: Mapping[str, Any],
    kind: type[S],
    names: Collection[str] = SETTINGS,
    verb: str = "convert",
) -> S:
    """The settings of a conversion.

    Args:
        kind: the record.
        names: of its settings that may be given.
        verb: the command that has them.

    Raises:
        DataFileError: a name is unknown.
    """
    for name in given:
        if name not in names:
            raise DataFileError(unknown(name, [*names, *ARRAYS], verb))
    return kind(**given)


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
    c, source = surfaces.grains_of(fields)
    surface = line
    if line is not None and source == "vectors":
        if folded(fields.t, fields.x, line).any():
            warn(
                "the line of --surface is vertical or folds back, so that it does not say alone "
                "which cells hold grains there: give --mask"
            )
        c = np.where(surfaces.below_line(fields, line), 1.0, 0.0)
    elif line is None and settings.surface != "none" and source != "vectors":
        surface = surfaces.from_fraction(c, fields.t, fields.y, fields.x, frame.gravity)
    usable = fields.usable & (c == 1)
    kept = usable.any(axis=(1, 2))
    _require_frames(int(kept.sum()), settings)
    if not kept.all():
        warn(f"{int((~kept).sum())} of {kept.size} frames hold no valid vector and are left out")
    fields, c = fields.at(kept), c[kept]
    # The unit of a pressure is unknown, and a pressure is for scoring only.
    p = fields.p if settings.dimensionless else None
    if p is not None and not np.isfinite(p[c == 1]).all():
        p = None
    return Flow(
        **{name: getattr(fields, name) for name in ("t", "y", "x", "u", "v")},
        c=c.astype(np.float32),
        p=None if p is None else p.astype(np.float32),
        surface=_within(surface, fields.t),
        **(constants | _sigmas(fields, settings, usable[kept])),
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
        usable = usable & (fields.c > 1 - surfaces.FULL)
    _require_frames(np.unique(fields.t[usable]).size, settings)
    fields, surface = fields.at(usable), line
    if surface is None and settings.surface != "none" and fields.c is None:
        place = fields.t, fields.x, fields.y
        traced = surfaces.surface_of_grains(*place, constants["grain_diameter"], frame.gravity)
        if traced is not None:
            surface, sd = traced
            constants["attributes"] = {SURFACE_SD: sd, **constants["attributes"]}
    parts = {name: getattr(fields, name) for name in ("t", "x", "y", "u", "v")}
    particles = Particles(**parts, **_sigmas(fields, settings, fields.usable))
    return particle_flow(particles, surface=_within(surface, np.unique(particles.t)), **constants)


def _require_frames(count: int, settings: Settings) -> None:
    if count < settings.fewest_frames:
        raise DataFileError(
            "at least two frames (or one and --steady) must hold measured vectors among the "
            f"grains, got {count}: check the mask, --frames and the validity of the vectors, or "
            "lower --track-window"
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
    return chosen(surface, inside)


def _sigmas(fields: VectorFields, settings: Settings, usable: Bool) -> dict[str, Any]:
    """Standard deviations from the files; none if the settings state one."""
    if settings.sigma is not None:
        return {}
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


def _attributes(fields: VectorFields, settings: Settings) -> dict[str, str | float]:
    """Further attributes of the flow file: source and settings."""
    facts = {f"source_{name}": value for name, value in fields.facts.items() if value}
    found: dict[str, str | float] = {**facts, "source": fields.facts.get("format", "arrays")}
    for name in ("scale", "frame_rate", "pulse_delay", "tilt"):
        value = getattr(settings, name)
        if value is not None and value != getattr(Settings, name):
            found[name] = value
    return found | ({STEADY: 1} if settings.steady else {})


def _window(fields: VectorFields, settings: Settings, frame: Frame) -> dict[str, float]:
    """The window of --window; its pixels may be those of the header."""
    if settings.window is None:
        return {}
    pixel = frame.calibration.pixel or stated_calibration(fields.facts)[0]
    known = frame.calibration._replace(pixel=pixel)
    window = known.positive(settings.window, "length", "--window")
    if not 0 < window < np.ptp(fields.x) * frame.length:
        raise DataFileError(
            f"--window must be a length below the width of the field of vectors, got "
            f"{settings.window!r}: give the side of a window of the last pass, such as '32 px'"
        )
    spacing = float(np.median(np.diff(np.unique(fields.x)))) * frame.length
    if not fields.scattered and window > 1.01 * MENDED * spacing:
        warn(
            f"the windows are {window / spacing:.2g} spacings wide, and averaging mends "
            f"{MENDED:g}: mu(I) at large I may be some percent too large; use windows that overlap "
            "by half"
        )
    return {WINDOW: window}


def _described(fields: VectorFields) -> str:
    """Format, size and validity of the vectors."""
    n = fields.u.size
    shares = ", ".join(
        f"{np.mean(fields.validity == kind):.1%} {kind.name.lower()}"
        for kind in (Validity.VALID, Validity.INTERPOLATED, Validity.INVALID, Validity.MASKED)
    )
    frames = np.unique(fields.t).size
    shape = f"{n} scattered" if fields.scattered else f"{fields.y.size} x {fields.x.size}"
    origin = fields.facts.get("format", "arrays")
    if files := fields.facts.get("files"):
        origin += f", {files} file{'s' * (files != '1')}"
    units = fields.velocity_unit or "of unknown unit"
    return f"{origin}: {frames} frames, {shape} vectors {units}: {shares}"


def _summary(flow: Flow) -> dict[str, str]:
    """A flow in words; sizes and speeds show an error of calibration at a glance."""
    scales, vectors = scales_of(flow), flow.particles or flow
    length, rate = ("", "") if flow.length_unit == "1" else (" m", "/s")
    grains = flow.valid if vectors is flow else slice(None)
    speed = np.hypot(vectors.u[grains], vectors.v[grains], dtype=np.float64)
    found = flow.described() | {
        "speed": f"median {np.median(speed):.3g}, largest {speed.max():.3g}{length}{rate}; a free "
        f"fall over the initial height ends at {math.sqrt(2) * scales.velocity:.3g}",
        "initial height": f"{scales.length:.4g}{length} = "
        f"{scales.length / flow.grain_diameter:.0f} diameters",
    }
    if gap := flow.attributes.get(WALL_GAP):
        ratio = scales.length / float(gap)
        found["side walls"] = (
            f"the grains are {ratio:.2g} times as high as the gap is wide; the walls carry up to "
            f"about (wall friction) x {ratio:.2g} of friction, which train counts with "
            "--side_walls.friction"
        )
    del found["source"]
    return found
