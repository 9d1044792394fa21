"""The parser of the commands: its errors are one sentence."""

from __future__ import annotations

import argparse
from typing import NoReturn

from granpinn.errors import BadInput


class Parser(argparse.ArgumentParser):
    """Raises BadInput where argparse would print the usage and exit."""

    def error(self, message: str) -> NoReturn:
        raise BadInput(f"{message}; {self.prog} --help explains every argument")
