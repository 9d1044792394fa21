"""A friction law by name, with values of its parameters as attributes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, make_dataclass
from typing import TYPE_CHECKING, Any, Self

from granpinn.declared import require_fields
from granpinn.physics.laws import DEFAULT, LAWS, FrictionLaw, LawParameter


def _help_of(name: str) -> str:
    """The help of a setting that is a parameter: its meaning and default in every law with it."""
    having = [(law, law.parameter(name)) for law in LAWS.values() if name in law.names]
    return f"{name}: " + ", ".join(f"{p.help} ({law.name}: {_usual(law, p)})" for law, p in having)


def _usual(law: FrictionLaw, p: LawParameter) -> str:
    return f"{p.typical:g}" + (" rho g H" if p.name == law.cohesion else "")


# One field for every parameter of any law, in the order of the laws: mu_s, mu_2, I0.
PARAMETERS: tuple[str, ...] = tuple(
    dict.fromkeys(name for law in LAWS.values() for name in law.names)
)

if TYPE_CHECKING:

    class _Parameters:
        def __getattr__(self, name: str) -> Any: ...

else:
    _fields = [
        (name, float | None, field(default=None, metadata={"help": _help_of(name)}))
        for name in PARAMETERS
    ]
    _Parameters = make_dataclass("_Parameters", _fields, frozen=True)


@dataclass(frozen=True)
class LawValues(_Parameters):
    """A friction law and values of its parameters: `LawValues(0.4, law="coulomb").mu_s`.

    Every parameter of any law is a field; None: unknown, or no parameter of this law.

    Raises:
        ValueError: there is no such law, or it lacks a parameter that is given; one sentence.
    """

    law: str = field(default=DEFAULT.name, metadata={"help": f"friction law: {', '.join(LAWS)}"})

    if TYPE_CHECKING:

        def __init__(self, *theta: float | None, law: str = "", **values: float | None) -> None: ...

    def __post_init__(self) -> None:
        require_fields(self)
        if self.law not in LAWS:
            raise ValueError(f"law must be one of {', '.join(LAWS)}, got {self.law!r}")
        own = self.friction_law.names
        for name in PARAMETERS:
            if name not in own and getattr(self, name) is not None:
                raise ValueError(
                    f"the law {self.law} has the parameters {', '.join(own)}, got {name}: "
                    "leave it out"
                )

    @property
    def friction_law(self) -> FrictionLaw:
        return LAWS[self.law]

    @property
    def theta(self) -> tuple[Any, ...]:
        """The values in the order of the law; None where unknown."""
        return tuple(getattr(self, name) for name in self.friction_law.names)


class CompleteLaw(LawValues):
    """A friction law in which a parameter that is not given has its typical value.

    Raises:
        ValueError: as `LawValues`, or a value is impossible; one sentence.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        missing = [n for n, v in zip(self.friction_law.names, self.theta, strict=True) if v is None]
        object.__setattr__(self, "_missing", frozenset(missing))
        theta = self.friction_law.complete(self.theta)
        for name, value in zip(self.friction_law.names, theta, strict=True):
            object.__setattr__(self, name, value)

    def of_flow(self, pressure: float, quantiles: Callable[..., list[float] | None]) -> Self:
        """The law of a flow: what is not given is typical of its pressures and of its range of I.

        Args:
            pressure: rho |g| H of the material, the unit of a typical cohesion.
            quantiles: of I in the flow at given levels; None if nothing flows.
        """
        law = self.friction_law
        values = dict(zip(law.names, self.theta, strict=True))
        if law.cohesion is not None and law.cohesion in self._missing:
            values[law.cohesion] *= pressure
        levels = {name: level for name, level in law.quantiles.items() if name in self._missing}
        found = quantiles(*levels.values()) if levels else None
        values |= {} if found is None else dict(zip(levels, found, strict=True))
        return type(self)(law=self.law, **values)
