"""The rules of results.json: each has an error of one sentence that names the place."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from granpinn.results import Result, ResultsFileError, read_results
from tests.examples import make_result


def read_content(content: Any, folder: Path) -> Result:
    path = folder / "results.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    return read_results(path)


EDITS: list[tuple[str, Any, str]] = [
    ("format_name", "other", "must have format_name 'granpinn-results' and format_version 6, got"),
    ("format_version", 1, "and 1: read it with the granpinn that wrote it"),
    ("colour", "red", "results.json: colour is not known; expected parameters, level,"),
    ("parameters.mu_s.mean", 1, "parameters.mu_s.mean is not known; expected value, fixed, std"),
    ("parameters.mu_2", ..., "parameters.mu_2 is missing"),
    ("input.sha256", ..., "input.sha256 is missing"),
    ("parameters.mu_s", 0.4, "parameters.mu_s must be a dict with names as keys, got 0.4"),
    ("parameters.mu_s.value", "0.4", "parameters.mu_s.value must be a number, got '0.4'"),
    ("parameters.mu_s.value", True, "parameters.mu_s.value must be a number, got True"),
    ("parameters.mu_s.value", None, "parameters.mu_s.value must be a number, got None"),
    ("parameters.mu_s.value", 10**400, "parameters.mu_s.value must be a number, got 1000"),
    ("parameters.mu_s.fixed", 1, "parameters.mu_s.fixed must be true or false, got 1"),
    ("parameters.mu_s.interval_90", [1], "interval_90 must be a list of 2, got \\[1\\]"),
    (
        "parameters.mu_s.interval_90",
        "ab",
        "interval_90 must be a list, each item a number",
    ),
    ("parameters.mu_s.interval_90", [0, "b"], r"interval_90\[1\] must be a number, got 'b'"),
    ("covariance.matrix", [[1.0, None], [0.0, 1.0]], r"covariance.matrix\[0\]\[1\] must be a num"),
    ("covariance.names", ["mu_s"], "covariance: matrix must have 1 rows and columns"),
    ("law", "coulomb", "law must be a dict with names as keys, got 'coulomb'"),
    ("law.name", 1, "law.name must be text, got 1"),
    ("law.name", "snow", "granpinn.laws.register was given, got 'snow'"),
    ("law.name", "coulomb", "parameters.mu_2 is not known; expected mu_s"),
    ("error_percent.mu_s", "1", "error_percent.mu_s must be a number, got '1'"),
    ("residuals.momentum", ..., "residuals: momentum is missing"),
    ("residuals.colour", 1.0, "residuals: colour is not known; expected noise, velocity"),
    ("seed", 1.0, "seed must be a whole number, got 1.0"),
    ("seed", False, "seed must be a whole number, got False"),
    ("level", 1, "results.json: level must be one of V0, V1, V2, got 1"),
    ("form", "weak", "results.json: form must be one of mixed, strong, got 'weak'"),
    ("versions", [], r"versions must be a dict with names as keys, got \[\]"),
    ("versions.torch", 2, "versions.torch must be text, got 2"),
    ("settings", "none", "settings must be a dict with names as keys, got 'none'"),
    ("timing", [], r"timing must be a dict with names as keys, got \[\]"),
]


@pytest.mark.parametrize(
    ("place", "value", "sentence"), EDITS, ids=[f"{e[0]}={e[1]!r:.12}" for e in EDITS]
)
def test_an_edited_file_is_one_sentence(
    place: str, value: Any, sentence: str, tmp_path: Path
) -> None:
    content = make_result().to_dict()
    *parents, last = place.split(".")
    target = content
    for name in parents:
        target = target[name]
    if value is ...:
        del target[last]
    else:
        target[last] = value
    with pytest.raises(ResultsFileError, match=sentence):
        read_content(content, tmp_path)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (b"", "could not be read as strict JSON: Expecting value"),
        (b'{"seed": 1', "could not be read as strict JSON"),
        (b'{"seed": NaN}', "NaN is not a JSON number, expected null"),
        (b'{"seed": -Infinity}', "-Infinity is not a JSON number, expected null"),
        (b"\xff\xfe", "could not be read as strict JSON: .*codec can't decode"),
        (b"[" * 100_000, "could not be read as strict JSON: maximum recursion"),
        (b"[1, 2]", "results.json must hold an object, got list"),
        (b"{}", "got None and None"),
    ],
    ids=["empty", "cut", "NaN", "infinity", "binary", "deep", "list", "bare"],
)
def test_what_is_not_a_result_is_one_sentence(text: bytes, sentence: str, tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    path.write_bytes(text)
    with pytest.raises(ResultsFileError, match=sentence):
        read_results(path)
