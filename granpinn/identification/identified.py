"""The result of an identification with what belongs to it: network, fields, history, figures."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
import numpy.typing as npt

from granpinn import report
from granpinn.arrays import Float32, Float64
from granpinn.data import Flow
from granpinn.declared import checked
from granpinn.errors import BadInput
from granpinn.fit import prediction
from granpinn.fit.network import FILE, TrainedNetwork, read_network, write_network
from granpinn.output import make_folder
from granpinn.physics.laws import FrictionLaw
from granpinn.results import (
    Fields,
    Result,
    read_fields,
    read_results,
    write_csv,
    write_fields,
    write_results,
)
from granpinn.results.dataset import fields_dataset
from granpinn.training.history import History, Row, columns, read_history

if TYPE_CHECKING:
    from granpinn.figures.plots import Plots


@dataclass(frozen=True)
class Parts:
    """Functions that give network, fields and history of a result; BadInput where one is missing.

    Attributes:
        each: gives the fits of several flows with one law; None: there is one flow.
        folder: of the run; None: the result is in memory.
    """

    network: Callable[[], TrainedNetwork]
    fields: Callable[[], Fields]
    history: Callable[[], dict[str, Float64]]
    each: Callable[[], tuple[Identification, ...]] | None = None
    folder: Path | None = None


def in_folder(folder: Path, law: FrictionLaw) -> Parts:
    """Those of a run folder."""
    history = partial(read_history, folder / "history.csv", law)
    read = partial(read_network, folder / FILE), partial(read_fields, folder / "fields.h5")
    return Parts(*read, history, folder=folder)


def in_memory(
    trained: TrainedNetwork,
    flow: Flow,
    law: FrictionLaw,
    rows: Sequence[Row],
    maps: Fields | None = None,
) -> Parts:
    """Those of a run in this process; without `maps` the fields are predicted when asked for."""
    predict = partial(prediction.predict, flow, trained.model)
    fields = predict if maps is None else partial(_given, maps)
    return Parts(partial(_given, trained), fields, partial(_columns, law, rows))


def of_flows(each: Callable[[], tuple[Identification, ...]], folder: Path | None) -> Parts:
    """Those of several flows with one law: each flow has its own."""
    return Parts(_refused, _refused, _refused, each, folder)


def _given(value: Any) -> Any:
    return value


def _columns(law: FrictionLaw, rows: Sequence[Row]) -> dict[str, Float64]:
    table = np.array([[*row.values().values()] for row in rows], np.float64)
    return dict(zip(columns(law), table.reshape(-1, len(columns(law))).T, strict=True))


def _refused() -> NoReturn:
    raise BadInput(
        "several flows have this law, each with its network, fields and history: take those of "
        "result.each[0], result.each[1], ..."
    )


class Identification(Result):
    """A `Result` with its network, fields, history and figures.

        result = granpinn.identify(flow)     # or granpinn.load("run")
        result                               # the law with its intervals, in a notebook a table
        result.fields.p.sel(t=1.0, method="nearest")
        result.plot.law()

    A part that a run folder lacks raises BadInput, which names it, when it is asked for.
    """

    _parts: Parts | None = None  # none of a copy by dataclasses.replace

    @classmethod
    def of(cls, result: Result, parts: Parts | None) -> Identification:
        """A result with its parts; None: there are none."""
        made = cls(**{f.name: getattr(result, f.name) for f in dataclasses.fields(Result)})
        object.__setattr__(made, "_parts", parts)
        return made

    def __eq__(self, other: object) -> bool:
        """Whether all records are equal, also those of a result that was read from a file."""
        if not isinstance(other, Result):
            return NotImplemented
        names = [f.name for f in dataclasses.fields(Result)]
        return all(getattr(self, name) == getattr(other, name) for name in names)

    __hash__ = Result.__hash__

    @property
    def each(self) -> tuple[Identification, ...]:
        """The fits of the flows that have this law, each with its network and fields."""
        each = self._held().each
        return (self,) if each is None else each()

    @cached_property
    def network(self) -> TrainedNetwork:
        """The trained network with its law, which predicts at any point."""
        return self._held().network()

    @cached_property
    def grid(self) -> Fields:
        """The fields as arrays of the points inside the grains."""
        return self._held().fields()

    @cached_property
    def fields(self) -> Any:
        """The fields as an xarray.Dataset over (t, y, x), in the units of the flow.

        The variables are those of fields.h5: NaN outside the grains, units in their `attrs`.
        """
        return fields_dataset(self.grid)

    @cached_property
    def history(self) -> Mapping[str, Float64]:
        """The columns of history.csv by name: loss, its terms and the identified values."""
        return self._held().history()

    def predict(
        self, x: npt.ArrayLike, y: npt.ArrayLike, t: npt.ArrayLike, *, extrapolate: bool = False
    ) -> dict[str, Float32]:
        """The predicted fields at points, in the units and axes of the flow.

        Args:
            x, y, t: positions and times of shapes that broadcast.
            extrapolate: whether to give what the network says where there are no grains, beyond the
                grid and after the last frame too; it was not trained there.

        Returns:
            The variables of `fields` by name, without references, each in the common shape; NaN
            outside the grains.

        Raises:
            BadInput: x, y and t are no numbers of shapes that broadcast.
        """
        found = self.network.predict(x, y, t)
        if extrapolate:
            return found
        inside = self.grid.inside(np.asarray(x), np.asarray(y), np.asarray(t))
        return {
            name: np.where(inside, values, np.float32(np.nan)) for name, values in found.items()
        }

    def to_dataframe(self) -> Any:
        """The parameters as a pandas.DataFrame, one in a row.

        Columns: value, std, low_90, high_90, fixed, determined, true, error_percent; NaN where
        there is no number.
        """
        import pandas

        rows = {}
        for name, p in self.parameters.items():
            low, high = p.interval_90 or (None, None)
            ends = {"low_90": low, "high_90": high, "fixed": p.fixed, "determined": p.determined}
            known = {"true": getattr(self.truth, name, None)}
            known["error_percent"] = self.error_percent.get(name)
            rows[name] = {"value": p.value, "std": p.std} | ends | known
        table = pandas.DataFrame.from_dict(rows, orient="index")
        numbers = {name: float for name in table if name not in ("fixed", "determined")}
        return table.astype(numbers)

    def save(self, folder: str | os.PathLike[str]) -> Path:
        """Write results, network, fields and history to a new folder, which `load` takes; its path.

        Raises:
            BadInput: the folder holds a run, or this result lacks a part.
            OutputError: the folder cannot be made or written to.
        """
        path = Path(folder)
        if (path / "results.json").exists():
            raise BadInput(f"{path} already holds a run (results.json): choose another folder")
        network, fields, history = self.network, self.grid, self.history
        make_folder(path)
        write_network(network, path / FILE)
        write_fields(fields, path / "fields.h5")
        table = History(path / "history.csv", self.friction_law)
        table.open()
        for values in zip(*history.values(), strict=True):
            table.append(Row.of(self.friction_law, values))
        table.flush()
        table.close()
        write_csv(self, path / "results.csv")
        write_results(self, path / "results.json")
        return path

    def report(self, folder: str | os.PathLike[str] | None = None) -> Path:
        """Draw the figures and write report.html; its path.

        Args:
            folder: where `save` writes the result first; by default its run folder.

        Raises:
            BadInput: there is no run folder, and no folder was given.
            OutputError: the folder cannot be written to.
        """
        parts = self._held()
        if folder is not None:
            return report.build(self.save(folder))
        if parts.folder is not None:
            return report.build(parts.folder)
        raise BadInput("this result is in memory: name a folder for the report, report('run')")

    @property
    def plot(self) -> Plots:
        """Figures on axes of matplotlib: `result.plot()`, `result.plot.law()`, ..."""
        from granpinn.figures.plots import Plots  # matplotlib is loaded when it is used

        return Plots(self, lambda: self.grid, lambda: self.history)

    def _held(self) -> Parts:
        if self._parts is None:
            raise BadInput(
                "this is a changed copy of a result, without network, fields and history: take "
                "those of the result itself"
            )
        return self._parts


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
    result = read_results(folder / "results.json")
    if result.flows:
        places = [folder / f"{k:03d}" for k in range(len(result.flows))]
        return Identification.of(result, of_flows(lambda: tuple(map(load, places)), folder))
    return Identification.of(result, in_folder(folder, result.friction_law))
