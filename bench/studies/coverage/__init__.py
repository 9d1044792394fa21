"""Do the error bars hold the truth? The error model is fitted here."""
