"""The frames of a film, in order: read by the child process, a few frames ahead of their use."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from granpinn.importers.limits import read_file
from granpinn.importers.series import expand
from granpinn.importers.vectors import DataFileError
from granpinn.regular import open_regular_file

Picture = npt.NDArray[np.uint8]

VIDEOS = (".avi", ".mp4", ".mov", ".mkv", ".m4v")
BATCH = 8  # frames of a video in one request
AHEAD = 4  # requests
MEMORY = 2**30  # bytes of a request, whatever the size of a video
BITS = 8  # of the grey levels that are used
FEWEST = 4  # frames of a film


class FilmFrame(NamedTuple):
    """A frame, or why it cannot be read."""

    picture: Picture | None
    why: str = ""


@dataclass
class ImageSequence:
    """Frames of image files or of one video.

    Attributes:
        files: in order.
        count: frames that the files declare.
        region: rows and columns that are used.
    """

    files: list[Path]
    count: int
    video: bool
    region: tuple[slice, slice] = (slice(None), slice(None))
    _depth: int | None = field(default=None, repr=False)
    _shape: tuple[int, ...] = field(default=(), repr=False)

    def name(self, k: int) -> str:
        """Frame k in words."""
        return f"frame {k}" if self.video else f"frame {k} ({self.files[k].name})"

    def sample(self, count: int) -> list[Picture]:
        """Readable frames, evenly spaced over the film."""
        chosen = np.unique(np.linspace(0, self.count - 1, count).astype(int))
        found = [self._request(int(k), 1)[0] for k in chosen]
        good = [frame.picture for frame in found if frame.picture is not None]
        if not good:
            raise DataFileError(f"the film must have readable frames: {found[0].why}")
        if not good[0].size:
            raise DataFileError("--roi must lie in the pictures, and it leaves nothing of them")
        return good

    def __iter__(self) -> Iterator[FilmFrame]:
        """All frames, at most AHEAD * BATCH of them in memory."""
        size = BATCH if self.video else 1
        with ThreadPoolExecutor(1) as pool:
            pending: deque[Future[list[FilmFrame]]] = deque()
            for k in range(0, self.count, size):
                pending.append(pool.submit(self._request, k, min(size, self.count - k)))
                if len(pending) > AHEAD * BATCH / size:
                    yield from pending.popleft().result()
            while pending:
                yield from pending.popleft().result()

    def _request(self, first: int, count: int) -> list[FilmFrame]:
        path = self.files[0 if self.video else first]
        try:
            found = _read(path, first, count)["frames"]
        except DataFileError as error:
            return [FilmFrame(None, str(error))] * count
        missing = FilmFrame(None, f"{path.name} ends or is damaged here")
        return [self._plain(a) for a in found] + [missing] * (count - len(found))

    def _plain(self, levels: Any) -> FilmFrame:
        """Grey levels of 8 bits, scaled as those of the first frame."""
        if self._depth is None:
            self._depth, self._shape = int(levels.max()).bit_length(), levels.shape
        if levels.shape != self._shape:
            return FilmFrame(None, f"it has {levels.shape} pixels, the first frame {self._shape}")
        levels = levels[self.region]
        if levels.dtype == np.uint8:
            return FilmFrame(np.ascontiguousarray(levels))
        if levels.dtype.kind != "u":
            return FilmFrame(None, f"its grey levels are {levels.dtype}, expected whole numbers")
        return FilmFrame(np.minimum(levels >> max(self._depth - BITS, 0), 255).astype(np.uint8))


def _read(path: Path, first: int, count: int) -> Any:
    return read_file("frames", path, _require_regular, first=first, count=count, max_bytes=MEMORY)


def _require_regular(path: Path) -> int:
    """Checks the file; the time for a request is that of one image."""
    open_regular_file(path, 2**62).close()
    return 2**26


def opened(sources: Sequence[str | Path]) -> ImageSequence:
    """The film of image files, a folder or pattern of them, or a video.

    Raises:
        DataFileError: no file matches, or there are too few frames.
    """
    files = expand(sources)
    video = files[0].suffix.lower() in VIDEOS
    if video and len(files) > 1:
        raise DataFileError(f"a film must be one video or many images, got {len(files)} videos")
    count = int(_read(files[0], 0, 1)["declared"]) if video else len(files)
    if count < FEWEST:
        raise DataFileError(f"a film must have at least {FEWEST} frames, got {count}: give more")
    return ImageSequence(files, count, video)
