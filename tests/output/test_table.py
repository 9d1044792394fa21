"""Flows and results in notebooks: a line of text, and a table in HTML."""

from __future__ import annotations

from dataclasses import replace

from granpinn.data import Flow
from granpinn.output.table import Table, paragraph
from granpinn.results import Input, Parameter, Parameters
from tests.examples import SPARSE, make_result
from tests.flows import make_chute


def test_text_from_a_file_is_no_markup() -> None:
    name = "<script>alert(1)</script>"
    assert "<script" not in Table([name, name], [(name, name)]).html() + paragraph(name)
    result = make_result(input=Input(name=name, sha256="ab" * 32))
    assert "<script" not in result._repr_html_()


def test_a_result_is_one_line_with_its_intervals() -> None:
    shown = repr(make_result())
    assert shown == (
        "Result(Säule µ.h5, level V1: mu_s = 0.41 (0.39 to 0.43), mu_2 = 0.61 (no interval), "
        "I0 = 0.3 (fixed))"
    )
    lost = {"mu_2": Parameter(0.6, fixed=False, undetermined="x")}
    unknown = Parameters(dict(make_result().parameters.items()) | lost)
    assert "mu_2 = not determined" in repr(make_result(parameters=unknown, covariance=None))


def test_a_notebook_shows_the_assessment_before_the_numbers() -> None:
    result = make_result()
    text = result._repr_html_()
    assert text.startswith(f"<p>{result.assessment}</p>")
    assert '<th scope="row">mu_s</th><td>0.4100</td>' in text
    assert "<td>0.3900 to 0.4300</td>" in text
    assert "<table>" in make_result(**SPARSE)._repr_html_()


def test_a_flow_says_what_it_holds(flow: Flow) -> None:
    assert repr(flow) == (
        "Flow(in memory; time: 0.1 to 1 s; frames: 12; vectors: 24 x 20 grid, "
        f"{int(flow.valid.sum())} in the grains; free surface: {flow.surface.t.size} points)"  # type: ignore[union-attr]
    )
    text = flow._repr_html_()
    assert "<td>0.025 m</td>" in text
    assert "reference pressure" in text
    assert "none (level V0)" in repr(replace(flow, surface=None))
    assert "time: steady" in repr(make_chute())
