"""The result of a run and its files results.json and fields.h5.

In reading order: parameters (of a law, with their errors, and what a narrow range of I leaves),
record (what a check leaves), records (the curve, data, training, ensemble, error bars), assessment
(may the numbers be used?), result (all of it), results_file (results.json), fields (and which of
their points flow).
"""

from granpinn.results.assessment import Assessment
from granpinn.results.fields import Fields, FieldsFileError, read_fields, write_fields
from granpinn.results.parameters import Covariance, ErrorPercent, Parameter, Parameters, Residuals
from granpinn.results.records import DataSummary, IdentifiedLaw, Input, Timing, versions
from granpinn.results.result import Result, number
from granpinn.results.results_file import (
    ResultsFileError,
    from_dict,
    read_results,
    write_results,
)

__all__ = [
    "Assessment",
    "Covariance",
    "DataSummary",
    "ErrorPercent",
    "Fields",
    "FieldsFileError",
    "IdentifiedLaw",
    "Input",
    "Parameter",
    "Parameters",
    "Residuals",
    "Result",
    "ResultsFileError",
    "Timing",
    "from_dict",
    "number",
    "read_fields",
    "read_results",
    "versions",
    "write_fields",
    "write_results",
]
