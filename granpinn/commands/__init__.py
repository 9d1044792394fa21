"""The commands, one module each, with their parser, `run` and `main`; what they share is in shared.

There is no physics inside.

`python -m granpinn.VERB` runs a module of this folder, which is on the path of the package.
"""
