"""Center of an ensemble, and the member that is nearest to it, for every friction law."""

from __future__ import annotations

import numpy as np

from granpinn.arrays import Float64
from granpinn.physics.laws import DEFAULT, Law
from granpinn.results.records import Members

Matrix = tuple[tuple[float, ...], ...]


def center(members: Members, law: Law = DEFAULT) -> tuple[float, ...]:
    """Medians over the members whose data are as measured, in the order of `law.free`.

    Over all members if no such member is left. If a parameter is optimised as its rise above the
    one before it, the median is of the rise: the data determine the slope of mu(I), not mu_2. The
    median of the logarithm would be the same.
    """
    values = values_of(members, law)
    kept = values[~np.array(members.redrawn)]
    kept = kept if len(kept) else values
    found: list[float] = []
    for k, name in enumerate(law.free):
        if law.parameter(name).variable == "log_above":
            found.append(found[-1] + float(np.median(kept[:, k] - kept[:, k - 1])))
        else:
            found.append(float(np.median(kept[:, k])))
    return tuple(found)


def nearest(members: Members, law: Law, scatter: Matrix | None = None) -> int:
    """Index of the member that is nearest to the center.

    Args:
        scatter: covariance of `deviations` over seeds, the metric of the distance; None: equal
            weights of the parameters.
    """
    z = deviations(members, law)
    covariance = np.eye(z.shape[1]) if scatter is None else np.array(scatter)
    distance = np.einsum("ki,ij,kj->k", z, np.linalg.inv(covariance), z)
    distance[np.array(members.redrawn) & ~np.all(members.redrawn)] = np.inf
    return int(np.argmin(distance))


def values_of(members: Members, law: Law = DEFAULT) -> Float64:
    """The values of the members [K, len(law.free)]."""
    return np.stack([members.values[name] for name in law.free], axis=1)


def deviations(members: Members, law: Law = DEFAULT) -> Float64:
    """(value - center) / first parameter of the center, of the members [K, len(law.free)].

    A cohesion has another unit than friction: its deviation is relative to its own center.
    """
    middle = np.array(center(members, law))
    unit = [middle[k if name == law.cohesion else 0] for k, name in enumerate(law.free)]
    return np.asarray((values_of(members, law) - middle) / np.array(unit))
