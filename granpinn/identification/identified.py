"""The result of an identification with what belongs to it: network, fields, history, figures."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from granpinn.arrays import Float32, Float64
from granpinn.declared import checked
from granpinn.errors import BadInput
from granpinn.output import make_folder
from granpinn.results import (
    Fields,
    Result,
    read_fields,
    read_results,
    write_fields,
    write_results,
)
from granpinn.results.fields import fields_dataset
from granpinn.training.history import History, read_history, row_of

if TYPE_CHECKING:
    from granpinn.figures.plots import Plots
    from granpinn.fit.network import TrainedNetwork


class Identification(Result):
    """A `Result` with its network, fields, history and figures.

        result = granpinn.identify(flow)     # or granpinn.load("run")
        result                               # the law with its intervals, in a notebook a table
        result.fields.p.sel(t=1.0, method="nearest")
        result.plot.law()

    A part that a run folder lacks raises BadInput, which names it, when it is asked for.
    """

    _folder: Path | None = None  # of the run; none in memory, and of a changed copy
    _predict: Callable[[], Fields] | None = None  # in memory: makes the fields

    @classmethod
    def of(
        cls,
        result: Result,
        folder: Path | None = None,
        predict: Callable[[], Fields] | None = None,
        **known: Any,
    ) -> Identification:
        """A result with its parts: those of a run folder, or the values of the properties below."""
        made = cls(**{f.name: getattr(result, f.name) for f in dataclasses.fields(Result)})
        vars(made).update(known, _folder=folder, _predict=predict)
        return made

    def __eq__(self, other: object) -> bool:
        """Whether all records are equal, also those of a result that was read from a file."""
        if not isinstance(other, Result):
            return NotImplemented
        names = [f.name for f in dataclasses.fields(Result)]
        return all(getattr(self, name) == getattr(other, name) for name in names)

    __hash__ = Result.__hash__

    @cached_property
    def each(self) -> tuple[Identification, ...]:
        """The fits of the flows that have this law, each with its network and fields."""
        if not self.flows:
            return (self,)
        return tuple(load(self._place(f"{k:03d}")) for k in range(len(self.flows)))

    @cached_property
    def network(self) -> TrainedNetwork:
        """The trained network with its law, which predicts at any point."""
        from granpinn.fit import network_file  # torch is slow to import

        return network_file.read_network(self._file(network_file.FILE))

    @cached_property
    def grid(self) -> Fields:
        """The fields as arrays of the points inside the grains."""
        return self._predict() if self._predict else read_fields(self._file("fields.h5"))

    @cached_property
    def fields(self) -> Any:
        """The fields as an xarray.Dataset over (t, y, x), in the units of the flow.

        The variables are those of fields.h5: NaN outside the grains, units in their `attrs`.
        """
        return fields_dataset(self.grid)

    @cached_property
    def history(self) -> Mapping[str, Float64]:
        """The columns of history.csv by name: loss, its terms and the identified values."""
        return read_history(self._file("history.csv"), self.friction_law)

    def predict(self, x: npt.ArrayLike, y: npt.ArrayLike, t: npt.ArrayLike) -> dict[str, Float32]:
        """The predicted fields at points, in the units and axes of the flow.

        `network.predict` extrapolates beyond the grains, where the network was not trained.

        Args:
            x, y, t: positions and times of shapes that broadcast.

        Returns:
            The variables of `fields` by name, without references, each in the common shape; NaN
            outside the grains.

        Raises:
            BadInput: x, y and t are no numbers of shapes that broadcast.
        """
        found = self.network.predict(x, y, t)
        inside = self.grid.inside(np.asarray(x), np.asarray(y), np.asarray(t))
        return {
            name: np.where(inside, values, np.float32(np.nan)) for name, values in found.items()
        }

    def save(self, folder: str | os.PathLike[str]) -> Path:
        """Write results, network, fields and history to a new folder, which `load` takes; its path.

        Raises:
            BadInput: the folder holds a run, or this result lacks a part.
            OutputError: the folder cannot be made or written to.
        """
        from granpinn.fit import network_file

        path = Path(folder)
        if (path / "results.json").exists():
            raise BadInput(f"{path} already holds a run (results.json): choose another folder")
        network, fields, history = self.network, self.grid, self.history
        make_folder(path)
        network_file.write_network(network, path / network_file.FILE)
        write_fields(fields, path / "fields.h5")
        table = History(path / "history.csv", self.friction_law)
        table.begin(row_of(self.friction_law, row) for row in zip(*history.values(), strict=True))
        table.flush()
        table.close()
        write_results(self, path / "results.json")
        return path

    @checked
    def report(
        self, folder: str | os.PathLike[str] | None = None, *, time: float | None = None
    ) -> Path:
        """Draw the figures and write report.html; its path.

        Args:
            folder: where `save` writes the result first; by default its run folder.
            time: of the maps, in the unit of the flow; by default 0.7 of the last.

        Raises:
            BadInput: there is no run folder, and no folder was given.
            OutputError: the folder cannot be written to.
        """
        from granpinn.figures import page  # matplotlib is slow to import

        place = self._folder if folder is None else self.save(folder)
        if place is None:
            raise BadInput("this result is in memory: name a folder for the report, report('run')")
        return page.build(self, place, time)

    @property
    def plot(self) -> Plots:
        """Figures on axes of matplotlib: `result.plot()`, `result.plot.law()`, ..."""
        from granpinn.figures.plots import Plots  # matplotlib is slow to import

        return Plots(self)

    def _place(self, name: str) -> Path:
        """A file or folder of the run."""
        if self._folder is None:
            raise BadInput(
                "this is a changed copy of a result, without network, fields and history: take "
                "those of the result itself"
            )
        return self._folder / name

    def _file(self, name: str) -> Path:
        if self.flows:
            raise BadInput(
                "several flows have this law, each with its network, fields and history: take "
                "those of result.each[0], result.each[1], ..."
            )
        return self._place(name)


@checked
def load(run_dir: str | os.PathLike[str]) -> Identification:
    """The result of a run folder with its network, fields and history.

    Only results.json must be there. The other files are read when they are asked for.

    Args:
        run_dir: folder of `identify(..., run_dir=...)`, `result.save(...)` or `granpinn train ...
            --out`; or its results.json.

    Raises:
        ResultsFileError: there is no valid results.json.
    """
    folder = Path(run_dir)
    folder = folder.parent if folder.name == "results.json" and folder.is_file() else folder
    return Identification.of(read_results(folder / "results.json"), folder)
