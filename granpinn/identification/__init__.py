"""From a flow to its friction law, checked. In reading order:

identify (`identify`: one flow; `identify_many`: many side by side) and one_law (several flows of
one material) call run: start (the folder and the training), then values, fields, intervals, curve
and the checks of granpinn/checks, each on the disk before the next. identified holds the result
with its network and fields.
"""
