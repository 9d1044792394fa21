"""The displacement between the two images of a pair, in pixels: it must suit a PIV program."""

from __future__ import annotations

import warnings

import numpy as np

from granpinn.data import FlowFileWarning
from granpinn.importers.frame import Frame
from granpinn.importers.vectors import VectorFields

# PIV programs are wrong by about 0.1 px, and their windows, of up to 256 px, do not find
# displacements of more than half of them.
LEAST, LARGEST = 0.1, 128.0
FASTEST = 0.99  # quantile


def warn_of_displacement(si: VectorFields, frame: Frame) -> None:
    """Warns if the fastest vectors move by less or more than a PIV program can measure.

    Args:
        si: vectors in SI units.
        frame: with the size of a pixel and the time between two images, where they are known.
    """
    if frame.pixel is None or frame.delay is None or not si.usable.any():
        return
    speed = np.hypot(si.u[si.usable], si.v[si.usable])
    moved = float(np.quantile(speed, FASTEST)) * frame.delay / frame.pixel
    if moved > 0 and not LEAST <= moved <= LARGEST:
        warnings.warn(
            f"the fastest vectors move by {moved:.3g} px between two images, and PIV programs "
            f"measure {LEAST:g} to {LARGEST:g} px: check --scale, --velocity-unit, --frame-rate "
            "and --pulse-delay",
            FlowFileWarning,
            stacklevel=3,
        )
