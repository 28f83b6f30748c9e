"""Writes a sheet as a LightBurn project (.lbrn2).

LightBurn does not document the format; this follows public files of FormatVersion 1 and has not been opened in LightBurn
itself. A CutSetting for each layer has its number in the palette and its priority, the place in the order of cutting;
each line is a Shape in millimetres, y up. The sheet's edge is on the tool layer T1, which is never cut.
"""

import itertools
from xml.etree import ElementTree as ET

from foldcar.fabrication.patterns.drawing import LAYERS, Circle, Point, Sheet

TOOL_LAYER = 30


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
            # Without handles: LightBurn's lines are Bezier curves of degree one.
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
