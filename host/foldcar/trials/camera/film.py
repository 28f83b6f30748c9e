"""Reads films and photos as grey pictures, with the file's presentation times.

Times are never computed from frame numbers, because phones film at a varying rate. Raises FoldcarError, which names the
file, if it cannot be read.
"""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy

from foldcar.errors import FoldcarError
from foldcar.trials.camera.detection import Grey

MIN_PX = 320
LONGEST_S = 600.0


def read_photo(file: Path) -> Grey:
    """Return a photo in grey, rotated as its camera was held."""
    try:
        data = file.read_bytes()
    except OSError as error:
        raise FoldcarError(f"{file}: cannot be read: {error.strerror}") from error
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    picture: Any = cv2.imdecode(numpy.frombuffer(data, dtype=numpy.uint8), cv2.IMREAD_GRAYSCALE) if data else None
    if picture is None:
        raise FoldcarError(f"{file}: cannot be read as a picture (JPEG, PNG)")
    _check_size(file, picture)
    grey: Grey = picture
    return grey


def read_film(file: Path) -> Iterator[tuple[float, Grey]]:
    """Yield time (s since the first frame) and grey picture of each frame; skip repeated frames and times."""
    capture = _open(file)
    try:
        first_s: float | None = None
        last_s, last_thumbnail = -1.0, None
        while True:
            has_frame, frame = capture.read()
            if not has_frame:
                break
            position_s = float(capture.get(cv2.CAP_PROP_POS_MSEC)) / 1000
            first_s = position_s if first_s is None else first_s
            grey: Grey = frame if frame.ndim == 2 else cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)
            if last_thumbnail is None:
                _check_size(file, grey)
            # A recorder that drops a frame may repeat the previous one with a wrong time.
            is_repeated = last_thumbnail is not None and numpy.array_equal(grey[::16, ::16], last_thumbnail)
            last_thumbnail = grey[::16, ::16].copy()
            time_s = position_s - first_s
            if time_s > LONGEST_S:
                raise FoldcarError(f"{file}: is longer than {LONGEST_S:g} s: cut it to the trial")
            if time_s > last_s and not is_repeated:
                last_s = time_s
                yield time_s, grey
        if first_s is None:
            raise FoldcarError(f"{file}: cannot be read as a film: it has no frames")
    finally:
        capture.release()


def _open(file: Path) -> Any:
    """Open a film. Raises FoldcarError if it cannot be read."""
    if not file.is_file():
        raise FoldcarError(f"{file}: {'is no file' if file.exists() else 'no such file'}")
    if file.suffix.lower() in (".heic", ".heif"):
        raise FoldcarError(f"{file}: HEIC photos are not supported: save it as JPEG, or set the camera to JPEG")
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    # Suppress FFmpeg's own messages (AV_LOG_QUIET).
    os.environ["OPENCV_FFMPEG_LOGLEVEL"] = "-8"
    capture = cv2.VideoCapture(str(file), cv2.CAP_FFMPEG)
    if not capture.isOpened():
        raise FoldcarError(f"{file}: cannot be read as a film (MP4, MOV, MKV, AVI)")
    return capture


def _check_size(file: Path, grey: Grey) -> None:
    height, width = grey.shape
    if min(height, width) < MIN_PX:
        raise FoldcarError(f"{file}: is {width} × {height} pixels: its shorter side is below {MIN_PX}")
