"""From points to trained networks.  In reading order:

loss:       problem (scales and weights), objective (batch, fused loss)
law:        law_variables (the friction law as unknowns)
update:     optimise (Adam, Muon)
each step:  schedule (as functions of the step, and its rows on the device), graphs
state:      trainer (everything that a step changes, and the step)
the run:    loop (first step to last), time_limit, guard (faults and signals), checkpoint,
            tensor_file (its bytes)
the end:    last_layer, last_layer_sums, equations, features (Gauss-Newton steps)
to watch:   history, progress
"""
