"""From a flow to its friction law, with error bars and a verdict.  In reading order:

identification (one flow), ensemble (many as one batch), then for the trained networks
prediction (fields on the grid), closure and closed_fields (the pressure that the simulator closes
where nothing flows), final_loss, scoring (errors against a reference),
uncertainty and calibration (error bars, and the table behind them), conclusion (the result);
where asked for, inertial_profile (which I0 the data allow), resimulation and comparison (simulate
with the identified law, compare with the data), simulator_fit (the law that simulates them best)
with law_runs and response_surface (its simulations, and the quadratic through them).
"""
