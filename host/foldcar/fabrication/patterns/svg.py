"""Writes a sheet as SVG at true scale in millimetres, with Inkscape's layers."""

import io
import itertools
import math
import re
from collections.abc import Iterator, Sequence

import svgelements

from foldcar.fabrication.patterns.drawing import LAYERS, Circle, LayerName, Path, Point, Shape, Sheet
from foldcar.fabrication.patterns.verify import ReadingError

# Files have a resolution of 1 µm.
DECIMALS = 3


def svg(sheet: Sheet) -> str:
    """The file's text; width and height are in mm, and the viewBox has the same numbers.

    A piece's open lines on one layer (dashes and letters) are one path; outlines and circles are separate elements.
    """
    width, height = _number(sheet.width_mm), _number(sheet.height_mm)
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" '
        f'width="{width}mm" height="{height}mm" viewBox="0 0 {width} {height}">',
        f"<title>{sheet.name}</title>",
    ]
    for layer in LAYERS.values():
        cap = "butt" if layer.name == "QR_CODE" else "round"
        dashes = " ".join(f"{length:g}" for length in layer.dashes_mm) if sheet.dashed else ""
        lines.append(
            f'<g id="{layer.name}" inkscape:groupmode="layer" inkscape:label="{layer.name}" fill="none" '
            f'stroke="{layer.hex}" stroke-width="{layer.width_mm:g}" stroke-linecap="{cap}" stroke-linejoin="round"'
            + (f' stroke-dasharray="{dashes}">' if dashes else ">")
        )
        for group in sheet.on(layer.name):
            lines += _elements(group, sheet.height_mm)
        lines.append("</g>")
    return "\n".join([*lines, "</svg>", ""])


def _elements(group: Sequence[Shape], height: float) -> Iterator[str]:
    """The group's elements; in SVG y points down."""
    lines = []
    for shape in group:
        if isinstance(shape, Circle):
            x, y = shape.center_mm
            yield f'<circle cx="{_number(x)}" cy="{_number(height - y)}" r="{_number(shape.radius_mm)}"/>'
        elif shape.closed:
            yield f'<path d="{_path(shape, height)}"/>'
        else:
            lines.append(_path(shape, height))
    if lines:
        yield f'<path d="{"".join(lines)}"/>'


def _path(path: Path, height: float) -> str:
    """Path data with relative steps, which are half as long; differences of rounded points do not accumulate errors."""
    places = [(round(x, DECIMALS), round(height - y, DECIMALS)) for x, y in path.points_mm]
    first, *_ = places
    steps = [f"{_number(b[0] - a[0])} {_number(b[1] - a[1])}" for a, b in itertools.pairwise(places)]
    return f"M{_number(first[0])} {_number(first[1])}l{' '.join(steps)}" + ("z" if path.closed else "")


def _number(value: float) -> str:
    # Adding zero turns -0.0 into 0.0.
    return f"{round(value, DECIMALS) + 0.0:.{DECIMALS}f}".rstrip("0").rstrip(".")


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
