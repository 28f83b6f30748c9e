"""Draws the markers as sheets to print: a PDF at true scale, with a bar to measure, and the board for the lens.

Input: a course. Output: the bytes of a PDF with pages of A4: floor markers, one a page; the car's marker with a stand to
fold; obstacles' cards; the board. Squares are drawn as vectors, so that printers do not smooth pixels.
"""

import io
from itertools import pairwise
from string import ascii_uppercase
from typing import Any

import cv2
import numpy
from reportlab import rl_config
from reportlab.lib.units import mm
from reportlab.pdfgen.canvas import Canvas

from foldcar.errors import FoldcarError
from foldcar.trials.camera.lens import BOARD_MARKER_M, BOARD_SQUARES, SQUARE_M, board
from foldcar.trials.camera.markers import CAR_ID, CARD_MARGIN, FIRST_OBSTACLE_ID, MAX_OBSTACLES, MODULES, Course

PAGE_MM = (210.0, 297.0)
EDGE_MM = 12.0
BAR_MM = 100.0
CAPTION_MM = 7.0


def sheets(course: Course, obstacles: int = 4) -> bytes:
    """Return the bytes of the PDF with a course's markers, cards for ``obstacles`` obstacles, and the lens's board.

    Raises FoldcarError if a marker is too large for a page.
    """
    # No ASCII-85 encoding: compressed streams are binary.
    rl_config.useA85 = 0
    binary = io.BytesIO()
    canvas = Canvas(binary, pagesize=(PAGE_MM[0] * mm, PAGE_MM[1] * mm), invariant=1, pageCompression=1)
    canvas.setTitle("Markers")
    canvas.setCreator("foldcar")
    canvas.setViewerPreference("PrintScaling", "None")
    for marker in course.floor:
        size = 1000 * course.floor_size_m
        x, y = (PAGE_MM[0] - size) / 2, (PAGE_MM[1] - size) / 2
        _begin(canvas)
        card = _card(canvas, marker.id, x, y, size)
        place = f"middle at x = {1000 * marker.x_m:.0f} mm, y = {1000 * marker.y_m:.0f} mm"
        _text(canvas, PAGE_MM[0] / 2, y - card - 11, f"Floor marker {marker.id}: {place}; flat, fixed with tape", 11)
        # Lines at the middles of its sides, to which people measure.
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            line_start = (x + size / 2 + dx * (size / 2 + card), y + size / 2 + dy * (size / 2 + card))
            canvas.line(*line_start, line_start[0] + 5 * dx, line_start[1] + 5 * dy)
        _arrow(canvas, x + size + card + 4, y + size / 2, "x")
        canvas.showPage()
    _car_page(canvas, course)
    _obstacle_pages(canvas, course, min(obstacles, MAX_OBSTACLES))
    _board_page(canvas)
    canvas.save()
    return binary.getvalue()


def _begin(canvas: Any) -> None:
    """Begin a page: set the unit to millimetres and draw the bar to measure."""
    canvas.scale(mm, mm)
    canvas.setLineWidth(0.2)
    canvas.line(EDGE_MM, EDGE_MM, EDGE_MM + BAR_MM, EDGE_MM)
    for x in range(0, int(BAR_MM) + 1, 10):
        canvas.line(EDGE_MM + x, EDGE_MM, EDGE_MM + x, EDGE_MM + (3 if x % 50 else 5))
    canvas.setFont("Helvetica", 3)
    canvas.drawString(EDGE_MM + BAR_MM + 3, EDGE_MM, f"{BAR_MM:.0f} mm: print at 100 %, then measure this bar")


def _text(canvas: Any, x: float, y: float, text: str, points: float) -> None:
    canvas.setFont("Helvetica", points / 2.83)
    canvas.drawCentredString(x, y, text)


def _arrow(canvas: Any, x: float, y: float, text: str) -> None:
    canvas.line(x, y, x + 9, y)
    canvas.line(x + 9, y, x + 6.5, y + 1.5)
    canvas.line(x + 9, y, x + 6.5, y - 1.5)
    _text(canvas, x + 12, y - 1, text, 9)


def _card(canvas: Any, number: int, x: float, y: float, size: float) -> float:
    """Draw a marker with its lower left corner at (x, y), and its card's outline; return the width of the margin."""
    margin = CARD_MARGIN * size
    if size + 2 * margin > PAGE_MM[0] - 2:
        raise FoldcarError(f"a marker of {size:g} mm with its margin is wider than a page of {PAGE_MM[0]:g} mm")
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    _squares(canvas, cv2.aruco.generateImageMarker(dictionary, number, MODULES), x, y, size)
    canvas.setDash([1.0, 1.0])
    canvas.rect(x - margin, y - margin, size + 2 * margin, size + 2 * margin)
    canvas.setDash([])
    return margin


