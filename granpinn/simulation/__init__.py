"""The column-collapse simulator: the flow of grains with a known friction law."""

from granpinn.simulation.engine import Engine, SimulationError, State, StepReport
from granpinn.simulation.parameters import PAPER_CASES, Collapse
from granpinn.simulation.run import demo_path, simulate

__all__ = [
    "PAPER_CASES",
    "Collapse",
    "Engine",
    "SimulationError",
    "State",
    "StepReport",
    "demo_path",
    "simulate",
]
