"""The order of cuts in the written files: openings, outlines; small, large; near."""

import itertools
import math

import pytest

from foldcar.fabrication.patterns.drawing import LayerName, Path, Sheet
from foldcar.fabrication.patterns.sheet_files import WRITERS
from sheet_reader import READERS


def square(layer: LayerName, x: float, y: float, side: float) -> Path:
    return Path(layer, ((x, y), (x + side, y), (x + side, y + side), (x, y + side)), closed=True)


def sheet() -> Sheet:
    """Nine pieces in a mixed order: a small, a larger opening in each, a large piece first."""
    places = [(2, 2), (0, 1), (1, 1), (2, 0), (0, 0), (1, 2), (0, 2), (2, 1), (1, 0)]
    groups = []
    for column, row in places:
        x, y = 50.0 * column, 50.0 * row
        side = 40.0 if (column + row) % 2 == 0 else 15.0
        openings = square("CUT_INNER", x + 5, y + 4, 9.0), square("CUT_INNER", x + 1, y + 1, 1.0)
        groups.append((square("CUT_OUTER", x, y, side), *openings))
    return Sheet("sheet_1", 150.0, 150.0, tuple(groups))


@pytest.mark.parametrize("ending", WRITERS)
def test_files_have_openings_before_outlines_small_before_large_near_to_near(ending: str) -> None:
    found = READERS[ending](WRITERS[ending](sheet())).shapes

    assert [shape.layer for shape in found] == ["CUT_INNER"] * 18 + ["CUT_OUTER"] * 9
    for layer in ("CUT_INNER", "CUT_OUTER"):
        cuts = [shape for shape in found if shape.layer == layer]
        sizes = [round(shape.length_mm, 3) for shape in cuts]
        assert sizes == sorted(sizes)
        place = (0.0, 0.0)
        for _, same in itertools.groupby(cuts, key=lambda shape: round(shape.length_mm, 3)):
            left = [shape.points_mm[0] for shape in same]
            while left:
                ways = [math.dist(place, start) for start in left]
                # The one that is cut now is as near as any that is left.
                assert ways[0] == pytest.approx(min(ways), abs=1e-6)
                place = left.pop(0)
