"""What velocity data can tell about the friction law, before any training."""

from granpinn.inspection.inspection import Inspection, inspect
from granpinn.inspection.precision import Law

__all__ = ["Inspection", "Law", "inspect"]
