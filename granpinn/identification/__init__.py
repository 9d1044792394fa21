"""From a flow to its friction law. In reading order:

case (a flow and its settings as a training problem), single (`identify`: one flow), batch
(`identify_many`: many side by side); then, for trained networks, prediction (fields on the grid),
simulated_fields (the pressure of a simulation that starts from the predicted velocity), final_loss,
scoring (errors against a reference), conclusion (the result), finish (its files, before and after
the simulated pressure); with --free-I0, inertial_profile (which I0 the data allow); and, with
--calibrate, bootstrap (how well the law comes back from simulated flows).
"""
