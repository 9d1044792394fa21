"""Variables of MATLAB files: of version 5 to 7 by scipy, of version 7.3, which is HDF5, by h5py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5r
from scipy.io import loadmat

from granpinn.foreign import hdf5
from granpinn.foreign.program import Answer

LIBRARY = "scipy or h5py"


def read(path: Path, answer: Answer, names: list[str]) -> dict[str, Any]:
    """Those variables of these names that the file has.

    A matrix of numbers is an array of float64 with at least two axes, text a string, and a cell
    array `{"shape", "cells"}` with the cells in MATLAB's order; anything else, and an empty matrix,
    is None.
    """
    if not h5py.is_hdf5(path):
        variables = loadmat(path, variable_names=names)
        return {name: _value(variables[name], answer) for name in names if name in variables}
    with hdf5.opened(path) as file:
        datasets = {name: hdf5.dataset_of(file, name) for name in names}
        return {n: _stored(n, d, answer) for n, d in datasets.items() if d is not None}


def _value(value: Any, answer: Answer) -> Any:
    """A variable of version 5 to 7."""
    if not isinstance(value, np.ndarray) or value.size == 0:
        return None
    if value.dtype == object:
        return {"shape": value.shape, "cells": [_value(v, answer) for v in value.ravel(order="F")]}
    if value.dtype.kind == "U":
        return "".join(value.ravel())
    return _matrix(value, answer) if value.dtype.kind in "fiub" else None


def _matrix(value: Any, answer: Answer) -> Any:
    return answer.keep(np.atleast_2d(value.astype(np.float64)))


def _stored(name: str, dataset: h5py.Dataset, answer: Answer) -> Any:
    """A variable of version 7.3: stored transposed, cells as references, empty by attribute."""
    if dataset.attrs.get("MATLAB_empty") or not dataset.size:
        return None
    if h5py.check_ref_dtype(dataset.dtype) is h5py.Reference:
        references = hdf5.values(name, dataset).T
        items = [h5r.dereference(r, dataset.file.id) if r else None for r in references.ravel("F")]
        cells = [item and _stored(name, hdf5.own_dataset(name, item), answer) for item in items]
        return {"shape": references.shape, "cells": cells}
    if hdf5.number_type(dataset.id.get_type()) is None:
        return None
    answer.require(8 * dataset.size)
    value = hdf5.values(name, dataset).T
    if dataset.attrs.get("MATLAB_class") == b"char":
        return "".join(map(chr, value.ravel(order="F")))
    return _matrix(value, answer)
