"""Do the error bars hold the truth? The shipped calibration is made here."""
