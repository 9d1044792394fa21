r"""The identified law as input of the programs that simulate grains: `granpinn export`.

OpenFOAM (viscosity model muI of OpenFOAM-muI 1.1), Basilisk (granular.h of sandbox/M1EMN) and
Chrono (CRM of Chrono::FSI-SPH) have one density $\rho$ in $I = d \dot\gamma \sqrt{\rho / p}$, that
of the bulk. They get the diameter $d \sqrt{\rho_g / \rho}$, with which their I is that of the law.

Draws are from Student's distribution with the covariance of log mu, as the intervals are. Draws in
which mu falls with I are left out.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from granpinn.arrays import Float64
from granpinn.errors import BadInput
from granpinn.output.templates import environment
from granpinn.results.assessment import reach_of
from granpinn.results.decoding import plain
from granpinn.results.parameters import NOT_DETERMINED
from granpinn.results.record import BAD

if TYPE_CHECKING:
    from granpinn.results.result import Result

DRAWS = 100
UNITS = ("m", "kg/m^3"), ("m", None), ("1", None)  # of length and density that a program takes
KEYS = ("mu_s", "mu_2", "I0")  # what the programs know of a law
TEMPLATES = Path(__file__).parent / "templates"
FORMATS = ("openfoam", "basilisk", "chrono", "json")  # a template each, but for JSON


def text_of(result: Result, to: str) -> str:
    """The text of an input file.

    Args:
        to: "openfoam", "basilisk", "chrono" or "json".

    Raises:
        BadInput: the program has no such law, a number is not determined or not known, or the
            assessment is "do not use". JSON has null there.
    """
    if to == "json":
        return _json(result)
    if to not in FORMATS:
        raise BadInput(f"expected one of {', '.join(FORMATS)}, got {to!r}")
    templates = environment(TEMPLATES, autoescape=False, keep_trailing_newline=True)
    # One comment a line; a backslash at its end would join the next one.
    lines = [" ".join(line.split()).replace("\\", "/") for line in facts(result)]
    return templates.get_template(f"{to}.txt").render(facts=lines, **_numbers(result, to))


def facts(result: Result) -> list[str]:
    """What a reader of the file must know, a sentence or an equation in each line."""
    law, data = result.friction_law, result.data
    lines = [f"granpinn: {law.title} of {' '.join(result.input.name.split())}"]
    lines.append(f"Assessment: {result.assessment}")
    lines += [f"{name} = {p.words}" for name, p in result.parameters.items()]
    if any(p.determined and p.interval_90 for p in result.parameters.values()):
        lines.append("In brackets: 90 % intervals.")
    if result.law.I_range is None:
        lines.append("The range of I of the data is not known.")
    else:
        low, high = result.law.I_range
        lines.append(f"The data hold I = {low:.3g} to {high:.3g} (5 to 95 % of what shears).")
        lines.append(f"Below {low:.3g} and above {high:.3g} the law extrapolates.")
    if (reach := reach_of(result)) is not None:
        lines.append(f"mu_2 is an extrapolation: the data reach I = {reach:.2g} I0.")
    if data.grain_diameter is not None and data.density is not None:
        unit, of_density = data.length_unit or "1", data.density_unit or "flow-file units"
        grains = data.density if data.grain_density is None else data.grain_density
        lines.append("I = d gamma_dot / sqrt(p / rho_grain), with gamma_dot = sqrt(2 D:D).")
        lines.append(f"d = {data.grain_diameter:.6g} {unit}, rho_grain = {grains:.6g} {of_density}")
    return lines


def draws_of(result: Result) -> Float64:
    """Draws of the parameters [n, N] in the order of the law; n = 0 without error bars."""
    names, C, bars = result.friction_law.names, result.covariance, result.error_bars
    known = all(p.determined for p in result.parameters.values())
    if C is None or bars is None or not known:
        return np.empty((0, len(names)))
    center = np.array([result.parameters[name].value for name in C.names])
    random = np.random.default_rng(result.seed)
    spread = np.array(C.matrix) / np.outer(center, center)
    normal = random.multivariate_normal(np.zeros(len(center)), spread, 4 * DRAWS, method="eigh")
    scale = np.sqrt(bars.freedom / random.chisquare(bars.freedom, 4 * DRAWS))
    theta = np.tile(np.array(result.theta), (4 * DRAWS, 1))
    theta[:, [names.index(name) for name in C.names]] = center * np.exp(normal * scale[:, None])
    return theta[[result.friction_law.admits(row) for row in theta.tolist()]][:DRAWS]


def _numbers(result: Result, to: str) -> dict[str, Any]:
    """What a template takes, in the units of the flow file; BadInput as of `text_of`.

    The law, its grain diameter d sqrt(rho_g / rho), the bulk density, and rows of (mu_s, mu_2, I0):
    the law and its draws.
    """
    elsewhere = "write json, which has what is known"
    law, data = result.friction_law, result.data
    if law.names != KEYS:
        raise BadInput(
            f"{to} must get the law mu(I) with {', '.join(KEYS)}, got {law.title} with "
            f"{', '.join(law.names)}: {elsewhere}"
        )
    lost = [name for name, p in result.parameters.items() if not p.determined]
    if lost:
        raise BadInput(
            f"{to} needs numbers for {', '.join(KEYS)}, got {' and '.join(lost)} {NOT_DETERMINED}:"
            f" {elsewhere}"
        )
    if result.assessment.grade == BAD:
        raise BadInput(f"{to} must get a law that may be used, got: {result.assessment}")
    if data.grain_diameter is None or data.density is None:
        raise BadInput(
            f"{to} needs grain diameter and densities, and results.json of an older version has "
            "none: train again, or resume the run"
        )
    units = data.length_unit, data.density_unit
    if units not in UNITS:
        raise BadInput(
            f"{to} must get lengths in m and densities in kg/m^3, or a dimensionless flow, got "
            f"{units[0]} and {units[1]}: write the flow file in SI and train again"
        )
    grains = data.density if data.grain_density is None else data.grain_density
    d = data.grain_diameter * math.sqrt(grains / data.density)
    laws = [result.theta, *draws_of(result).tolist()]
    return dict(zip(KEYS, result.theta, strict=True)) | {"d": d, "rho": data.density, "laws": laws}


def _json(result: Result) -> str:
    names, data = result.friction_law.names, result.data
    parameters = {name: plain(p) for name, p in result.parameters.items()}
    for lost in (p for p in parameters.values() if p["undetermined"]):
        lost["value"] = None
    material = ("grain_diameter", "density", "grain_density", "length_unit", "density_unit")
    content = {
        "comment": facts(result),
        "law": result.law.name,
        "formula": result.friction_law.formula,
        "parameters": parameters,
        "I_range": result.law.I_range,
        "material": {name: getattr(data, name) for name in material},
        "draws": dict(zip(names, draws_of(result).T.tolist(), strict=True)),
        "assessment": plain(result.assessment),
    }
    return json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False) + "\n"
