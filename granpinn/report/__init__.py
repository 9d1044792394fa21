"""The report of a run: `python -m granpinn.report DIR`, or `build(DIR)`."""

from granpinn.report.page import HistoryFileError, build, for_paraview, read_history

__all__ = ["HistoryFileError", "build", "for_paraview", "read_history"]
