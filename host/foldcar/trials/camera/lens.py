"""A camera's lens: focal length, middle and distortion in pixels, calibrated with a ChArUco board and kept as JSON.

Input: a film or photos of the board. Output: a Lens, or a FoldcarError that says what is missing. Without a board,
`view.py` fits focal length and first distortion to the floor markers.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy
from pydantic import ConfigDict, Field, TypeAdapter

from foldcar.errors import FoldcarError
from foldcar.outputs import atomic_file
from foldcar.trials.camera.detection import Floats, Grey
from foldcar.trials.camera.film import read_film, read_photo
from foldcar.trials.camera.markers import read_json

# The board on A4: squares and markers in it (m).
BOARD_SQUARES = (8, 11)
SQUARE_M, BOARD_MARKER_M = 0.023, 0.017
PHOTOS = (".jpg", ".jpeg", ".png")
MIN_CORNERS, MIN_VIEWS, MAX_VIEWS = 20, 8, 40
# Views that differ by less (pixels at 1000 pixels of width) add no information.
MIN_DIFFERENCE_PX = 40.0
# With a worse fit, the board was not flat or the focus changed (pixels at 1000 pixels of width).
MAX_RMS_PX = 1.0
# Time from the first to the last row of a picture; phones take 10 to 30 ms.
READOUT_S = 0.015


# These limits are checked when a file is read.
Pixels = Annotated[int, Field(ge=320, le=20_000)]
Middle = Annotated[float, Field(ge=0, le=20_000)]
Bend = Annotated[float, Field(ge=-10, le=10)]


@dataclass(frozen=True, slots=True)
class Lens:
    """The lens of pictures of ``width`` × ``height`` pixels; ``distortion`` is OpenCV's k1, k2, p1, p2, k3.

    ``readout_s`` is the time from the first row to the last, ``error_px`` the residual of the fit.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

    width: Pixels
    height: Pixels
    focal_px: Annotated[float, Field(ge=100, le=100_000)]
    middle_px: tuple[Middle, Middle]
    distortion: tuple[Bend, Bend, Bend, Bend, Bend] = (0.0,) * 5
    readout_s: Annotated[float, Field(ge=0, le=0.1)] = READOUT_S
    error_px: Annotated[float, Field(ge=0, le=100)] = 0.0

    @property
    def matrix(self) -> Floats:
        """The camera matrix."""
        return numpy.array([[self.focal_px, 0, self.middle_px[0]], [0, self.focal_px, self.middle_px[1]], [0, 0, 1.0]])

    def pixels(self, points: Floats) -> Floats:
        """Return the pixels (n, 2) of points (n, 3) in the camera's frame: x right, y down, z ahead."""
        x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
        # Brown and Conrady's distortion: k radial, p tangential.
        k1, k2, p1, p2, k3 = self.distortion
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        return numpy.column_stack([u * self.focal_px + self.middle_px[0], v * self.focal_px + self.middle_px[1]])

    def rays(self, pixels: Floats) -> Floats:
        """Return the directions (n, 3), with z = 1, of pixels (n, 2) in the camera's frame."""
        ideal = cv2.undistortPoints(pixels.reshape(-1, 1, 2).astype(float), self.matrix, numpy.array(self.distortion))
        return numpy.column_stack([ideal.reshape(-1, 2), numpy.ones(len(pixels))])

    def of_size(self, width: int, height: int, where: str) -> "Lens":
        """Return the lens for pictures of another resolution. Raises FoldcarError if the aspect ratio differs."""
        scale = width / self.width
        if abs(height - scale * self.height) > 2:
            raise FoldcarError(
                f"{where}: has {width} × {height} pixels, but the lens file is for {self.width} × {self.height}"
            )
        # Pixel centres have integer coordinates, so the picture's edge is at -0.5.
        x, y = (scale * (value + 0.5) - 0.5 for value in self.middle_px)
        return replace(self, width=width, height=height, focal_px=scale * self.focal_px, middle_px=(x, y))


def assumed_lens(width: int, height: int) -> Lens:
    """Return the start value of a fit: the main camera of most phones, whose film is 65° wide."""
    return Lens(width, height, 0.8 * max(width, height), ((width - 1) / 2, (height - 1) / 2))


