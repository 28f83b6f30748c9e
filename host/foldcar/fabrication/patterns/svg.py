"""Writes a sheet as SVG at true scale in millimetres, with Inkscape's layers."""

import itertools
from collections.abc import Iterator, Sequence

from foldcar.fabrication.patterns.drawing import Circle, Path, Shape, Sheet

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
