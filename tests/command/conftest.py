"""What tests of commands share."""

from __future__ import annotations

import pytest

from granpinn import train


@pytest.fixture
def no_report(monkeypatch: pytest.MonkeyPatch) -> None:
    """The figures take seconds."""
    monkeypatch.setattr(train.report, "build", lambda folder: folder / "report.html")
