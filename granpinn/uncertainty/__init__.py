"""Error bars, their calibration, and every verdict: on data, on a training, on the law."""
