"""What the vectors of a flow show by themselves: noise, slopes and magnitudes."""
