"""The simulator: collapses and chutes of grains with a known friction law."""

from granpinn.simulation.chute import Chute
from granpinn.simulation.collapse import Collapse
from granpinn.simulation.engine import Engine, SimulationError, State, StepReport
from granpinn.simulation.run import demo_path, simulate
from granpinn.simulation.scene import Scene

__all__ = [
    "Chute",
    "Collapse",
    "Engine",
    "Scene",
    "SimulationError",
    "State",
    "StepReport",
    "demo_path",
    "simulate",
]
