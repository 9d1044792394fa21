"""The file results.json: strict JSON, written whole, and validated when it is read."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

from granpinn.declared import checked
from granpinn.errors import BadInput
from granpinn.output import write_text
from granpinn.regular import read_text
from granpinn.results.decoding import decoded, parsed
from granpinn.results.record import record_type
from granpinn.results.result import FORMAT_NAME, FORMAT_VERSION, Result


class ResultsFileError(BadInput):
    """results.json is missing, is not JSON, or breaks a rule of the format."""


def write_results(result: Result, path: str | Path) -> None:
    """Write results.json.  The result is decoded first, so that the file can be read back."""
    content = result.to_dict()
    from_dict(content)
    text = json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False)
    write_text(path, text + "\n")


@checked
def read_results(path: str | Path) -> Result:
    """Read and validate results.json; the message of ResultsFileError is one sentence."""
    path = Path(path)
    try:
        content = parsed(read_text(path))
    except FileNotFoundError:
        raise ResultsFileError(
            f"{path} does not exist: give the folder of a finished run of granpinn.train"
        ) from None
    except ValueError as error:
        raise ResultsFileError(f"{path} could not be read as strict JSON: {error}") from None
    return from_dict(content, path.name)


def from_dict(content: Any, where: str = "the result") -> Result:
    """The inverse of `Result.to_dict`; the message of ResultsFileError is one sentence."""
    if not isinstance(content, dict):
        raise ResultsFileError(f"{where} must hold an object, got {type(content).__name__}")
    content = dict(content)
    found = (content.pop("format_name", None), content.pop("format_version", None))
    content.pop("assessment", None)  # follows from the other records
    if found != (FORMAT_NAME, FORMAT_VERSION):
        raise ResultsFileError(
            f"{where} must have format_name {FORMAT_NAME!r} and format_version {FORMAT_VERSION}, "
            f"got {found[0]!r} and {found[1]!r}: read it with the granpinn that wrote it"
        )
    try:
        checks = content.pop("checks", {})
        if not isinstance(checks, dict):
            raise ValueError(f"checks must be an object, got {checks!r}")
        records = {k: decoded(v, record_type(k), f"checks.{k}") for k, v in checks.items()}
        return dataclasses.replace(decoded(content, Result), checks=records)
    except ValueError as error:
        raise ResultsFileError(f"{where}: {error}") from None
