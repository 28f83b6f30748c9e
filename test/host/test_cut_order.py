"""The order of cuts in the written files, measured by readers that keep it: openings, outlines; small, large; near."""

import io
import itertools
import math
from collections.abc import Callable
from xml.etree import ElementTree

import ezdxf
import pytest
import svgelements

from foldcar.fabrication.patterns.drawing import Path, Point, Sheet
from foldcar.fabrication.patterns.dxf import dxf
from foldcar.fabrication.patterns.lbrn import lbrn
from foldcar.fabrication.patterns.svg import svg

# Layer, first and last point, longer side of a cut, in mm.
Cut = tuple[str, Point, Point, float]


def square(layer: str, x: float, y: float, side: float) -> Path:
    return Path(layer, ((x, y), (x + side, y), (x + side, y + side), (x, y + side)), closed=True)  # type: ignore[arg-type]


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


def cuts_of_svg(text: str) -> list[Cut]:
    found = []
    for group in svgelements.SVG.parse(io.StringIO(text), ppi=25.4):
        if isinstance(group, svgelements.Group):
            for path in group:
                x0, y0, x1, y1 = path.bbox()
                first, last = path.first_point, path.current_point
                ends = (first.x, 150.0 - first.y), (last.x, 150.0 - last.y)
                found.append((str(group.id), *ends, max(x1 - x0, y1 - y0)))
    return found


def cut(layer: str, points: list[Point]) -> Cut:
    xs, ys = zip(*points, strict=True)
    return layer, points[0], points[0], max(max(xs) - min(xs), max(ys) - min(ys))


def cuts_of_dxf(text: str) -> list[Cut]:
    space = ezdxf.read(io.StringIO(text)).modelspace()
    return [cut(line.dxf.layer, [(x, y) for x, y, *_ in line.get_points()]) for line in space.query("LWPOLYLINE")]


def cuts_of_lbrn(text: str) -> list[Cut]:
    root = ElementTree.fromstring(text)
    names = {s.find("index").attrib["Value"]: s.find("name").attrib["Value"] for s in root.iter("CutSetting")}  # type: ignore[union-attr]
    found = []
    for shape in root.iter("Shape"):
        if shape.attrib["Type"] == "Path":
            vertices = shape.findtext("VertList", "").split("V")[1:]
            points = [tuple(map(float, vertex.split("c")[0].split())) for vertex in vertices]
            found.append(cut(names[shape.attrib["CutIndex"]], points))  # type: ignore[arg-type]
    return found


@pytest.mark.parametrize(
    ("write", "read"), [(svg, cuts_of_svg), (dxf, cuts_of_dxf), (lbrn, cuts_of_lbrn)], ids=["svg", "dxf", "lbrn2"]
)
def test_files_have_openings_before_outlines_small_before_large_near_to_near(
    write: Callable[[Sheet], str], read: Callable[[str], list[Cut]]
) -> None:
    found = read(write(sheet()))

    assert [layer for layer, *_ in found] == ["CUT_INNER"] * 18 + ["CUT_OUTER"] * 9
    for layer in ("CUT_INNER", "CUT_OUTER"):
        cuts = [one for one in found if one[0] == layer]
        sizes = [round(size, 3) for *_, size in cuts]
        assert sizes == sorted(sizes)
        place = (0.0, 0.0)
        for _, same in itertools.groupby(cuts, key=lambda one: round(one[3], 3)):
            left = list(same)
            while left:
                ways = [math.dist(place, start) for _, start, _, _ in left]
                # The one that is cut now is as near as any that is left.
                assert ways[0] == pytest.approx(min(ways), abs=1e-6)
                place = left.pop(0)[2]
