"""What the vectors of a flow say by themselves: their noise and their slopes."""
