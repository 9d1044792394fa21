"""Error bars, and the one home of every judgement. In reading order:

of_data (what inspected data can answer, before a training), center (of an ensemble, for every law),
calibration (the measured table behind the error bars), of_law (do the residuals fit the law?),
error_bars (of mu_s and mu_2), of_training (which of these a training gets, and why not), of_result
(the headline of a report).

Error bars are calibrated for mu(I) alone. With another law, a result has its values without them
(`of_training.judge`).
"""
