"""Shared parts of the commands: a parser with one-sentence errors, and the end after an error."""

from __future__ import annotations

import argparse
import sys
from typing import NoReturn

from granpinn.config import ConfigError


class Parser(argparse.ArgumentParser):
    """Raises ConfigError where argparse would print the usage and exit."""

    def error(self, message: str) -> NoReturn:
        raise ConfigError(f"{message}; {self.prog} --help explains every argument")


def fail(command: str, code: int, message: str) -> int:
    """Print the reason why a command failed; returns the exit code."""
    print(f"granpinn.{command}: {message}", file=sys.stderr)
    return code
