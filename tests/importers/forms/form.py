"""Forms of one flow: their products, and the verdict on what granpinn reads."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from granpinn.data import Flow, FlowFileWarning, check_flow
from granpinn.data.schema import OF_FLOW
from granpinn.errors import BadInput

SUM = 16  # roundings of one number: units, origin, mean of a coordinate over its rows

# Relative to the largest number of an array.
FLOAT64, FLOAT32, FLOAT16 = 2.0**-53, 2.0**-24, 2.0**-11
TEXT = 0.5e-9  # ten digits
INT16 = 2.0**-16  # of the range

Axis = dict[Any, bool]
Departures = tuple[tuple[str, Any], ...]


def plain(*choices: Any) -> Axis:
    """Choices that granpinn must read."""
    return dict.fromkeys(choices, True)


def odd(*choices: Any) -> Axis:
    """Choices that granpinn may read or refuse."""
    return dict.fromkeys(choices, False)


class Given(NamedTuple):
    """A form that is written: how granpinn reads it, the true flow, and the rounding of numbers."""

    read: Callable[[], Flow]
    flow: Flow
    rounding: float


@dataclass(frozen=True)
class Family:
    """Forms of one format.

    Attributes:
        write: writes a form to a folder; None if its choices contradict each other, or leave out
            what no setting can say.
        axes: the choices by the names of the arguments of `write`; the first is the usual one.
    """

    write: Callable[..., Given | None]
    axes: Mapping[str, Axis]

    def written(self, folder: Path, **departures: Any) -> Given | None:
        """Write the form with choices that depart from the usual ones."""
        usual = {name: next(iter(axis)) for name, axis in self.axes.items()}
        return self.write(folder, **(usual | departures))

    def forms(self, pairs: bool = True) -> Iterator[tuple[dict[str, Any], bool]]:
        """Choices that depart from the usual form, and whether granpinn must read the form.

        Every choice alone, and with `pairs` every choice of an axis with one of every other axis.
        """
        others = {name: list(axis)[1:] for name, axis in self.axes.items()}
        yield {}, True
        for name, axis in self.axes.items():
            for choice in others[name]:
                yield {name: choice}, axis[choice]
        for one, two in itertools.combinations(self.axes, 2) if pairs else ():
            for k in range(max(len(others[one]), len(others[two]))):
                first, second = (others[name][k % len(others[name])] for name in (one, two))
                yield {one: first, two: second}, self.axes[one][first] and self.axes[two][second]

    def outcomes(self, folder: Path, pairs: bool = True) -> dict[Departures, tuple[str, bool]]:
        """The verdict on every form, and whether granpinn must read it."""
        found: dict[Departures, tuple[str, bool]] = {}
        for number, (departures, must) in enumerate(self.forms(pairs)):
            place = folder / str(number)
            place.mkdir()
            given = self.written(place, **departures)
            if given is not None:
                found[tuple(departures.items())] = verdict(given), must
        return found


def verdict(given: Given) -> str:
    """ "equal", "refused: ..." or "wrong: ..."."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", FlowFileWarning)
            found = given.read()
            check_flow(found)
    except BadInput as error:
        return f"refused: {error}"
    except Exception as error:
        return f"wrong: {type(error).__name__}: {error}"
    different = differences(found, given.flow, given.rounding)
    return "wrong: " + "; ".join(different) if different else "equal"


def differences(found: Flow, flow: Flow, rounding: float) -> list[str]:
    """One text for each part of a flow that differs by more than the rounding."""
    texts = []
    for name in ("length_unit", "time_unit", "density_unit"):
        if getattr(found, name) != getattr(flow, name):
            texts.append(f"{name} {getattr(found, name)} for {getattr(flow, name)}")
    ours, theirs = _parts(found, flow), _parts(flow, flow)
    if ours.keys() != theirs.keys():
        return [*texts, f"{', '.join(sorted(ours.keys() ^ theirs.keys()))} in one of them"]
    for name, expected in theirs.items():
        error = 2 * FLOAT32 if expected.dtype == np.float32 else 0.0
        text = _difference(ours[name], expected, max(SUM * rounding, SUM * FLOAT64, error))
        texts += [f"{name} {text}"] if text else []
    return texts


def _difference(found: Any, expected: Any, tolerance: float) -> str:
    if found.shape != expected.shape:
        return f"{list(found.shape)} for {list(expected.shape)}"
    gone = np.isnan(expected)
    if (np.isnan(found) != gone).any():
        return f"{int(np.isnan(found).sum())} NaN for {int(gone.sum())}"
    error = np.abs(found - expected, where=~gone, out=np.zeros(expected.shape))
    largest = np.abs(expected[~gone]).max(initial=0.0)
    if (error <= tolerance * largest).all():
        return ""
    worst = np.unravel_index(np.argmax(error), error.shape)
    return f"{found[worst]:.6g} for {expected[worst]:.6g}"


def _parts(flow: Flow, other: Flow) -> dict[str, Any]:
    """All arrays and numbers of a flow; scattered points in the order of those of the other."""
    names = ("gravity", "density", "grain_density", "grain_diameter", "sigma_u", "sigma_v")
    parts = {name: getattr(flow, name) for name in names}
    parts |= {name: flow.attributes.get(name) for name in OF_FLOW}
    parts["p"] = None if other.p is None else flow.p
    if flow.particles is None:
        parts |= {name: getattr(flow, name) for name in ("t", "y", "x", "c")}
        air = flow.c == 0  # where a velocity says nothing
        parts |= {n: np.where(air, np.nan, getattr(flow, n)) for n in ("u", "v")}
        for name in ("sigma_u", "sigma_v"):
            if np.ndim(parts[name]):
                parts[name] = np.where(flow.valid, parts[name], np.float32("nan"))
    for place in ("particles", "surface"):
        own, theirs = (_points(getattr(f, place)) for f in (flow, other))
        if own and theirs and own["t"].size == theirs["t"].size:
            own = _sorted_like(own, theirs)
        parts |= {f"{place}.{name}": values for name, values in own.items()}
    parts |= {f"walls.{name}": values for name, values in _points(flow.walls).items()}
    return {name: np.asarray(part) for name, part in parts.items() if part is not None}


def _points(points: Any) -> dict[str, Any]:
    return {} if points is None else {n: a for n, a in vars(points).items() if a is not None}


def _sorted_like(points: dict[str, Any], others: dict[str, Any]) -> dict[str, Any]:
    """Each point at the place of the nearest one of the others, if that is a permutation."""
    own, theirs = (
        np.stack([part[name] / (np.ptp(others[name]) or 1.0) for name in ("t", "x", "y")], axis=-1)
        for part in (points, others)
    )
    order = cKDTree(own).query(theirs)[1]
    if np.unique(order).size < order.size:
        return points
    return {name: values[order] for name, values in points.items()}
