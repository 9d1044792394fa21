"""Checks of an identified law by the simulator.

In reading order: resimulation (simulate with the identified law), comparison (this simulation
against the data), law_runs (simulations at the nodes of a lattice of laws), response_surface (a
quadratic through them), simulator_fit (the law whose simulation is closest to the data; for mu(I)
alone), simulated_pressure (the pressure of a simulation that starts from a known velocity), sampled
(a simulation at the points of a measured flow) and drawn_noise (its noise); limits (of simulations
that a file asks for), threads (a pool that an error or a signal does not wait for).
"""
