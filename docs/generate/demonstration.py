"""Runs the command of README.md and records its output and its picture, both of one run.

python -m docs.generate.demonstration
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image
from PIL.PngImagePlugin import PngInfo

DOCS = Path(__file__).parents[1]
OUTPUT = DOCS / "results" / "demonstration.txt"
PICTURE = DOCS / "images" / "result.png"
PICTURED = ("friction_law", "pressure")
HEIGHT = 900  # pixels


def side_by_side(files: Iterable[Path], height: int) -> Image.Image:
    """Pictures of one height [pixels] in a row."""
    images = [Image.open(file).convert("RGB") for file in files]
    images = [
        image.resize((image.width * height // image.height, height), Image.Resampling.LANCZOS)
        for image in images
    ]
    picture = Image.new("RGB", (sum(image.width for image in images), height), "white")
    left = 0
    for image in images:
        picture.paste(image, (left, 0))
        left += image.width
    return picture


def record(figures: Path, printed: str) -> None:
    """Writes the output of a run, and a picture of its law and its pressure."""
    picture = side_by_side((figures / f"{name}.png" for name in PICTURED), HEIGHT)
    info = PngInfo()
    info.add_text("output", printed)  # a test compares it with the text
    picture.save(PICTURE, pnginfo=info, optimize=True)
    OUTPUT.write_text(printed, encoding="utf-8")


def main() -> int:
    """Runs the command in an empty folder."""
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "granpinn.train"]
        done = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, text=True, check=True)
        record(Path(folder) / "granpinn-demo" / "figures", done.stdout)
    return 0


if __name__ == "__main__":
    sys.exit(main())
