"""The friction law, dimensionless units and axes: what every part of granpinn takes for granted."""
