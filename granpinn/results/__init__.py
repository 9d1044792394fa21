"""What a run leaves: the result and its files results.json, results.csv and fields.h5."""

from granpinn.results.fields import Fields, FieldsFileError, read_fields, write_fields
from granpinn.results.records import ErrorPercent, Zones
from granpinn.results.result import (
    Covariance,
    DataSummary,
    InertialNumber,
    Input,
    Parameter,
    Parameters,
    Result,
    ResultsFileError,
    Timing,
    from_dict,
    number,
    plain,
    read_results,
    versions,
    write_results,
)
from granpinn.results.results_csv import write_csv

__all__ = [
    "Covariance",
    "DataSummary",
    "ErrorPercent",
    "Fields",
    "FieldsFileError",
    "InertialNumber",
    "Input",
    "Parameter",
    "Parameters",
    "Result",
    "ResultsFileError",
    "Timing",
    "Zones",
    "from_dict",
    "number",
    "plain",
    "read_fields",
    "read_results",
    "versions",
    "write_csv",
    "write_fields",
    "write_results",
]
