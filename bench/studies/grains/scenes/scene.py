"""What a scene is: grains at the start, stages of LAMMPS, a grid and the container around it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from bench.studies.grains.materials import DISKS, TIME_STEP, Material, Shape, head, motion
from bench.studies.grains.packing import Packing
from granpinn.arrays import Bool, Float64

DUMP = "grains.dump"
START = "start.data"
COLUMNS = ("x", "y", "vx", "vy", "radius", "mass", "c_virial[1]", "c_virial[2]", "c_virial[4]")


@dataclass(frozen=True)
class Grid:
    """Square cells of a flow file: centres from left + cell/2 to right - cell/2."""

    left: float
    right: float
    bottom: float
    top: float
    cell: float = 2.0


@dataclass(frozen=True)
class Scene:
    """A flow of grains before it is made.

    Attributes:
        title: one line for tables.
        packing: grains at the start for a seed.
        box: smallest x, largest x, smallest y, largest y; of spheres, smallest and largest z.
        boundary: of LAMMPS; "p" along x is a periodic flow.
        stages: LAMMPS lines from the start to the first dump; gravity acts from the beginning.
        gravity: of the recorded stage.
        grid: cells of the flow file.
        inside: whether points (x, y) can hold grains: the kernel is renormalised to it.
        duration: recorded time; `snapshots` are spread over it evenly.
        frames: the snapshots are averaged in so many groups.
        dropped: recorded time at the start that is left out.
        mirror: x = 0 is a plane of symmetry.
        steady: the flow does not change during the record.
        filmed: a steady flow as a camera sees it: the file has many frames, and does not say that
            they show one flow. Its stress is that of the means over both halves of the record.
        surface: the grains have a free surface.
        attributes: walls and what else the flow file states.
        recorded: a LAMMPS line at the start of the record.
        columns: of the dump file.
        shape: of the grains.
        view: of spheres between side walls: the smallest and largest z of what is seen.
    """

    title: str
    packing: Callable[[int], Sequence[Packing]]
    box: tuple[float, ...]
    stages: Sequence[str]
    grid: Grid
    duration: float
    snapshots: int
    frames: int
    boundary: str = "f f p"
    gravity: tuple[float, float] = (0.0, -1.0)
    inside: Callable[[Float64, Float64], Bool] = lambda x, y: y > 0
    dropped: float = 0.0
    mirror: bool = False
    steady: bool = False
    filmed: bool = False
    surface: bool = True
    attributes: dict[str, float | str] = field(default_factory=dict)
    recorded: str = ""
    columns: tuple[str, ...] = COLUMNS
    shape: Shape = DISKS
    view: tuple[float, float] | None = None

    @property
    def period(self) -> float | None:
        """Length along x after which the flow repeats itself."""
        return self.box[1] - self.box[0] if self.boundary.startswith("p") else None


def gravity(x: float, y: float) -> str:
    """Sets or changes gravity."""
    return f"fix gravity all gravity 1.0 vector {x:.10g} {y:.10g} 0"


def run(time: float) -> str:
    """Goes on for a time."""
    return f"run {round(time / TIME_STEP)}"


def script(scene: Scene, material: Material) -> str:
    """The input of LAMMPS: start, the stages of the scene, then the record."""
    every = max(1, round(scene.duration / scene.snapshots / TIME_STEP))
    stages = "\n".join(scene.stages).replace("WALL_SMOOTH", material.wall(0.0))
    return f"""{head(scene.shape, scene.boundary)}
read_data {START}
{scene.shape.set_density}
group free type 1
group fixed type 2
group moving type 3
group glued union fixed moving
{motion(scene.shape, material)}
neigh_modify exclude group glued glued
thermo 20000
thermo_modify lost ignore flush yes
{gravity(0, -1)}
{stages.replace("WALL", material.wall(material.friction))}
reset_timestep 0
{scene.recorded}
compute virial free stress/atom NULL pair
dump record free custom {every} {DUMP} {" ".join(scene.columns)}
dump_modify record first yes format float %.6g
run {every * (scene.snapshots - 1)}
"""