def board() -> Any:
    """Return the ChArUco board."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    return cv2.aruco.CharucoBoard(BOARD_SQUARES, SQUARE_M, BOARD_MARKER_M, dictionary)


def calibrate(files: Sequence[Path]) -> tuple[Lens, int]:
    """Calibrate the lens with pictures of the board; return it and the number of views used. Raises FoldcarError."""
    detector = cv2.aruco.CharucoDetector(board())
    shape: tuple[int, int] | None = None
    # The pixels of each view's corners, by corner number.
    views: list[dict[int, Any]] = []
    files_text = str(files[0]) if len(files) == 1 else f"{files[0]} and {len(files) - 1} more"
    for file, grey in _pictures(files):
        if shape is None:
            shape = grey.shape
        elif grey.shape != shape:
            raise FoldcarError(
                f"{file}: has {grey.shape[1]} × {grey.shape[0]} pixels, {files[0]} {shape[1]} × {shape[0]}"
            )
        corners, ids, _, _ = detector.detectBoard(grey)
        corner_pixels = {} if ids is None else dict(zip(ids.ravel().tolist(), corners.reshape(-1, 2), strict=True))
        if len(corner_pixels) >= MIN_CORNERS and all(_differ(corner_pixels, view, shape[1]) for view in views):
            views.append(corner_pixels)
        if len(views) == MAX_VIEWS:
            break
    if shape is None or len(views) < MIN_VIEWS:
        raise FoldcarError(
            f"{files_text}: {len(views)} views show at least {MIN_CORNERS} corners of the board and differ; "
            f"{MIN_VIEWS} are needed: turn and tilt it, near and in the corners of the picture"
        )
    height, width = shape
    # Square pixels, and no third radial term, which few views determine.
    flags = cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_FIX_K3
    start_matrix = assumed_lens(width, height).matrix
    board_corners = numpy.array(board().getChessboardCorners(), numpy.float32)
    object_points = [board_corners[list(view)] for view in views]
    image_points = [numpy.array(list(view.values())) for view in views]
    flags |= cv2.CALIB_USE_INTRINSIC_GUESS
    rms, matrix, distortion, *_ = cv2.calibrateCamera(
        object_points, image_points, (width, height), start_matrix, numpy.zeros(5), flags=flags
    )
    if rms > MAX_RMS_PX * max(1.0, width / 1000):
        raise FoldcarError(f"{files_text}: the board fits to {rms:.1f} pixels only: lay it flat, lock focus and zoom")
    k1, k2, p1, p2, k3 = (float(value) for value in distortion.ravel()[:5])
    middle_px = (float(matrix[0, 2]), float(matrix[1, 2]))
    return Lens(width, height, float(matrix[0, 0]), middle_px, (k1, k2, p1, p2, k3), READOUT_S, float(rms)), len(views)


def _pictures(files: Sequence[Path]) -> Iterator[tuple[Path, Grey]]:
    """Yield each photo, and a few frames a second of each film, with its file."""
    for file in files:
        if file.suffix.lower() in PHOTOS:
            yield file, read_photo(file)
            continue
        last_s = -1.0
        for time_s, grey in read_film(file):
            # A few frames a second suffice, because neighbouring frames look alike.
            if time_s - last_s >= 0.2:
                last_s = time_s
                yield file, grey


def _differ(first: dict[int, Any], second: dict[int, Any], width: int) -> bool:
    """Return whether a corner that two views share has moved far enough."""
    distances = [numpy.linalg.norm(first[number] - second[number]) for number in first.keys() & second.keys()]
    return not distances or float(max(distances)) >= MIN_DIFFERENCE_PX * width / 1000


def write_lens(lens: Lens, file: Path) -> None:
    """Write the lens as JSON. Raises FoldcarError."""
    with atomic_file(file) as binary:
        binary.write((json.dumps(asdict(lens), indent=1) + "\n").encode())


def read_lens(file: Path) -> Lens:
    """Read a lens from a file. Raises FoldcarError that names file, key, value and limit."""
    return read_json(file, TypeAdapter(Lens))
