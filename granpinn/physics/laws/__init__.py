"""The friction laws.  A new law is a module here, its row in `LAWS`, and its header in csrc.

A user's own law is registered in `LAWS` while Python runs (granpinn/laws.py).
"""

from granpinn.physics.laws import coulomb, mu_of_i
from granpinn.physics.laws.law import Law, LawParameter

LAWS: dict[str, Law] = {law.name: law for law in (mu_of_i.LAW, coulomb.LAW)}
"""Every law by its name; the first one is the default."""

DEFAULT = mu_of_i.LAW

__all__ = ["DEFAULT", "LAWS", "Law", "LawParameter"]
