"""Settings of a conversion, on the command line and in `granpinn.importers.read`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

from granpinn.config.fields import flag_of, setting
from granpinn.data.flow import PERIOD_X, SOLVER_CELL, SOLVER_MEAN, SURFACE_SD, WALL_GAP
from granpinn.declared import require_fields
from granpinn.importers import units
from granpinn.importers.vectors import DataFileError

SURFACES = ("auto", "none")  # other values of --surface name a file
# Settings that a flow file keeps as attributes of the same names, in SI.
LENGTHS = (WALL_GAP, PERIOD_X, SURFACE_SD, SOLVER_CELL, SOLVER_MEAN)
QUANTITIES = {
    **dict.fromkeys(("grain_diameter", *LENGTHS), "length"),
    **dict.fromkeys(("grain_density", "density"), "density"),
    "gravity": "acceleration",
    "start": "time",
    "sigma": "velocity",
}
_files, _calibration, _frame, _flow, _material, _grains = (
    partial(setting, group=name)
    for name in ("files", "calibration", "frame", "flow", "material", "grains")
)


@dataclass(frozen=True)
class Settings:
    """Numbers with units are text, such as "0.12 mm/px"; None means not given."""

    format: str = _files("auto", "format of the files, auto = from their content")
    zeros: Literal["measured", "missing"] = _files(
        "measured", "vectors that are exactly (0, 0): measured, or missing"
    )
    frames: str | None = _files(
        None, "frames to use, FIRST:LAST:STEP counted from 0 (LAST not included)"
    )
    keep_interpolated: bool = _files(False, "use interpolated vectors as if they were measured")
    force: bool = _files(False, "write the flow file although a check calls it impossible")
    track_window: int = _files(
        5, "frames of the local polynomial that gives the velocity of a track; odd"
    )

    scale: str | None = _calibration(
        None, "size of a pixel, '0.12 mm/px'; needed where lengths are in pixels"
    )
    frame_rate: str | None = _calibration(
        None, "velocity fields per second, '500 Hz', or the time between two, '2 ms'"
    )
    pulse_delay: str | None = _calibration(
        None, "time between the two images of a pair, of double frames; default 1 / frame rate"
    )
    start: str | None = _calibration(
        None,
        "time of the first frame since the release of the grains, '4 ms'; "
        "default half a frame for fields between two images, 0 for tracks",
    )
    times: str | None = _calibration(
        None,
        "file with one time per frame, first line such as 't [s]' or 'frame;t [ms]'; or "
        "'name': the last number in the name of each file",
    )
    length_unit: str | None = _calibration(
        None, "unit of x and y, where the files do not say or say it wrong"
    )
    time_unit: str | None = _calibration(None, "unit of t, likewise")
    velocity_unit: str | None = _calibration(
        None, "unit of u and v, likewise; default length unit / time unit"
    )
    window: str | None = _calibration(
        None,
        "side of the interrogation windows of PIV, '32 px' (of the last pass): each vector is a "
        "mean over it, and so is then the velocity of the network",
    )
    dimensionless: bool = _calibration(
        False, "the data have no units (simulations): give plain numbers everywhere"
    )

    origin: str | None = _frame(
        None,
        "the point x,y in the coordinates of the files that becomes 0,0; default "
        "the lower left vector for images, else the origin of the files",
    )
    flip_y: Literal["auto", "yes", "no"] = _frame(
        "auto", "turn y and v around: yes, no, or auto = where y points down as in images"
    )
    gravity: str = _frame("9.81 m/s^2", "strength of gravity; 1 if dimensionless")
    tilt: str = _frame(
        "0 deg",
        "angle of a plumb line in the image: positive if its lower end is to the "
        "right of the upper one; rotates gravity, so a tilted camera or chute needs no rotation",
    )

    steady: bool = _flow(False, "the flow is steady: one frame, its mean over time, is enough")
    period_x: str | None = _flow(
        None,
        "length of the period along x, '0.5 m', of periodic sides; of a uniform slope any length "
        "above that of the picture",
    )

    grain_diameter: str | None = _material(None, "mean grain diameter, '0.8 mm'")
    grain_density: str | None = _material(
        None, "density of a grain, '2500 kg/m^3'; enters the inertial number"
    )
    solid_fraction: float | None = _material(
        None, "volume of grains / volume, such as 0.6; bulk density = grain density x it"
    )
    density: str | None = _material(
        None, "bulk density, '1500 kg/m^3', in place of the solid fraction"
    )
    sigma: str | None = _material(
        None, "standard deviation of u and of v, '0.1 px/frame'; default from the files"
    )

    mask: str | None = _grains(
        None, "image, or pattern of one image per frame, black where there are no grains"
    )
    surface: str = _grains(
        "auto",
        "line of the free surface: none, a CSV file with the "
        "columns t (or frame), x, y, or auto = from the fraction field or the mask, if any",
    )
    walls: str | None = _grains(
        None,
        "CSV file of walls: columns x, y of points in order, nan between two pieces; if known u, "
        "v (motion of the wall), slip (0: grains move with the wall, 1: not), p "
        "(normal stress)",
    )
    surface_sd: str | None = _grains(
        None,
        "how well the line of the free surface is known, '0.4 mm': standard deviation of an offset "
        "of the whole line; default half a grain, or half a spacing where a mask gives the line",
    )
    wall_gap: str | None = _grains(
        None, "distance between the side walls, '20 mm'; their friction is then in the equations"
    )
    grid_spacing_of_solver: str | None = _grains(
        None,
        "cell of the solver, if a simulation made the data, '0.1 mm': shear bands are then as wide "
        "as its cells, and partly filled cells are kept",
    )
    averaging_length_of_solver: str | None = _grains(
        None,
        "length of the mean strain rate in the friction law of the solver; default that of central "
        "differences, 0.82 cells",
    )

    @property
    def fewest_frames(self) -> int:
        """Frames that a flow needs: a single one does not show whether it is steady."""
        return 1 if self.steady else 2

    @property
    def calibration(self) -> units.Calibration:
        """What the settings say of pixels and frames."""
        rate, flag = self.frame_rate, "--frame-rate"
        if self.dimensionless:
            plain = units.Calibration(dimensionless=True)
            interval = None if rate is None else 1 / plain.positive(rate, "time", flag)
            return plain._replace(interval=interval)
        pixel, pair = self.scale, self.pulse_delay
        interval = None if rate is None else units.frame_time(rate, flag)
        delay = interval if pair is None else units.frame_time(pair, "--pulse-delay")
        return units.Calibration(None if pixel is None else units.scale(pixel), delay, interval)

    def number(self, name: str) -> float | None:
        """A setting of `QUANTITIES` in SI, or as it is without units; None if it is not given."""
        text = getattr(self, name)
        if text is None:
            return None
        convert = self.calibration.number if name == "start" else self.calibration.positive
        return convert(text, QUANTITIES[name], flag_of(name))

    def __post_init__(self) -> None:
        require_fields(self, DataFileError)
        if self.solid_fraction is not None and not 0 < self.solid_fraction <= 1:
            raise DataFileError(
                f"--solid-fraction must be above 0 and at most 1, got {self.solid_fraction:g}"
            )


def material_of(settings: Settings) -> tuple[dict[str, Any], dict[str, float]]:
    """The constants of the grains as fields of a flow, and lengths as attributes of its file.

    The bulk density is that of a grain times the solid fraction. `require_complete` (frame.py) has
    found the settings complete.
    """
    grain, bulk = settings.number("grain_density"), settings.number("density")
    fraction = settings.solid_fraction
    if grain is not None and fraction is not None:
        if bulk is not None and not math.isclose(bulk, grain * fraction, rel_tol=1e-3):
            raise DataFileError(
                f"--density must be grain density times solid fraction, {grain * fraction:g}, got "
                f"{bulk:g}: leave one of the three out"
            )
        bulk = grain * fraction
    elif grain is None and bulk is not None and fraction is not None:
        grain = bulk / fraction
    constants = {
        "grain_diameter": settings.number("grain_diameter"),
        "grain_density": grain,
        "density": 1.0 if bulk is None else bulk,  # without units the bulk density is the unit
        "density_unit": None if settings.dimensionless else "kg/m^3",
        "length_unit": "1" if settings.dimensionless else "m",
        "time_unit": "1" if settings.dimensionless else "s",
        **dict.fromkeys(("sigma_u", "sigma_v"), settings.number("sigma")),
    }
    lengths = {name: settings.number(name) for name in LENGTHS}
    return constants, {name: value for name, value in lengths.items() if value is not None}
