"""The result of an identification with what belongs to it: network, fields, history, figures."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from granpinn.arrays import Float32, Float64
from granpinn.data import Flow
from granpinn.declared import checked
from granpinn.errors import BadInput
from granpinn.fit import prediction
from granpinn.fit.network import FILE, TrainedNetwork, read_network
from granpinn.physics.laws import Law
from granpinn.results import Fields, Result, read_fields, read_results
from granpinn.results.dataset import fields_dataset, members_tree
from granpinn.training.history import Row, columns, read_history

if TYPE_CHECKING:
    from granpinn.figures.plots import Plots


class Parts(Protocol):
    """Where network, fields and history of a result come from; BadInput where one is missing."""

    def network(self) -> TrainedNetwork: ...
    def fields(self) -> Fields: ...
    def history(self) -> dict[str, Float64]: ...


@dataclass(frozen=True)
class InMemory:
    """Those of a run in this process.

    Attributes:
        trained: the network.
        flow: what it was trained on.
        rows: of the history.
        maps: its fields; None: they are predicted when they are asked for.
    """

    trained: TrainedNetwork
    flow: Flow
    law: Law
    rows: Sequence[Row]
    maps: Fields | None = None

    def network(self) -> TrainedNetwork:
        return self.trained

    def fields(self) -> Fields:
        return self.maps or prediction.predict(self.flow, self.trained.model)

    def history(self) -> dict[str, Float64]:
        table = np.array([[*row.values().values()] for row in self.rows], np.float64)
        names = columns(self.law)
        return dict(zip(names, table.reshape(-1, len(names)).T, strict=True))


@dataclass(frozen=True)
class InFolder:
    """Those of a run folder."""

    folder: Path
    law: Law

    def network(self) -> TrainedNetwork:
        return read_network(self.folder / FILE)

    def fields(self) -> Fields:
        return read_fields(self.folder / "fields.h5")

    def history(self) -> dict[str, Float64]:
        return read_history(self.folder / "history.csv", self.law)


class Identification(Result):
    """A `Result` with its network, fields, history and figures.

        result = granpinn.identify(flow)     # or granpinn.load("run")
        result                               # the law with its intervals, in a notebook a table
        result.fields.p.sel(t=1.0, method="nearest")
        result.plot.law()

    A part that a run folder lacks is told when it is asked for.
    """

    _parts: Parts | None = None  # none of a copy by dataclasses.replace

    @classmethod
    def of(cls, result: Result, parts: Parts) -> Identification:
        """A result with its parts."""
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

    def predict(self, x: npt.ArrayLike, y: npt.ArrayLike, t: npt.ArrayLike) -> dict[str, Float32]:
        """The fields at any points; `TrainedNetwork.predict` explains the arguments."""
        return self.network.predict(x, y, t)

    def to_arviz(self) -> Any:
        """The parameters of all networks of an ensemble, as an xarray.DataTree for ArviZ.

        Its group `posterior` has every free parameter over (chain, draw): one chain, one draw for
        each network. The scatter of networks is one part of the error bars and no posterior.
        """
        return members_tree(self)

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
        run_dir: folder of `identify(..., run_dir=...)` or `granpinn train ... --out`.

    Raises:
        ResultsFileError: there is no valid results.json.
    """
    folder = Path(run_dir)
    result = read_results(folder / "results.json")
    return Identification.of(result, InFolder(folder, result.friction_law))
