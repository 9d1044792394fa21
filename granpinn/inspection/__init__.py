"""Quality of velocity data and expected precision of the friction law, without training."""

from granpinn.inspection.inspection import Inspection, inspect
from granpinn.inspection.precision import AssumedLaw

__all__ = ["AssumedLaw", "Inspection", "inspect"]
