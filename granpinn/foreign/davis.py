"""Buffers of LaVision's DaVis, by lvpyio."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import lvpyio
import numpy as np

from granpinn.foreign.program import Answer

LIBRARY = "lvpyio"


def read(path: Path, answer: Answer) -> dict[str, Any]:
    """u, v, enabled, choice, mask [Y, X], sigma_u, sigma_v if there are any, scales and attributes;
    `image` if the buffer holds no vectors."""
    frame = _frame(lvpyio.read_buffer(str(path)))
    return {n: answer.keep(v) if isinstance(v, np.ndarray) else v for n, v in frame.items()}


def _frame(buffer: Any) -> dict[str, Any]:
    if len(buffer) != 1:
        raise ValueError(f"a buffer holds {len(buffer)} frames, export one vector field a file")
    frame = buffer[0]
    if not hasattr(frame, "as_masked_array") or "U0" not in frame.components:
        return {"image": True}
    vectors, scales, grid = frame.as_masked_array(), frame.scales, frame.grid
    found: dict[str, Any] = {
        "u": np.array(vectors["u"].filled(np.nan)),
        "v": np.array(vectors["v"].filled(np.nan)),
        "enabled": np.asarray(frame.enabled[0], bool),
        "choice": np.asarray(frame.active_choice[0]),
        "mask": np.asarray(frame.masks[0], bool),
        **{"x_slope": float(scales.x.slope), "x_offset": float(scales.x.offset)},
        **{"y_slope": float(scales.y.slope), "y_offset": float(scales.y.offset)},
        **{"x_step": float(grid.x), "y_step": float(grid.y)},
        "units": {"x": str(scales.x.unit), "y": str(scales.y.unit), "u": str(scales.i.unit)},
        "acquired": str(frame.attributes.get("AcqTimeSeries", "")),
        "frame_dt": str(frame.attributes.get("FrameDt", "")),
    }
    names = [f"TS:Uncertainty V{axis}" for axis in "xy"]
    if all(name in frame.components for name in names):
        for name, target in zip(names, ("sigma_u", "sigma_v"), strict=True):
            component = frame.components[name]
            found[target] = np.asarray(component[0], np.float64) * component.scale.slope
            found["units"][target] = str(getattr(component.scale, "unit", ""))
    return found
