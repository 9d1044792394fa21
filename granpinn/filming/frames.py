"""The frames of a film, in order, read by the child process."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from granpinn.importers.limits import read_file
from granpinn.importers.series import expand
from granpinn.importers.vectors import DataFileError

Picture = npt.NDArray[np.uint8]
FilmFrame = tuple[Picture | None, str]  # a frame, or why it cannot be read

VIDEOS = (".avi", ".mp4", ".mov", ".mkv", ".m4v")
MEMORY = 2**30  # bytes of a frame, whatever the size of a video
BITS = 8  # of the grey levels that are used
FEWEST = 4  # frames of a film


class ImageSequence:
    """The film of image files, a folder or pattern of them, or one video.

    Args:
        region: rows and columns that are used.

    Raises:
        DataFileError: no file matches, or the files are no film.
    """

    def __init__(
        self,
        sources: Sequence[str | Path],
        region: tuple[slice, slice] = (slice(None), slice(None)),
    ) -> None:
        self.files, self.region = expand(sources), region
        self.video = self.files[0].suffix.lower() in VIDEOS
        n = len(self.files)
        self.count = int(_read(self.files[0], 0)["declared"]) if self.video else n
        if self.count < FEWEST or (self.video and n > 1):
            raise DataFileError(
                f"a film must be one video or many images, of at least {FEWEST} frames, got {n} "
                f"files with {self.count} frames"
            )
        self._depth, self._shape = 0, ()

    def sample(self, count: int) -> list[Picture]:
        """Readable frames, evenly spaced over the film."""
        chosen = np.unique(np.linspace(0, self.count - 1, count).astype(int))
        found = [self._frame(int(k)) for k in chosen]
        good = [picture for picture, _ in found if picture is not None]
        if not good or not good[0].size:
            why = found[0][1] or "--roi leaves nothing of them"
            raise DataFileError(f"the film must have readable frames: {why}")
        return good

    def __iter__(self) -> Iterator[FilmFrame]:
        """All frames, one after the other."""
        return map(self._frame, range(self.count))

    def _frame(self, k: int) -> FilmFrame:
        path = self.files[0 if self.video else k]
        try:
            found = _read(path, k)["frames"]
        except DataFileError as error:
            return None, str(error)
        return self._plain(found[0]) if found else (None, f"{path.name} ends or is damaged here")

    def _plain(self, levels: Any) -> FilmFrame:
        """Grey levels of 8 bits, scaled as those of the first frame."""
        if not self._shape:
            self._depth, self._shape = int(levels.max()).bit_length(), levels.shape
        if levels.shape != self._shape:
            return None, f"it has {levels.shape} pixels, the first frame {self._shape}"
        if levels.dtype.kind != "u":
            return None, f"its grey levels are {levels.dtype}, expected whole numbers"
        shift = max(self._depth - BITS, 0) if levels.dtype != np.uint8 else 0
        return np.minimum(levels[self.region] >> shift, 255).astype(np.uint8), ""


def _read(path: Path, first: int) -> Any:
    """The answer of the child process, whose time is that for one image, whatever the size."""
    return read_file("frames", path, 2**62, 2**26, first=first, max_bytes=MEMORY)
