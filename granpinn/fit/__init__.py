"""From a flow to a fit: everything between the settings and the values of a trained network.

In reading order: case (a flow and its settings as a training problem), assumptions (what the data
do not contain), prediction (fields on the grid, and the law over their I), network (a trained
network and its file), scoring (errors against a reference), ensemble (the values of trained
networks, their loss and error bars), free_curve (the band of a free curve), context (a fit with all
that its checks may use).
"""
