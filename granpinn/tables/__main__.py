"""`python -m granpinn.tables`: this package has the name of its command."""

from granpinn.command import cli

cli.start("tables")
