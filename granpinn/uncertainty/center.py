"""Center of an ensemble, and the member that is nearest to it, for every friction law."""

from __future__ import annotations

import numpy as np

from granpinn.arrays import Float64
from granpinn.physics.laws import DEFAULT, Law
from granpinn.results.records import Members


def center(members: Members, law: Law = DEFAULT) -> tuple[float, ...]:
    """Medians over the members, in the order of `law.free`.

    If a parameter is optimised as its rise above the one before it, the median is of the rise: the
    data determine the slope of mu(I), not mu_2. The median of the logarithm would be the same.
    """
    values = values_of(members, law)
    found: list[float] = []
    for k, name in enumerate(law.free):
        if law.parameter(name).variable == "log_above":
            found.append(found[-1] + float(np.median(values[:, k] - values[:, k - 1])))
        else:
            found.append(float(np.median(values[:, k])))
    return tuple(found)


def nearest(members: Members, law: Law) -> int:
    """Index of the member that is nearest to the center.

    The distance is relative to the first parameter of the center, and of a cohesion, which has
    another unit than friction, relative to its own center.
    """
    middle = np.array(center(members, law))
    unit = [middle[k if name == law.cohesion else 0] for k, name in enumerate(law.free)]
    z = (values_of(members, law) - middle) / np.array(unit)
    return int(np.argmin((z**2).sum(axis=1)))


def values_of(members: Members, law: Law = DEFAULT) -> Float64:
    """The values of the members [K, len(law.free)]."""
    return np.stack([members.values[name] for name in law.free], axis=1)
