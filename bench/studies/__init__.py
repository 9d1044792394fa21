"""Studies: a folder answers one question with its script, a table of raw rows and a note."""
