"""Writes a sheet as SVG at true scale in millimetres, with Inkscape's layers, and reads it back."""

import itertools
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from xml.etree import ElementTree as ET

from foldcar.fabrication.patterns.drawing import LAYERS, Circle, LayerName, Path, Point, ReadingError, Shape, Sheet

# Files have a resolution of 1 µm.
DECIMALS = 3
SVG = "{http://www.w3.org/2000/svg}"
INKSCAPE_LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"


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
    for layer, groups in sheet.layers:
        cap = "butt" if layer.name == "QR_CODE" else "round"
        dashes = " ".join(f"{length:g}" for length in layer.dashes_mm) if sheet.dashed else ""
        lines.append(
            f'<g id="{layer.name}" inkscape:groupmode="layer" inkscape:label="{layer.name}" fill="none" '
            f'stroke="{layer.hex}" stroke-width="{layer.width_mm:g}" stroke-linecap="{cap}" stroke-linejoin="round"'
            + (f' stroke-dasharray="{dashes}">' if dashes else ">")
        )
        for group in groups:
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


def read_svg(text: str) -> Sheet:
    """The sheet in the file; ReadingError unless it is one with sizes in mm, of straight lines and circles on layers."""
    try:
        return _sheet(ET.fromstring(text))
    except (ET.ParseError, KeyError, ValueError, IndexError) as error:
        raise ReadingError(f"not SVG: {error!r}") from error


def _sheet(root: ET.Element) -> Sheet:
    # Without units the size depends on the program.
    sizes = [re.fullmatch("([0-9.]+)mm", root.attrib[side]) for side in ("width", "height")]
    if not all(sizes):
        raise ReadingError("width and height are not given in mm")
    width, height = (float(size[1]) for size in sizes if size)
    left, top, wide, high = map(float, root.attrib["viewBox"].split())

    def point(x: float, y: float) -> Point:
        return (x - left) * width / wide, height - (y - top) * height / high

    shapes: list[Shape] = []
    for group in root.iter(f"{SVG}g"):
        name = group.get(INKSCAPE_LABEL)
        if name not in LAYERS:
            raise ReadingError(f'has a layer "{name}"')
        layer = LAYERS[name].name
        for element in group:
            if element.tag == f"{SVG}circle":
                x, y, radius = (float(element.attrib[key]) for key in ("cx", "cy", "r"))
                shapes.append(Circle(layer, point(x, y), radius * width / wide))
            elif element.tag == f"{SVG}path":
                shapes += [replace(path, points_mm=tuple(point(*p) for p in path.points_mm))
                           for path in _lines(layer, element.attrib["d"])]  # fmt: skip
            else:
                raise ReadingError(f"has a {element.tag.removeprefix(SVG)} on {layer}")
    if any("transform" in element.attrib for element in root.iter()):
        raise ReadingError("has a transform")
    return Sheet("", width, height, (tuple(shapes),))


def _lines(layer: LayerName, data: str) -> Iterator[Path]:
    """The polylines of path data, of the commands M, L, l and z."""
    for part in re.findall("M[^M]*", data):
        points: list[Point] = []
        for command, text in re.findall("([A-Za-z])([^A-Za-z]*)", part):
            numbers = list(map(float, text.replace(",", " ").split()))
            if command not in "MLlz" or len(numbers) % 2:
                raise ReadingError(f"has a curve on {layer}")
            for dx, dy in zip(numbers[::2], numbers[1::2], strict=True):
                x, y = points[-1] if command == "l" else (0.0, 0.0)
                points.append((x + dx, y + dy))
        yield Path(layer, tuple(points), part.endswith("z"))
