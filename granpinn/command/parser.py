"""What the commands share: arguments that are refused in one sentence, and how a command ends."""

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
    """Say why a command did not do its work; the exit code."""
    print(f"granpinn.{command}: {message}", file=sys.stderr)
    return code
