"""Reads a cutting sheet from SVG with svgelements.

Input: the file's text. Output: a Sheet in millimetres.
"""

import io
import math
import re

import svgelements

from foldcar.fabrication.patterns.drawing import Circle, Path, Point, Shape, Sheet
from foldcar.fabrication.patterns.layers import LAYERS, LayerName
from foldcar.fabrication.patterns.reading_error import ReadingError

# svgelements' unit is the pixel; at this resolution it equals 1 mm.
PIXELS_PER_INCH = 25.4
INKSCAPE_LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"


def read_svg(text: str) -> Sheet:
    """The sheet in the file; ReadingError if it is not a valid sheet with sizes in mm."""
    try:
        drawing = svgelements.SVG.parse(io.StringIO(text), ppi=PIXELS_PER_INCH, reify=True)
    except (ValueError, SyntaxError) as error:
        raise ReadingError(f"not SVG: {error}") from error
    # Without units the size depends on the program.
    root = re.search(r"<svg\b[^>]*>", text)
    sizes = [re.search(rf'\b{side}="[0-9.]+mm"', root[0]) if root else None for side in ("width", "height")]
    if not all(sizes):
        raise ReadingError("width and height are not given in mm")
    height = float(drawing.height)
    shapes: list[Shape] = []
    for group in drawing:
        if not isinstance(group, svgelements.Group):
            continue
        name = group.values.get(INKSCAPE_LABEL) or group.id
        if name not in LAYERS:
            raise ReadingError(f'has a layer "{name}"')
        for element in group:
            if isinstance(element, svgelements.Shape):
                shapes += _shapes(element, LAYERS[name].name, height)
    return Sheet("", float(drawing.width), height, (tuple(shapes),))


def _shapes(element: svgelements.Shape, layer: LayerName, height: float) -> list[Shape]:
    if isinstance(element, svgelements.Circle | svgelements.Ellipse):
        if not math.isclose(element.rx, element.ry, rel_tol=1e-6):
            raise ReadingError(f"has an ellipse on {layer}")
        return [Circle(layer, (float(element.cx), height - float(element.cy)), float(element.rx))]
    path = element if isinstance(element, svgelements.Path) else svgelements.Path(element)
    found: list[Shape] = []
    points: list[Point] = []
    for segment in path:
        if isinstance(segment, svgelements.Line):
            points.append(_point(segment, height))
            continue
        closed = isinstance(segment, svgelements.Close)
        if not closed and not isinstance(segment, svgelements.Move):
            raise ReadingError(f"has a curve on {layer}")
        if len(points) > 1:
            found.append(Path(layer, tuple(points), closed))
        points = [] if segment.end is None else [_point(segment, height)]
    if len(points) > 1:
        found.append(Path(layer, tuple(points), False))
    return found


def _point(segment: svgelements.PathSegment, height: float) -> Point:
    return float(segment.end.x), height - float(segment.end.y)
