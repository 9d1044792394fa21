"""The commands, one module each, with their parser, `run` and `main`; no physics inside.

`python -m granpinn.VERB` runs a module of this folder, which is on the path of the package.
"""
