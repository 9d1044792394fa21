"""The compiled kernels as torch operators, and the layout of the network they work on."""
