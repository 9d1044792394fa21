"""The paper's tables, run again: `python -m granpinn.tables`."""
