"""Frames of a film, by OpenCV: image files, and the videos in AVI, MP4 and Matroska."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

# A video may not lead to other files, nor to the network; read when a video is opened.
os.environ["OPENCV_FFMPEG_CAPTURE_OPTIONS"] = "protocol_whitelist;file|threads;1"

import cv2
import numpy as np

from granpinn.foreign.program import Answer
from granpinn.regular import UnsafeFileError

LIBRARY = "OpenCV"
MAX_PIXELS = 2**26  # of a frame
_CONTAINERS = ((0, b"RIFF"), (4, b"ftyp"), (0, b"\x1a\x45\xdf\xa3"))
# The last video: a request goes on where the one before ended.
_open: dict[str, Any] = {}

cv2.setNumThreads(1)


def read(path: Path, answer: Answer, first: int = 0) -> dict[str, Any]:
    """Grey levels [rows, columns] of frame number `first`, none after the end of a video.

    An image has one frame. `declared` is the number of frames that a video declares.
    """
    with path.open("rb") as stream:
        head = stream.read(16)
    if not any(head[at:].startswith(magic) for at, magic in _CONTAINERS):
        image = cv2.imdecode(
            np.frombuffer(path.read_bytes(), np.uint8), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH
        )
        if image is None:
            raise UnsafeFileError("it is damaged, or no image that OpenCV reads: save it as PNG")
        return {"frames": [_kept(image, answer)], "declared": 1}
    video = _video(path, first)
    good, image = video.read()
    _open["next"] += good
    frames = [_kept(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), answer)] if good else []
    return {"frames": frames, "declared": max(int(video.get(cv2.CAP_PROP_FRAME_COUNT)), 0)}


def _video(path: Path, first: int) -> Any:
    """The video with `first` as its next frame."""
    if _open.get("path") != path or _open["next"] > first:
        capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
        if not capture.isOpened():
            raise UnsafeFileError("OpenCV cannot decode the video: save its frames as PNG")
        _open.update(path=path, capture=capture, next=0)
    while _open["next"] < first and _open["capture"].grab():
        _open["next"] += 1
    return _open["capture"]


def _kept(image: Any, answer: Answer) -> dict[str, Any]:
    if image.size > MAX_PIXELS:
        raise UnsafeFileError(f"a frame must have at most {MAX_PIXELS} pixels, got {image.size}")
    return answer.keep(image)
