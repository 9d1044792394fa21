"""From a flow to a fit: everything between the settings and the values of a trained network.

In reading order: case (a flow and its settings as a training problem), assumptions (what the data
do not contain), prediction (fields on the grid), network (a trained network and its file),
final_loss, scoring (errors against a reference), ensemble (the values of trained networks and their
error bars), shear (the range of I and the curve of the law), free_curve (the band of a free curve),
context (a fit with all that its checks may use).
"""
