"""The paper's tables, run again: `python -m granpinn.tables`.

In reading order: paper (its numbers), flows (given files, or the six regimes simulated), study (all
trainings as batches), rows (statistics over the seeds), output (text, HTML, CSV).
"""
