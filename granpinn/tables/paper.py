"""The numbers of the paper for mu(I), copied from its tables, with the number of each table."""

from __future__ import annotations

from typing import NamedTuple

from granpinn.data import Truth

SOURCE_1 = "the paper, table 1 (label tab:id): one training each, pressure measured at the surface"
SOURCE_2 = "the paper, table 2 (label tab:bruit): one training and one draw of the noise each"

# Section "Identification of mu_s and mu_2", where the paper gives only these two numbers.
VELOCITY_ALONE = "from the velocity alone the paper reports 53 % in mu_s and up to 100 % in mu_2"


class PaperRow(NamedTuple):
    """A row of the paper: identified values and relative errors in %."""

    mu_s: float
    mu_2: float
    error_mu_s: float
    error_mu_2: float
    error_p: float


# (mu_s, mu_2) -> row
TABLE_1: dict[tuple[float, float], PaperRow] = {
    (0.2, 0.32): PaperRow(0.201, 0.318, 0.59, 0.61, 0.88),
    (0.2, 0.44): PaperRow(0.201, 0.438, 0.57, 0.41, 0.98),
    (0.4, 0.52): PaperRow(0.399, 0.522, 0.12, 0.33, 1.78),
    (0.4, 0.64): PaperRow(0.403, 0.622, 0.80, 2.87, 1.59),
    (0.6, 0.72): PaperRow(0.599, 0.726, 0.18, 0.77, 6.94),
    (0.6, 0.84): PaperRow(0.602, 0.839, 0.28, 0.15, 6.43),
}
NOISY_CASE = (0.6, 0.84)
# noise, relative to the maximum speed -> row of NOISY_CASE
TABLE_2: dict[float, PaperRow] = {
    0.0: PaperRow(0.604, 0.833, 0.67, 0.78, 7.11),
    0.2: PaperRow(0.606, 0.830, 1.01, 1.24, 9.71),
    0.8: PaperRow(0.586, 0.953, 2.34, 13.4, 14.5),
}


def case_of(truth: Truth | None) -> tuple[float, float] | None:
    """The paper's case with these parameters, None where there is none."""
    mu_s, mu_2 = getattr(truth, "mu_s", None), getattr(truth, "mu_2", None)
    if mu_s is None or mu_2 is None:
        return None
    near = (round(mu_s, 6), round(mu_2, 6))
    return near if near in TABLE_1 else None


def row_1(truth: Truth | None, noise: float) -> PaperRow | None:
    """The row of table 1 for a case."""
    case = case_of(truth)
    return TABLE_1[case] if case is not None and noise == 0 else None


def row_2(truth: Truth | None, noise: float) -> PaperRow | None:
    """The row of table 2 for a case at a level of noise."""
    return TABLE_2.get(round(noise, 6)) if case_of(truth) == NOISY_CASE else None
