"""The largest simulations that a flow file may ask for: wrong units must not take days."""

from __future__ import annotations

from granpinn.config import ConfigError
from granpinn.simulation.parameters import Collapse
from granpinn.simulation.scene import Scene

MOST_CELLS = 512  # across the box, unless the settings have a number
LARGEST_AREA = 3  # largest number of cells of a box, in squares of so many across
MOST_STEPS = 100_000  # of the largest length; the paper's collapse has 500


def require_few_cells(collapse: Collapse, chosen: int | None) -> None:
    """Raise ConfigError for a box in the file that is absurdly large beside its grains.

    `chosen`: cells across the box in the settings.
    """
    width, height = collapse.box
    cells = collapse.cells * (height / collapse.spacing)  # as a float: there may be too many
    most = LARGEST_AREA * max(MOST_CELLS, chosen or 0) ** 2
    if not cells <= most:
        raise ConfigError(
            f"the box in the file, {width:g} x {height:g} around grains {collapse.width:g} wide "
            f"and {collapse.height:g} high, would take {cells:.3g} cells of the simulator, at most "
            f"{most} are allowed: state box_width and box_height in the unit of x and y"
        )


def require_few_steps(scene: Scene) -> None:
    """Raise ConfigError for a last time in the file that is absurdly late for its grains."""
    assert scene.t_end is not None
    steps = scene.t_end / scene.largest_step
    if not steps <= MOST_STEPS:
        raise ConfigError(
            f"the last time in the file, {scene.t_end:g}, would take at least {steps:.3g} steps "
            f"of the simulator, at most {MOST_STEPS} are allowed: check the units of time and "
            f"gravity"
        )
