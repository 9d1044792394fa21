"""Independent checks of an identified law by the simulator: none of them uses the network."""
