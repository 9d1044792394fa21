"""The law as input of other programs: numbers, the comment, and what is refused."""

from __future__ import annotations

import dataclasses
import json
import math
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.commands import export
from granpinn.errors import BadInput
from granpinn.results import Input, Parameter, Parameters, Result, write_results
from granpinn.results.export import DRAWS, FORMATS, draws_of
from tests.examples import PARAMETERS, make_result

MU_2 = Parameter(0.61, fixed=False, std=0.02, interval_90=(0.57, 0.65))


KNOWN = Parameters(dict(PARAMETERS.items()) | {"mu_2": MU_2})


D = 0.8e-3 * math.sqrt(2500 / 1500)  # the diameter of programs with one density


STUBS = {
    "basilisk": "double mus, dmu, I0, D, Co;\n",
    "chrono": "namespace chrono { namespace fsi { namespace sph {\n"
    "enum class RheologyCRM { MU_OF_I, MCC }; } } }\n",
}


PRINTED = {
    "basilisk": "#include <stdio.h>\nint main () { granpinn_law (2., 0); "
    'printf ("%g %g %g %g", mus, mus + dmu, I0, 2.*D); '
    "granpinn_law (1., granpinn_draws); return !(mus > 0.3); }\n",
    "chrono": "#include <cstdio>\nstruct P { chrono::fsi::sph::RheologyCRM rheology_model; double "
    "density, mu_fric_s, mu_fric_2, mu_I0, average_diam, cohesion_coeff; };\nint main() { P p; "
    'granpinn_law(p); std::printf("%g %g %g %g", p.mu_fric_s, p.mu_fric_2, p.mu_I0, '
    "p.average_diam); granpinn_law(p, granpinn_draws); return !(p.mu_fric_s > 0.3); }\n",
}


def known(**changes: Any) -> Result:
    """A result whose material is known, in SI, with its mu_2 determined."""
    result = make_result(parameters=KNOWN)
    si = {"length_unit": "m", "density_unit": "kg/m^3"}
    data = dataclasses.replace(
        result.data, grain_diameter=0.8e-3, density=1500.0, grain_density=2500.0, **si
    )
    return dataclasses.replace(result, **({"data": data} | changes))


def foam_entries(text: str) -> dict[str, str]:
    """The entries of a dictionary of OpenFOAM, of all levels; braces must match."""
    bare = re.sub(r"//.*", "", text)
    assert bare.count("{") == bare.count("}")
    assert bare.count("(") == bare.count(")")
    return dict(re.findall(r"^\s*(\w+)\s+([^\s;{}()]+);$", bare, re.MULTILINE))


def test_openfoam_gets_the_keys_of_its_model_with_one_density() -> None:
    found = foam_entries(known().export("openfoam").partition("\nair\n")[0])
    assert found["transportModel"] == "muI"
    numbers = {key: float(found[key]) for key in ("mus", "mud", "I0", "dg", "rhog", "rho")}
    wanted = {"mus": 0.41, "mud": 0.61, "I0": 0.3, "dg": D, "rhog": 1500.0, "rho": 1500.0}
    assert numbers == pytest.approx(wanted, rel=1e-5)
    required = {"nuMax", "nuMin", "pMin", "rmHydAirP", "rhoAir", "alphaSmall"}  # muI.C
    assert required <= found.keys()


@pytest.mark.parametrize(("to", "compiler"), [("basilisk", "cc"), ("chrono", "c++")])
def test_the_code_compiles_and_sets_the_numbers(to: str, compiler: str, tmp_path: Path) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"needs {compiler}")
    source = tmp_path / ("law.c" if compiler == "cc" else "law.cpp")
    text = known(input=Input(name="a \\ b*/\\", sha256="ab" * 32)).export(to)
    source.write_text(STUBS[to] + text.replace("#pragma once", "") + PRINTED[to])
    program = tmp_path / "law"
    subprocess.run([compiler, "-Wall", "-Werror", source, "-o", program], check=True)
    out = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    assert [*map(float, out.split())] == pytest.approx([0.41, 0.61, 0.3, D], rel=1e-5)


def test_draws_have_the_covariance_and_are_admissible() -> None:
    result = known()
    draws = draws_of(result)
    assert draws.shape == (DRAWS, 3)
    assert (draws[:, 2] == 0.3).all()
    assert (draws[:, 1] > draws[:, 0]).all()
    assert np.array_equal(draws, draws_of(result))
    # The median of n draws has the standard error 1.25 sd / sqrt(n); 4 of them.
    sd = np.sqrt(np.diag(np.array(result.covariance.matrix)))  # type: ignore[union-attr]
    assert (abs(np.median(draws, 0)[:2] - (0.41, 0.61)) < 5 * sd / math.sqrt(DRAWS)).all()
    assert (abs(draws.std(0)[:2] / sd - 1) < 0.6).all()  # that of Student's is 1.15


def test_json_has_null_where_nothing_is_determined() -> None:
    lost = Parameters(
        dict(KNOWN.items()) | {"mu_2": Parameter(0.61, fixed=False, undetermined="x")}
    )
    result = known(parameters=lost)
    content = json.loads(result.export("json"))
    assert content["parameters"]["mu_2"]["value"] is None
    assert content["parameters"]["mu_s"]["value"] == 0.41
    assert content["draws"] == {"mu_s": [], "mu_2": [], "I0": []}
    assert "mu_2 = not determined" in content["comment"]
    for to in FORMATS[:-1]:
        with pytest.raises(BadInput, match="mu_2 not determined"):
            result.export(to)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"stopped": "diverged"}, "must get a law that may be used, got: do not use"),
        ({"data": make_result().data}, "older version has none"),
        (
            {"data": dataclasses.replace(known().data, length_unit="mm")},
            "lengths in m and densities in kg/m",
        ),
    ],
)
def test_no_number_goes_out_that_is_not_known(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        known(**changes).export("chrono")


def test_the_command_prints_or_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_results(known(), tmp_path / "results.json")
    assert export.main([str(tmp_path), "--to", "openfoam"]) == 0
    printed = capsys.readouterr().out
    out = tmp_path / "transportProperties"
    assert export.main([str(tmp_path), "--to", "openfoam", "--out", str(out)]) == 0
    assert out.read_text() == printed == known().export("openfoam")
    assert capsys.readouterr().out == f"law: {out}\n"
    assert export.main([str(tmp_path / "none"), "--to", "json"]) == 2
    assert export.main([str(tmp_path), "--to", "abaqus"]) == 2
