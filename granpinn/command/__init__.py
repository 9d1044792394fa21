"""Shared parts of the commands: cli and completion of `granpinn VERB`, parser, arguments."""
