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
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from granpinn.arrays import Float64
from granpinn.errors import BadInput
from granpinn.results.assessment import reach_of
from granpinn.results.decoding import encode
from granpinn.results.parameters import NOT_DETERMINED
from granpinn.results.record import BAD

if TYPE_CHECKING:
    from granpinn.results.result import Result

DRAWS = 100
UNITS = ("m", "kg/m^3"), ("m", None), ("1", None)  # of length and density that a program takes
KEYS = ("mu_s", "mu_2", "I0")  # what the programs know of a law


class Numbers(NamedTuple):
    """What a program takes, in the units of the flow file: its grain diameter d sqrt(rho_g / rho),
    bulk density, and draws of (mu_s, mu_2, I0) [n, 3]; n = 0 without error bars."""

    mu_s: float
    mu_2: float
    I0: float
    d: float
    rho: float
    draws: Float64


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
    if to not in PROGRAMS:
        raise BadInput(f"expected one of {', '.join(FORMATS)}, got {to!r}")
    return PROGRAMS[to](_numbers(result, to), facts(result))


def facts(result: Result) -> list[str]:
    """What a reader of the file must know, a sentence or an equation in each line."""
    law, data = result.friction_law, result.data
    lines = [f"granpinn: {law.title} of {' '.join(result.input.name.split())}"]
    lines.append(f"Assessment: {result.assessment}")
    lines += [f"{name} = {p.words}" for name, p in result.parameters.items()]
    if any(p.interval_90 for p in result.parameters.values()):
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


def _numbers(result: Result, to: str) -> Numbers:
    """The numbers for a program; BadInput as of `text_of`."""
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
    mu_s, mu_2, I0 = result.theta
    return Numbers(mu_s, mu_2, I0, d, data.density, draws_of(result))


def _openfoam(n: Numbers, facts: list[str]) -> str:
    draws = "".join(f"    ({mu_s:.6g} {mu_2:.6g} {I0:.6g})\n" for mu_s, mu_2, I0 in n.draws)
    return f"""{_comment(facts)}
// constant/transportProperties of interFoam with the viscosity model muI of OpenFOAM-muI 1.1
// (libs ("libviscositymuI.so"); in system/controlDict). The model divides by rhog, the solver
// multiplies by rho: both are the bulk density, and dg is d sqrt(rho_grain / rho). I is the same.
// nuMax to alphaSmall and the air are numerics of its tutorials: check them for your flow.
FoamFile
{{
    version     2.0;
    format      ascii;
    class       dictionary;
    object      transportProperties;
}}

phases (granul air);

granul
{{
    transportModel muI;
    muICoeffs
    {{
        mus        {n.mu_s:.6g};
        mud        {n.mu_2:.6g};
        I0         {n.I0:.6g};
        dg         {n.d:.6g};
        rhog       {n.rho:.6g};
        nuMax      1e3;
        nuMin      1e-05;
        pMin       1.0;
        rmHydAirP  true;
        rhoAir     1.0;
        alphaSmall 0.01;
    }}
    rho            {n.rho:.6g};
}}

air
{{
    transportModel Newtonian;
    nu             1.48e-05;
    rho            1;
}}

sigma 0;

// Draws of (mus mud I0) by the error bars; no model reads this entry.
granpinnDraws
(
{draws});
"""


def _basilisk(n: Numbers, facts: list[str]) -> str:
    return f"""{_comment(facts)}
// Include after granular.h of sandbox/M1EMN, and call granpinn_law (L, 0) first in main(). L is the
// length 1 of the simulation, in the unit of d above. There the bulk density is 1, so D is
// d sqrt(rho_grain / rho) / L, with which I is the same.
{_table(n)}
static inline void granpinn_law (double L, int k)
{{
  mus = granpinn_laws[k][0], dmu = granpinn_laws[k][1] - mus, I0 = granpinn_laws[k][2];
  D = {n.d:.6g}/L, Co = 0.;
}}
"""


def _chrono(n: Numbers, facts: list[str]) -> str:
    return f"""{_comment(facts)}
// For the material of Chrono::FSI-SPH (CRM), ElasticMaterialProperties, in later versions
// SoilProperties: call granpinn_law(mat_props), set Young_modulus and Poisson_ratio, then call
// SetElasticSPH(mat_props) or SetCrmSPH. mu_fric_2 and mu_fric_s are set apart: both alike, as in
// Chrono's defaults and examples, are a friction that does not depend on I. The density of Chrono's
// I is that of the bulk, so average_diam is d sqrt(rho_grain / rho), with which I is the same.
#pragma once
{_table(n)}
template <class Properties>
void granpinn_law(Properties& mat_props, int k = 0) {{
    mat_props.rheology_model = chrono::fsi::sph::RheologyCRM::MU_OF_I;
    mat_props.density = {n.rho:.6g};
    mat_props.mu_fric_s = granpinn_laws[k][0];
    mat_props.mu_fric_2 = granpinn_laws[k][1];
    mat_props.mu_I0 = granpinn_laws[k][2];
    mat_props.average_diam = {n.d:.6g};
    mat_props.cohesion_coeff = 0;
}}
"""


def _json(result: Result) -> str:
    names, data = result.friction_law.names, result.data
    parameters = {name: encode(p) for name, p in result.parameters.items()}
    for lost in (p for p in parameters.values() if not p["determined"]):
        lost["value"] = None
    material = ("grain_diameter", "density", "grain_density", "length_unit", "density_unit")
    content = {
        "comment": facts(result),
        "law": result.law.name,
        "formula": result.friction_law.formula,
        "parameters": parameters,
        "I_range": result.law.I_range,
        "determined": encode(result.determined),
        "material": {name: getattr(data, name) for name in material},
        "draws": dict(zip(names, draws_of(result).T.tolist(), strict=True)),
        "assessment": encode(result.assessment),
    }
    return json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def _comment(facts: list[str]) -> str:
    """Lines of // comments; a backslash at the end would join the next one."""
    return "\n".join(f"// {' '.join(line.split())}".replace("\\", "/") for line in facts)


def _table(n: Numbers) -> str:
    """The law and its draws in C."""
    rows = [[n.mu_s, n.mu_2, n.I0], *n.draws.tolist()]
    cells = "".join(f"  {{{a:.6g}, {b:.6g}, {c:.6g}}},\n" for a, b, c in rows)
    return f"""// Rows of (mu_s, mu_2, I0): the law, then granpinn_draws draws by its error bars.
enum {{ granpinn_draws = {len(n.draws)} }};
static const double granpinn_laws[][3] = {{
{cells}}};
"""


PROGRAMS: dict[str, Callable[[Numbers, list[str]], str]] = {
    "openfoam": _openfoam,
    "basilisk": _basilisk,
    "chrono": _chrono,
}
FORMATS = (*PROGRAMS, "json")