def _squares(canvas: Any, picture: Any, x: float, y: float, size: float) -> None:
    """Draw the black pixels of a small picture as one path of rectangles, so that no viewer shows lines between them.

    Equal rows next to each other are one band, in which each run of black pixels is a rectangle.
    """
    step = size / picture.shape[1]
    path = canvas.beginPath()
    is_dark = picture < 128
    changes = numpy.flatnonzero((is_dark[1:] != is_dark[:-1]).any(axis=1)) + 1
    row_bounds = [0, *changes.tolist(), len(is_dark)]
    for top, next_row in pairwise(row_bounds):
        # Where runs of black pixels begin and end.
        column_bounds = numpy.flatnonzero(numpy.diff(numpy.concatenate([[0], is_dark[top], [0]]).astype(int)))
        for start, end in zip(column_bounds[::2], column_bounds[1::2], strict=True):
            left, bottom = x + start * step, y + (len(is_dark) - next_row) * step
            path.rect(left, bottom, (end - start) * step, (next_row - top) * step)
    canvas.setFillGray(0)
    canvas.drawPath(path, stroke=0, fill=1)


def _car_page(canvas: Any, course: Course) -> None:
    """Draw the car's marker on a stand, a box without a bottom; its walls are as high as the marker above the lid.

    x and y are in mm from the page's lower left corner.
    """
    _begin(canvas)
    size, height = 1000 * course.car_size_m, 1000 * course.car_height_m
    x, y = (PAGE_MM[0] - size) / 2, 170 - size / 2
    side = size + 2 * _card(canvas, CAR_ID, x, y, size)
    low_x, low_y = x - (side - size) / 2, y - (side - size) / 2
    if height:
        # The top and two opposite walls are one rectangle, the other two walls a second across it. Each wall has a foot.
        tab = 8.0
        canvas.rect(low_x - height, low_y, side + 2 * height, side)
        canvas.rect(low_x, low_y - height, side, side + 2 * height)
        for left, bottom, width, height_mm in (
            (low_x - height - tab, low_y, tab, side), (low_x + side + height, low_y, tab, side),
            (low_x, low_y - height - tab, side, tab), (low_x, low_y + side + height, side, tab),
        ):  # fmt: skip
            canvas.rect(left, bottom, width, height_mm)
    _text(canvas, PAGE_MM[0] / 2, y + size + (side - size) / 2 + height + 15, "front of the car", 11)
    place_text = f"its middle {1000 * course.car_x_m:.0f} mm ahead of the car's middle"
    place_text = place_text if course.car_x_m else "on the middle of the lid"
    stand = f"Fold at all lines, walls down, tape at the corners, feet outwards onto the lid: {height:.0f} mm above it"
    _text(canvas, PAGE_MM[0] / 2, 49, f"The car's marker, {place_text}", 10)
    _text(canvas, PAGE_MM[0] / 2, 43, stand if height else "Flat on the lid", 10)
    canvas.showPage()


def _obstacle_pages(canvas: Any, course: Course, count: int) -> None:
    """Draw the cards of ``count`` obstacles, as many on a page as fit."""
    size = 1000 * course.obstacle_size_m
    side = size * (1 + 2 * CARD_MARGIN)
    columns = max(1, int((PAGE_MM[0] - 2 * EDGE_MM) // (side + 4)))
    rows = max(1, int((PAGE_MM[1] - 3 * EDGE_MM) // (side + CAPTION_MM + 4)))
    for first in range(0, count, rows * columns):
        _begin(canvas)
        for index in range(first, min(count, first + rows * columns)):
            row, column = divmod(index - first, columns)
            x = EDGE_MM + column * (side + 4) + CARD_MARGIN * size
            y = PAGE_MM[1] - EDGE_MM - (row + 1) * (side + CAPTION_MM + 4) + CARD_MARGIN * size
            _card(canvas, FIRST_OBSTACLE_ID + index, x, y, size)
            letter = ascii_uppercase[index]
            canvas.setFillGray(0)
            _text(canvas, x + size / 2, y + size + 3, letter, 14)
            _text(canvas, x + size / 2, y - CARD_MARGIN * size + 4.5, "this edge at the middle of its left side;", 5)
            _text(canvas, x + size / 2, y - CARD_MARGIN * size + 2, "hill, hole, patch: middle on its middle", 5)
        canvas.showPage()


def _board_page(canvas: Any) -> None:
    """Draw the board for the calibration of a lens."""
    _begin(canvas)
    columns, rows = BOARD_SQUARES
    # Resolution of the picture: 100 pixels for each module of a marker.
    modules = 7
    pixels_per_square = round(SQUARE_M / BOARD_MARKER_M * modules * 100)
    picture = board().generateImage((columns * pixels_per_square, rows * pixels_per_square), None, 0, 1)
    width = 1000 * SQUARE_M * columns
    x, y = (PAGE_MM[0] - width) / 2, 28.0
    _squares(canvas, picture, x, y, width)
    _text(canvas, PAGE_MM[0] / 2, PAGE_MM[1] - 8, "Board for the lens: glue it onto something flat", 10)
    canvas.showPage()
