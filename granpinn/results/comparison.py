"""The record of a comparison of friction laws (uncertainty/law_choice.py), and its words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from granpinn.physics.laws import LAWS
from granpinn.results.parameters import Parameters

HEAD = ("law", "score", "parameters")
MOST = 4  # parameters in a line: more are a curve


@dataclass(frozen=True)
class ComparedLaw:
    """A law and how well it explains the data.

    Attributes:
        law: its name.
        parameters: of the law that is nearest to the free curve; not those of the identification.
        score: log likelihood of blocks of time that were left out, relative to the best law.
        not_told_apart_from: names of laws whose curves differ by less than the band of the free
            curve.
    """

    law: str
    parameters: Parameters
    score: float
    not_told_apart_from: tuple[str, ...] = ()


def table(comparison: Sequence[ComparedLaw], chosen: str | None) -> list[str]:
    """The lines for a terminal; the last one is the sentence."""
    if not comparison or chosen is None:
        return []
    lines = [f"{law:12s}{score:>9s}  {found}" for law, score, found in (HEAD, *rows_of(comparison))]
    return [*lines, sentence(comparison, chosen)]


def rows_of(comparison: Sequence[ComparedLaw]) -> list[tuple[str, str, str]]:
    """The texts of a line for each law, in the columns of `HEAD`."""
    return [(c.law, f"{c.score:.1f}", values(c.parameters)) for c in comparison]


def values(parameters: Parameters) -> str:
    """The identified values in a line."""
    if sum(not p.fixed for _, p in parameters.items()) > MOST:
        return "a curve"
    found = []
    for name, p in parameters.items():
        if p.fixed:
            continue
        if not p.determined:
            found.append(f"{name} not determined")
        elif p.std is None:
            found.append(f"{name} {p.value:.3g}")
        else:
            found.append(f"{name} {p.value:.3f} ± {p.std:.3f}")
    return ", ".join(found)


def excluded(comparison: Sequence[ComparedLaw], chosen: str) -> list[str]:
    """Names of the laws that the data tell from the chosen one."""
    alike = next(c.not_told_apart_from for c in comparison if c.law == chosen)
    return [c.law for c in comparison if c.law != chosen and c.law not in alike]


def sentence(comparison: Sequence[ComparedLaw], chosen: str) -> str:
    """Which law the data support, which they cannot tell from it, and which they exclude."""
    by_name = {c.law: c for c in comparison}
    alike = by_name[chosen].not_told_apart_from
    if len(LAWS[chosen].names) == 1:  # constant friction
        mu = by_name[chosen].parameters[LAWS[chosen].names[0]].value
        text = f"a constant friction of {mu:.3g} explains these data as well as {_titles(alike)}"
        text += ": how friction rises with I is not known" if alike else ""
        text = text if alike else f"a constant friction of {mu:.3g} explains these data"
    else:
        text = f"{LAWS[chosen].title} explains these data"
        text += f"; not told apart: {_titles(alike)}" if alike else ""
    others = excluded(comparison, chosen)
    return text + (f"; excluded: {_titles(others)}" if others else "")


def _titles(names: Sequence[str]) -> str:
    return ", ".join(LAWS[name].title for name in names)
