"""Writes a sheet as a LightBurn project (.lbrn2), and reads it back.

LightBurn does not document the format; this follows public files of FormatVersion 1 and has not been opened in LightBurn
itself. A CutSetting for each layer has its number in the palette and its priority, the place in the order of cutting;
each line is a Shape in millimetres, y up. The sheet's edge is on the tool layer T1, which is never cut.
"""

import itertools
import re
from collections.abc import Iterator
from xml.etree import ElementTree as ET

from foldcar.fabrication.patterns.drawing import LAYERS, Circle, Path, Point, ReadingError, Shape, Sheet

TOOL_LAYER = 30
# A vertex, and that it has no handles: LightBurn's lines are Bezier curves of degree one.
VERTEX = re.compile(r"V(-?[0-9.]+) (-?[0-9.]+)(?:c0x1c1x1)?")
LINES = {"LineClosed": True, "LineOpen": False}


def lbrn(sheet: Sheet) -> str:
    """The project's text. The QR code's output is off; powers and speeds are left to LightBurn's presets."""
    root = ET.Element("LightBurnProject", AppVersion="1.2.01", FormatVersion="1", MaterialHeight="0", MirrorX="False",
                      MirrorY="False")  # fmt: skip
    for priority, layer in enumerate(LAYERS.values()):
        setting = _setting(root, "Cut", int(layer.lightburn[1:]), layer.name, priority)
        if layer.name == "QR_CODE":
            ET.SubElement(setting, "doOutput", Value="0")
    _setting(root, "Tool", TOOL_LAYER, "T1", len(LAYERS))
    frame = ET.SubElement(root, "Shape", Type="Rect", CutIndex=str(TOOL_LAYER), W=_number(sheet.width_mm),
                          H=_number(sheet.height_mm), Cr="0")  # fmt: skip
    _moved(frame, (sheet.width_mm / 2, sheet.height_mm / 2))
    for layer, groups in sheet.layers:
        index = str(int(layer.lightburn[1:]))
        for shape in itertools.chain.from_iterable(groups):
            if isinstance(shape, Circle):
                radius = _number(shape.radius_mm)
                circle = ET.SubElement(root, "Shape", Type="Ellipse", CutIndex=index, Rx=radius, Ry=radius)
                _moved(circle, shape.center_mm)
                continue
            made = _moved(ET.SubElement(root, "Shape", Type="Path", CutIndex=index), (0.0, 0.0))
            vertices = (f"V{_number(x)} {_number(y)}c0x1c1x1" for x, y in shape.points_mm)
            ET.SubElement(made, "VertList").text = "".join(vertices)
            ET.SubElement(made, "PrimList").text = "LineClosed" if shape.closed else "LineOpen"
    ET.indent(root, " ")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


def _setting(root: ET.Element, kind: str, index: int, name: str, priority: int) -> ET.Element:
    setting = ET.SubElement(root, "CutSetting", type=kind)
    for key, value in (("index", index), ("name", name), ("priority", priority)):
        ET.SubElement(setting, key, Value=str(value))
    return setting


def _moved(shape: ET.Element, shift: Point) -> ET.Element:
    ET.SubElement(shape, "XForm").text = f"1 0 0 1 {_number(shift[0])} {_number(shift[1])}"
    return shape


def _number(value: float) -> str:
    return f"{round(value, 4) + 0.0:.10g}"


def read_lbrn(text: str) -> Sheet:
    """The sheet in the project; ReadingError if it is not one, or if its layers are not cut in their order."""
    try:
        root = ET.fromstring(text)
        names = dict(_layers(root))
        shapes: list[Shape] = []
        size: Point | None = None
        for element in root.iter("Shape"):
            index, kind = element.attrib["CutIndex"], element.attrib["Type"]
            x, y = _shift(element)
            if index == str(TOOL_LAYER) and kind == "Rect":
                size = float(element.attrib["W"]), float(element.attrib["H"])
                if (2 * x, 2 * y) != size:
                    raise ReadingError(f"the sheet's corner is at {x - size[0] / 2:g}, {y - size[1] / 2:g}")
                continue
            if names.get(index) not in LAYERS:
                raise ReadingError(f'has a {kind} on layer {index} "{names.get(index, "")}"')
            layer = LAYERS[names[index]].name  # type: ignore[index]
            if kind == "Ellipse" and element.attrib["Rx"] == element.attrib["Ry"]:
                shapes.append(Circle(layer, (x, y), float(element.attrib["Rx"])))
            elif kind == "Path":
                shapes.append(Path(layer, _points(element, (x, y)), LINES[element.findtext("PrimList", "")]))
            else:
                raise ReadingError(f"has a {kind} on {layer}")
    except (ET.ParseError, KeyError, ValueError) as error:
        raise ReadingError(f"not a LightBurn project: {error!r}") from error
    if size is None:
        raise ReadingError("has no sheet's edge on T1")
    return Sheet("", *size, (tuple(shapes),))


def _layers(root: ET.Element) -> Iterator[tuple[str, str]]:
    """Number and name of each layer in the order of cutting, which must be that of `LAYERS`."""
    found = []
    for setting in root.iter("CutSetting"):
        index, name, priority = (setting.find(key).attrib["Value"] for key in ("index", "name", "priority"))  # type: ignore[union-attr]
        found.append((int(priority), index, name))
    found.sort()
    if [name for _, _, name in found if name in LAYERS] != list(LAYERS):
        raise ReadingError("its layers are not cut in their order")
    yield from ((index, name) for _, index, name in found)


def _shift(element: ET.Element) -> Point:
    *turn, x, y = map(float, element.findtext("XForm", "").split())
    if turn != [1, 0, 0, 1]:
        raise ReadingError("has a shape that is turned")
    return x, y


def _points(element: ET.Element, shift: Point) -> tuple[Point, ...]:
    text = element.findtext("VertList", "")
    found = tuple((float(x) + shift[0], float(y) + shift[1]) for x, y in VERTEX.findall(text))
    if VERTEX.sub("", text):
        raise ReadingError("has a curve")
    return found
