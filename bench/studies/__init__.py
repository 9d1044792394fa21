"""Studies: a folder answers one question with its script, raw results and a note."""
