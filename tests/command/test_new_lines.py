"""The lines of an answer: each is printed once, as soon as it is known."""

from __future__ import annotations

import pytest

from granpinn.checks.simulated_pressure import SimulatedPressure
from granpinn.command.new_lines import NewLines
from granpinn.results import ErrorPercent
from granpinn.results.attempt import PENDING
from tests.examples import make_result


def test_every_line_is_printed_once_and_no_pending_part(
    capsys: pytest.CaptureFixture[str],
) -> None:
    early = make_result(not_done={"simulated_pressure": PENDING})
    errors = ErrorPercent({**early.error_percent, "pressure_simulated": 3.5})
    simulated = SimulatedPressure(None, frames=(1, 2), flowing_percent=4.0)
    checks = early.checks | {"simulated_pressure": simulated}
    whole = make_result(error_percent=errors, checks=checks)
    answer = NewLines()
    answer.show(early)
    first = capsys.readouterr().out.splitlines()
    assert first == early.summary().splitlines()[:-2]  # nor the assessment, which may still change
    answer.show(whole)
    second = capsys.readouterr().out.splitlines()
    assert second[0].split() == first[0].split()  # the heading of the new rows, which are wider
    known = {" ".join(line.split()) for line in first}
    lines = whole.summary().splitlines()[1:-1]
    assert second[1:] == [line for line in lines if " ".join(line.split()) not in known]
    assert any(line.startswith("pressure, simulated") for line in second)
    answer.show(whole)
    assert capsys.readouterr().out == ""
    failed = whole.without("report", "no page today")
    answer.show(failed)
    assert capsys.readouterr().out == "no report: no page today\n"
