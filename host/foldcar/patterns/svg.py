"""Writes a sheet as SVG in true millimetres, its layers as Inkscape's."""

from xml.sax.saxutils import quoteattr

from foldcar.patterns.drawing import Circle, Path, Point, Shape, Sheet
from foldcar.patterns.layers import LAYERS


def svg(sheet: Sheet) -> str:
    """The file's text: one path a layer and shape kind, width and height in mm and a viewBox of the same numbers."""
    width, height = _number(sheet.width_mm), _number(sheet.height_mm)
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" '
        f'width="{width}mm" height="{height}mm" viewBox="0 0 {width} {height}">',
        f"<title>{sheet.name}</title>",
    ]
    for layer in LAYERS.values():
        lines.append(
            f'<g id="{layer.name}" inkscape:groupmode="layer" inkscape:label={quoteattr(layer.name)} fill="none" '
            f'stroke="{layer.hex}" stroke-width="{layer.width_mm:g}" stroke-linecap="round" stroke-linejoin="round">'
        )
        lines += [_element(shape, sheet.height_mm) for shape in sheet.on(layer.name)]
        lines.append("</g>")
    return "\n".join([*lines, "</svg>", ""])


def _element(shape: Shape, height: float) -> str:
    """SVG's y runs down."""
    if isinstance(shape, Circle):
        x, y = shape.center_mm
        return f'<circle cx="{_number(x)}" cy="{_number(height - y)}" r="{_number(shape.radius_mm)}"/>'
    return f'<path d="{_path(shape, height)}"/>'


def _path(path: Path, height: float) -> str:
    def pair(p: Point) -> str:
        return f"{_number(p[0])} {_number(height - p[1])}"

    return "M" + "L".join(pair(p) for p in path.points_mm) + ("Z" if path.closed else "")


def _number(value: float) -> str:
    return f"{value:.4f}".rstrip("0").rstrip(".")
