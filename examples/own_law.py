"""A friction law of your own, identified like those of granpinn.

The law is mu(I) = mu_s + b I (da Cruz et al., Phys. Rev. E 72, 2005), written in torch. Without
--flow, the flow is the collapse that comes with granpinn. It was made with mu(I), whose curve this
one resembles where I is small.

    python examples/own_law.py --steps 10000 --out run
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from torch import Tensor

import granpinn
from granpinn import laws
from granpinn.config import Network
from granpinn.progress import automatic
from granpinn.simulation import demo_path


def mu(I: Tensor, theta: Sequence[Tensor]) -> Tensor:
    """Friction at inertial numbers I [n] for theta = (mu_s, b), each [n]: [n]."""
    mu_s, b = theta
    return mu_s + b * I


LAW = laws.Law(
    "linear",
    mu,
    [
        laws.Parameter("mu_s", start=0.3, symbol=r"\mu_s"),
        laws.Parameter("b", start=1.0, bounds=(0.01, 20.0)),
    ],
    title="linear law",
    formula=r"\mu = \mu_s + b I",
)


def main(argv: Sequence[str] | None = None) -> granpinn.Result:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--flow", default=demo_path(), help="a flow file")
    parser.add_argument("--steps", type=int, default=10_000)
    parser.add_argument("--width", type=int, default=64, help="units in each of four layers")
    parser.add_argument("--out", help="folder for results.json, fields.h5 and the report")
    args = parser.parse_args(argv)
    network = Network(widths=(args.width,) * 4)
    config = granpinn.Config(steps=args.steps, network=network)
    result = granpinn.identify(args.flow, config, law=LAW, run_dir=args.out, progress=automatic())
    print(result)
    if args.out is not None:
        print(f"report: {result.report()}")
    return result


if __name__ == "__main__":
    main()
