"""Error bars. In reading order:

error_model (of an identified mu(I)), sensitivity (to what the data do not contain), error_bars
(center of an ensemble, its error bars, or why it has none), determined (by the range of I, with the
curve of the law and its band), curve_error (of a free curve).

Error bars exist for mu(I) only. With another law, a result has values without error bars. Whether
numbers may be used is said in granpinn/results/assessment.py.
"""
