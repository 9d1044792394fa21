"""The friction laws.  A new law is a module here, its row in `LAWS`, and its header in csrc.

A user's own law is registered in `LAWS` while Python runs (granpinn/laws.py).
"""

from granpinn.physics.laws import cohesive, coulomb, free, mu_of_i, power, regularised
from granpinn.physics.laws.law import FrictionLaw, LawParameter

LAWS: dict[str, FrictionLaw] = {
    module.LAW.name: module.LAW for module in (mu_of_i, coulomb, regularised, power, cohesive, free)
}
"""Every law by its name; the first one is the default."""

DEFAULT = mu_of_i.LAW

__all__ = ["DEFAULT", "LAWS", "FrictionLaw", "LawParameter"]
