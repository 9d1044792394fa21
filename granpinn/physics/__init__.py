"""The friction law, dimensionless units and axes, which every part of granpinn uses."""
