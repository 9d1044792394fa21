"""From a flow to its friction law, checked. In reading order:

single (`identify`: one flow), one_law (several flows of one material), batch (`identify_many`: many
side by side), start (the folder and the training of all), answer (values, fields, intervals and
curve, each on the disk before the next); then granpinn/checks makes the checks. identified holds
the result with its network and fields.
"""
