"""Studies of friction laws."""
