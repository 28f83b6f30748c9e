"""The picture of all sheets, as its pixels show it."""

import io
import itertools

import numpy as np
from matplotlib.image import imread
from numpy.typing import NDArray

from foldcar.fabrication.patterns.drawing import Circle, LayerName, Path, Shape, Sheet
from foldcar.fabrication.patterns.preview import SHEET_PX, preview

SQUARE = ((20.0, 20.0), (80.0, 20.0), (80.0, 80.0), (20.0, 80.0))


def sheet(number: int, hole: LayerName) -> Sheet:
    shapes: tuple[Shape, ...] = (Path("CUT_OUTER", SQUARE, closed=True), Circle(hole, (40.0, 60.0), 10.0))
    return Sheet(f"sheet_{number}", 100.0, 100.0, (shapes,), film="PET film, $0.25$ mm")


def pixels(png: bytes) -> NDArray[np.int_]:
    """(rows, columns, 3): red, green and blue from 0 to 255."""
    return np.round(255 * imread(io.BytesIO(png), format="png")[:, :, :3]).astype(int)


def test_every_sheet_is_shown_once_to_one_scale_in_the_layers_colours() -> None:
    holes: tuple[LayerName, ...] = ("CUT_INNER", "SCORE", "CUT_INNER")
    shown = pixels(preview([sheet(i, hole) for i, hole in enumerate(holes, 1)], "a car of $50 & more"))
    side = 0.6 * SHEET_PX
    dark = (shown < 100).all(axis=2)

    # Of each square's lower and upper edge, one row at least is dark over the whole length.
    edges = set()
    for row, line in enumerate(dark):
        start = 0
        for black, run in itertools.groupby(line.tolist()):
            length = len(list(run))
            if black and abs(length - side) < 5:
                edges.add((row // 10, round(start, -1)))
            start += length
    corners = {(round(10 * row / side, 1), left) for row, left in edges}
    assert len({left for _, left in corners}) == 2
    assert len({(round(row), left) for row, left in corners}) == 6
    # Circles of a radius of 10 of 100 mm, in lines of a pixel and more: green ones on two sheets, an orange one on one.
    red, green, blue = np.moveaxis(shown, 2, 0)
    circle = 2 * np.pi * 0.1 * SHEET_PX
    assert 2 * circle < ((green > red + 50) & (green > blue + 50)).sum() < 6 * circle
    assert circle < ((red > green + 30) & (green > blue + 30)).sum() < 4 * circle
    # No layer that these sheets lack is in the legend.
    assert not (blue > red + 50).any()
