"""Settings of a conversion, on the command line and in `granpinn.importers.read`."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any, Literal

from granpinn.config.fields import flag_of
from granpinn.data.flow import PERIOD_X, SOLVER_CELL, SOLVER_MEAN, SURFACE_SD, WALL_GAP
from granpinn.declared import require_fields
from granpinn.importers import units
from granpinn.importers.vectors import DataFileError

SURFACES = ("auto", "mask", "fraction", "none")  # other values of --surface name a file
# Settings that a flow file keeps as attributes of the same names, in SI.
LENGTHS = (WALL_GAP, PERIOD_X, SURFACE_SD, SOLVER_CELL, SOLVER_MEAN)
QUANTITIES = {
    **dict.fromkeys(("grain_diameter", *LENGTHS), "length"),
    **dict.fromkeys(("grain_density", "density"), "density"),
    "gravity": "acceleration",
    "start": "time",
}


def _setting(default: Any, group: str, text: str) -> Any:
    return field(default=default, metadata={"group": group, "help": text})


@dataclass(frozen=True)
class Settings:
    """Numbers with units are text, such as "0.12 mm/px"; None means not given."""

    format: str = _setting("auto", "files", "format of the files, auto = from their content")
    fields: str | None = _setting(
        None, "files", "names of fields in simulation files, such as u=U,c=alpha.grains,p=p"
    )
    columns: str | None = _setting(
        None,
        "files",
        "names of columns in a table of tracks that granpinn does not know, such as "
        "x=abscissa,y=height,t=time",
    )
    zeros: Literal["measured", "missing"] = _setting(
        "measured", "files", "vectors that are exactly (0, 0): measured, or missing"
    )
    drop_duplicates: bool = _setting(
        False, "files", "keep the first of several rows of one particle in one frame"
    )
    frames: str | None = _setting(
        None, "files", "frames to use, FIRST:LAST:STEP counted from 0 (LAST not included)"
    )
    keep_interpolated: bool = _setting(
        False, "files", "use interpolated vectors as if they were measured"
    )
    force: bool = _setting(
        False,
        "files",
        "write the flow file although a check calls it impossible; and where a flag contradicts a "
        "file, the flag holds",
    )
    track_window: int = _setting(
        5, "files", "frames of the local polynomial that gives the velocity of a track; odd"
    )

    scale: str | None = _setting(
        None, "calibration", "size of a pixel, '0.12 mm/px'; needed where lengths are in pixels"
    )
    frame_rate: str | None = _setting(
        None, "calibration", "velocity fields per second, '500 Hz', or the time between two, '2 ms'"
    )
    pulse_delay: str | None = _setting(
        None,
        "calibration",
        "time between the two images of a pair, of double frames; default 1 / frame rate",
    )
    start: str | None = _setting(
        None,
        "calibration",
        "time of the first frame since the release of the grains, '4 ms'; "
        "default half a frame for fields between two images, 0 for tracks",
    )
    times: str | None = _setting(
        None,
        "calibration",
        "file with one time per frame, first line such as 't [s]' or 'frame;t [ms]'; or "
        "'name': the last number in the name of each file",
    )
    length_unit: str | None = _setting(
        None, "calibration", "unit of x and y, where the files do not say or say it wrong"
    )
    time_unit: str | None = _setting(None, "calibration", "unit of t, likewise")
    velocity_unit: str | None = _setting(
        None, "calibration", "unit of u and v, likewise; default length unit / time unit"
    )
    window: str | None = _setting(
        None,
        "calibration",
        "side of the interrogation windows of PIV, '32 px' (of the last pass): each vector is a "
        "mean over it, and so is then the velocity of the network",
    )
    dimensionless: bool = _setting(
        False, "calibration", "the data have no units (simulations): give plain numbers everywhere"
    )

    origin: str | None = _setting(
        None,
        "frame",
        "the point x,y in the coordinates of the files that becomes 0,0; default "
        "the lower left vector for images, else the origin of the files",
    )
    flip_y: Literal["auto", "yes", "no"] = _setting(
        "auto", "frame", "turn y and v around: yes, no, or auto = where y points down as in images"
    )
    gravity: str = _setting("9.81 m/s^2", "frame", "strength of gravity; 1 if dimensionless")
    tilt: str = _setting(
        "0 deg",
        "frame",
        "angle of a plumb line in the image: positive if its lower end is to the "
        "right of the upper one; rotates gravity, so a tilted camera or chute needs no rotation",
    )

    steady: bool = _setting(
        False, "flow", "the flow is steady: one frame, its mean over time, is enough"
    )
    period_x: str | None = _setting(
        None,
        "flow",
        "length of the period along x, '0.5 m', of periodic sides; of a uniform slope any length "
        "above that of the picture",
    )

    grain_diameter: str | None = _setting(None, "material", "mean grain diameter, '0.8 mm'")
    grain_density: str | None = _setting(
        None, "material", "density of a grain, '2500 kg/m^3'; enters the inertial number"
    )
    solid_fraction: float | None = _setting(
        None,
        "material",
        "volume of grains / volume, such as 0.6; bulk density = grain density x it",
    )
    density: str | None = _setting(
        None, "material", "bulk density, '1500 kg/m^3', in place of the solid fraction"
    )
    sigma: str | None = _setting(
        None, "material", "standard deviation of u and of v, '0.1 px/frame'; default from the files"
    )

    mask: str | None = _setting(
        None, "grains", "image, or pattern of one image per frame, black where there are no grains"
    )
    surface: str = _setting(
        "auto",
        "grains",
        "line of the free surface: mask, fraction, none, a CSV file with the "
        "columns t (or frame), x, y, or auto = from the fraction field or the mask, if any",
    )
    walls: str | None = _setting(
        None,
        "grains",
        "CSV file of walls: columns x, y of points in order, nan between two pieces; if known t, "
        "u, v (motion of the wall), slip (0: grains move with the wall, 1: not), p and tau "
        "(normal and shear stress)",
    )
    surface_sd: str | None = _setting(
        None,
        "grains",
        "how well the line of the free surface is known, '0.4 mm': standard deviation of an offset "
        "of the whole line; default half a grain, or half a spacing where a mask gives the line",
    )
    wall_gap: str | None = _setting(
        None,
        "grains",
        "distance between the side walls, '20 mm'; their friction is then in the equations",
    )
    grid_spacing_of_solver: str | None = _setting(
        None,
        "grains",
        "cell of the solver, if a simulation made the data, '0.1 mm': shear bands are then as wide "
        "as its cells, and partly filled cells are kept",
    )
    averaging_length_of_solver: str | None = _setting(
        None,
        "grains",
        "length of the mean strain rate in the friction law of the solver; default that of central "
        "differences, 0.82 cells",
    )
    note: str | None = _setting(None, "grains", "text to keep in the file")

    @property
    def fewest_frames(self) -> int:
        """Frames that a flow needs: a single one does not show whether it is steady."""
        return 1 if self.steady else 2

    @property
    def fewest_words(self) -> str:
        """The same in words."""
        return "at least one frame" if self.steady else "at least two frames (or one and --steady)"

    def number(self, name: str) -> float | None:
        """A setting of `QUANTITIES` in SI, or as it is without units; None if it is not given."""
        text, flag = getattr(self, name), flag_of(name)
        if text is None:
            return None
        if self.dimensionless:
            value = units.plain(text, flag)
        else:
            value = units.si(text, QUANTITIES[name], flag)
        return value if name == "start" else units.in_range(value, flag, text)

    def __post_init__(self) -> None:
        for f in dataclasses.fields(self):
            value = getattr(self, f.name)
            if str(f.type).startswith("str") and not isinstance(value, str | None):
                raise DataFileError(
                    f"{flag_of(f.name)} must be text such as '0.12 mm/px', got {value!r}"
                )
        require_fields(self, DataFileError)
        if self.solid_fraction is not None and not 0 < self.solid_fraction <= 1:
            raise DataFileError(
                f"--solid-fraction must be above 0 and at most 1, got {self.solid_fraction:g}"
            )
