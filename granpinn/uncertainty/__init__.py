"""Error bars and all verdicts. In reading order:

of_data (can the inspected data identify the law?), center (of an ensemble, for every law),
calibration (the measured table behind the error bars), of_law (do the residuals fit the law?),
error_bars (of mu_s and mu_2), determined (by the range of I), curve (of the law, with its band),
of_training (error bars and verdict of a training, or the reason for their absence), of_result (the
headline of a report).

Error bars are calibrated for mu(I) alone. With another law, a result has values without error bars
(`of_training.judge`).
"""
