"""Reads a cutting sheet from DXF with ezdxf.

Input: the file's text. Output: a Sheet in millimetres.
"""

import io

from ezdxf import units
from ezdxf.entities.circle import Circle as DxfCircle
from ezdxf.entities.lwpolyline import LWPolyline
from ezdxf.filemanagement import read
from ezdxf.lldxf.const import DXFError

from foldcar.fabrication.patterns.drawing import Circle, Path, Shape, Sheet
from foldcar.fabrication.patterns.layers import LAYERS
from foldcar.fabrication.patterns.reading_error import ReadingError


def read_dxf(text: str) -> Sheet:
    """The sheet in the file, its size from the drawing limits; ReadingError if it is not a valid sheet."""
    try:
        document = read(io.StringIO(text))
    except (OSError, DXFError) as error:
        raise ReadingError(f"not DXF: {error}") from error
    problems = document.audit().errors
    if problems:
        raise ReadingError(f"fails ezdxf's audit: {problems[0].message}")
    if document.units != units.MM:
        raise ReadingError(f"$INSUNITS is {document.units}, millimetres are {int(units.MM)}")
    space = document.modelspace()
    shapes: list[Shape] = []
    for entity in space:
        name = entity.dxf.layer
        if name not in LAYERS or name not in document.layers:
            raise ReadingError(f'has a layer "{name}"')
        layer = LAYERS[name].name
        if isinstance(entity, DxfCircle):
            shapes.append(Circle(layer, (entity.dxf.center.x, entity.dxf.center.y), entity.dxf.radius))
        elif isinstance(entity, LWPolyline) and not entity.has_arc:
            points = tuple((float(x), float(y)) for x, y in entity.get_points("xy"))
            shapes.append(Path(layer, points, bool(entity.closed)))
        else:
            raise ReadingError(f"has a {entity.dxftype()} on {name}")
    low, high = space.dxf.limmin, space.dxf.limmax
    if (low[0], low[1]) != (0, 0):
        raise ReadingError(f"the sheet's corner is at {low[0]:g}, {low[1]:g}")
    return Sheet("", float(high[0]), float(high[1]), (tuple(shapes),))
