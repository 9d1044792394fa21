"""From points to trained networks.  In reading order:

data:       problem (scales and weights), sampling (which points), objective (batch, fused loss)
update:     scalars (mu_s, mu_2), optimise (Adam, Muon), step_ops (the operators of one step)
each step:  schedule, control (what a step knows of the host), plan, engine (calls or CUDA graphs)
the run:    training (its state, its step), run (first step to last), guard, clock, checkpoint
to watch:   history, progress
processes:  parallel
"""
