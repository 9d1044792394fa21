"""How often mu_s and the slope (mu_2 - mu_s)/I0 lie in the intervals for an unknown I0.

python -m bench.studies.inertial_number.intervals

The identifications are those of bench.studies.coverage. Each gives mu at both ends of its range of
I; I0 counts from a quarter to four times 0.3, whatever that of the flow. A line has a population,
its number of flows, and the share of intervals that hold mu_s and the slope, in %.
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from bench.studies.coverage.table import read
from granpinn.checks.unknown_I0 import of_points
from granpinn.results.result import NORMAL_90
from granpinn.uncertainty.error_model import load

I0 = 0.3


def main() -> None:
    model, held = load(), defaultdict(list)
    for row in read():
        C = sum(model.of_flows([row.known])) * (model.half_width() / NORMAL_90) ** 2
        I = np.array([row.I0 * x / (1 - x) for x in row.known.x])
        found = of_points(I, np.log(row.known.ends), C, I0).parameters
        truth = {"mu_s": row.truth[0], "slope": (row.truth[1] - row.truth[0]) / row.I0}
        ends = {name: found[name].interval_90 or (0.0, 0.0) for name in truth}
        held[row.population].append([ends[n][0] <= truth[n] <= ends[n][1] for n in truth])
    for population, shares in sorted(held.items()):
        mu_s, slope = 100 * np.mean(shares, axis=0)
        print(f"{population:20} {len(shares):4} {mu_s:5.0f} {slope:5.0f}")


if __name__ == "__main__":
    main()
