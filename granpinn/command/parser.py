"""Parts that the commands share: a parser that refuses in one sentence, and a failed end."""

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
    """Print why a command failed; returns the exit code."""
    print(f"granpinn.{command}: {message}", file=sys.stderr)
    return code
