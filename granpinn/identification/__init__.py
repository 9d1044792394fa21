"""From a flow to its friction law, checked. In reading order:

single (`identify`: one flow), batch (`identify_many`: many side by side), one_law (several flows of
one material) all call run: start (the folder and the training), answer (values, fields, intervals
and curve, each on the disk before the next), and the checks of granpinn/checks. identified holds
the result with its network and fields.
"""
