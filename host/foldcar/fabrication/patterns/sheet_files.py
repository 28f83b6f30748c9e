"""Writes sheets as files: SVG, DXF R2010, LightBurn projects and PDF, at true scale in millimetres, and a picture of all.

SVG has Inkscape's layers. Pages of a PDF have the sheets' sizes, and their layers differ by colours. LightBurn does not
document its format (.lbrn2); this follows public files of FormatVersion 1 and has not been opened in LightBurn itself.
There a CutSetting for each layer has its number in the palette and its priority, the place in the order of cutting; each
line is a Shape in millimetres, y up. The sheet's edge is on the tool layer T1, which is never cut.
"""

import io
import itertools
import math
from collections.abc import Iterator, Sequence
from xml.etree import ElementTree as ET

from ezdxf import colors, units
from ezdxf._options import options as dxf_options
from ezdxf.filemanagement import new
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from reportlab import rl_config
from reportlab.lib.units import mm
from reportlab.pdfgen.canvas import Canvas

from foldcar.car.components.shape import on_circle
from foldcar.fabrication.patterns.drawing import LAYERS, Circle, Layer, Path, Point, Shape, Sheet, bounds
from foldcar.figures.style import drawing_style

# Files have a resolution of 1 µm.
SVG_DECIMALS = 3


def svg(sheet: Sheet) -> str:
    """Return the SVG file's text; width and height are in mm, and the viewBox has the same numbers.

    A piece's open lines on one layer (dashes and letters) are one path; outlines and circles are separate elements.
    """
    width, height = _svg_number(sheet.width_mm), _svg_number(sheet.height_mm)
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
            lines += _svg_elements(group, sheet.height_mm)
        lines.append("</g>")
    return "\n".join([*lines, "</svg>", ""])


def _svg_elements(group: Sequence[Shape], height: float) -> Iterator[str]:
    """Yield the group's elements; in SVG y points down."""
    lines = []
    for shape in group:
        if isinstance(shape, Circle):
            x, y = shape.center_mm
            yield f'<circle cx="{_svg_number(x)}" cy="{_svg_number(height - y)}" r="{_svg_number(shape.radius_mm)}"/>'
        elif shape.closed:
            yield f'<path d="{_svg_path(shape, height)}"/>'
        else:
            lines.append(_svg_path(shape, height))
    if lines:
        yield f'<path d="{"".join(lines)}"/>'


def _svg_path(path: Path, height: float) -> str:
    """Return path data with relative steps, half as long; differences of rounded points do not accumulate errors."""
    places = [(round(x, SVG_DECIMALS), round(height - y, SVG_DECIMALS)) for x, y in path.points_mm]
    first, *_ = places
    steps = [f"{_svg_number(b[0] - a[0])} {_svg_number(b[1] - a[1])}" for a, b in itertools.pairwise(places)]
    return f"M{_svg_number(first[0])} {_svg_number(first[1])}l{' '.join(steps)}" + ("z" if path.closed else "")


def _svg_number(value: float) -> str:
    # Adding zero turns -0.0 into 0.0.
    return f"{round(value, SVG_DECIMALS) + 0.0:.{SVG_DECIMALS}f}".rstrip("0").rstrip(".")


def dxf(sheet: Sheet) -> str:
    """Return the DXF file's text: LWPOLYLINEs and CIRCLEs on named layers, $INSUNITS 4.

    Its limits are the sheet, its extents the drawing.
    """
    # Fixed dates and ids, so that the same sheet gives the same bytes.
    fixed = dxf_options.write_fixed_meta_data_for_testing
    dxf_options.write_fixed_meta_data_for_testing = True
    try:
        document = new("R2010", units=units.MM)
        document.header["$MEASUREMENT"] = 1
        # ezdxf writes them in the order of a set, which differs between processes.
        document.classes.add_required_classes(document.dxfversion)
        document.classes.classes = dict(sorted(document.classes.classes.items()))
        for layer in LAYERS.values():
            if sheet.dashed and layer.dashes_mm:
                strokes = [length if i % 2 == 0 else -length for i, length in enumerate(layer.dashes_mm)]
                document.linetypes.add(layer.line_type, [sum(layer.dashes_mm), *strokes])
            # Line weights are in hundredths of a millimetre.
            made = document.layers.add(
                layer.name,
                color=layer.aci,
                lineweight=round(100 * layer.width_mm),
                linetype=layer.line_type if sheet.dashed else "CONTINUOUS",
            )
            # Index 7 alone is black on a light ground and white on a dark one; a true colour is the same on both.
            if layer.aci != colors.BLACK:
                made.rgb = layer.rgb
        space = document.modelspace()
        x0, y0, x1, y1 = bounds(sheet.shapes)
        document.header["$EXTMIN"], document.header["$EXTMAX"] = (x0, y0, 0.0), (x1, y1, 0.0)
        space.reset_extents((x0, y0, 0), (x1, y1, 0))
        space.reset_limits((0, 0), (sheet.width_mm, sheet.height_mm))
        for layer, groups in sheet.layers:
            attributes: dict[str, object] = {"layer": layer.name}
            # Programs draw a line's weight at any width; that of a polyline is true to scale.
            scaled = {"const_width": layer.width_mm} if layer.name == "QR_CODE" else {}
            for shape in itertools.chain.from_iterable(groups):
                if isinstance(shape, Circle):
                    space.add_circle(shape.center_mm, shape.radius_mm, dxfattribs=attributes)
                else:
                    space.add_lwpolyline(shape.points_mm, close=shape.closed, dxfattribs=attributes | scaled)
        text = io.StringIO()
        document.write(text)
        return text.getvalue()
    finally:
        dxf_options.write_fixed_meta_data_for_testing = fixed


TOOL_LAYER = 30
# In LightBurn's files, a vertex also has the two handles of the Bezier curves that meet there. This is what LightBurn
# writes for a vertex without handles, between straight lines.
LBRN_NO_HANDLES = "c0x1c1x1"


def lbrn(sheet: Sheet) -> str:
    """Return a LightBurn project with the sheet, as XML text.

    A sheet has a layer for each kind of line. LightBurn keeps the settings of the laser for each layer, and every shape
    has the number of its layer's setting as CutIndex. Powers and speeds are LightBurn's presets. The output of the QR
    code is off.
    """
    root = ET.Element("LightBurnProject", AppVersion="1.2.01", FormatVersion="1", MaterialHeight="0", MirrorX="False",
                      MirrorY="False")  # fmt: skip
    for priority, layer in enumerate(LAYERS.values()):
        setting = _lbrn_setting(root, "Cut", _lbrn_index(layer), layer.name, priority)
        if layer.name == "QR_CODE":
            ET.SubElement(setting, "doOutput", Value="0")
    # The edges of the sheet are on a tool layer, which LightBurn shows but does not cut.
    _lbrn_setting(root, "Tool", TOOL_LAYER, "T1", len(LAYERS))
    frame = ET.SubElement(root, "Shape", Type="Rect", CutIndex=str(TOOL_LAYER), W=_lbrn_number(sheet.width_mm),
                          H=_lbrn_number(sheet.height_mm), Cr="0")  # fmt: skip
    _lbrn_moved(frame, (sheet.width_mm / 2, sheet.height_mm / 2))
    for layer, groups in sheet.layers:
        index = str(_lbrn_index(layer))
        for shape in itertools.chain.from_iterable(groups):
            if isinstance(shape, Circle):
                radius = _lbrn_number(shape.radius_mm)
                circle = ET.SubElement(root, "Shape", Type="Ellipse", CutIndex=index, Rx=radius, Ry=radius)
                _lbrn_moved(circle, shape.center_mm)
                continue
            path = _lbrn_moved(ET.SubElement(root, "Shape", Type="Path", CutIndex=index), (0.0, 0.0))
            vertices = (f"V{_lbrn_number(x)} {_lbrn_number(y)}{LBRN_NO_HANDLES}" for x, y in shape.points_mm)
            ET.SubElement(path, "VertList").text = "".join(vertices)
            ET.SubElement(path, "PrimList").text = "LineClosed" if shape.closed else "LineOpen"
    ET.indent(root, " ")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


def _lbrn_index(layer: Layer) -> int:
    """Return the number of a layer in LightBurn's palette, which is called such as C02."""
    return int(layer.lightburn.removeprefix("C"))


def _lbrn_setting(root: ET.Element, kind: str, index: int, name: str, priority: int) -> ET.Element:
    setting = ET.SubElement(root, "CutSetting", type=kind)
    for key, value in (("index", index), ("name", name), ("priority", priority)):
        ET.SubElement(setting, key, Value=str(value))
    return setting


def _lbrn_moved(shape: ET.Element, shift: Point) -> ET.Element:
    ET.SubElement(shape, "XForm").text = f"1 0 0 1 {_lbrn_number(shift[0])} {_lbrn_number(shift[1])}"
    return shape


def _lbrn_number(value: float) -> str:
    return f"{round(value, 4) + 0.0:.10g}"


def pdf(sheets: Sequence[Sheet], title: str) -> bytes:
    """Return the PDF file's bytes: a page for each sheet, without margins of paper."""
    # No ASCII-85 encoding: compressed streams are binary.
    rl_config.useA85 = 0
    binary = io.BytesIO()
    canvas = Canvas(binary, invariant=1, pageCompression=1)
    canvas.setTitle(title)
    canvas.setCreator("foldcar")
    # Viewers that support it print without scaling to the page.
    canvas.setViewerPreference("PrintScaling", "None")
    for sheet in sheets:
        canvas.setPageSize((sheet.width_mm * mm, sheet.height_mm * mm))
        canvas.scale(mm, mm)
        canvas.setLineJoin(1)
        for layer, groups in sheet.layers:
            canvas.setLineCap(0 if layer.name == "QR_CODE" else 1)
            canvas.setDash(list(layer.dashes_mm) if sheet.dashed else [])
            canvas.setStrokeColorRGB(*(value / 255 for value in layer.rgb))
            canvas.setLineWidth(layer.width_mm)
            for group in groups:
                # All shapes of a group are one path, which keeps pages small.
                path = canvas.beginPath()
                for shape in group:
                    if isinstance(shape, Circle):
                        path.circle(*shape.center_mm, shape.radius_mm)
                        continue
                    path.moveTo(*shape.points_mm[0])
                    for point in shape.points_mm[1:]:
                        path.lineTo(*point)
                    if shape.closed:
                        path.close()
                canvas.drawPath(path, stroke=1, fill=0)
        canvas.showPage()
    canvas.save()
    return binary.getvalue()


# Pixels of a sheet's longer side, at which the names on pieces can be read; maximum pixels of the picture's sides.
SHEET_PX = 1300
MAX_PX = 6000
DPI = 100
# Heights, in pixels, of a sheet's heading, of the picture's and of each line of the legend.
HEADING_PX = 45
MARGIN_PX = 30
LEGEND_PX = 60
# Width of a layer's name in the legend (px).
KEY_PX = 260
# Thicker than a layer's line, so that names can be read.
LINE_PT = 0.9
FACETS = 32


@drawing_style({"text.parse_math": False})
def preview(sheets: Sequence[Sheet], title: str) -> bytes:
    """Return the bytes of a PNG for checking the sheets before cutting; it is not for cutting.

    Every sheet has its name and film. Lines have the colours of their layers, pieces are shaded.
    """
    columns = math.ceil(math.sqrt(len(sheets)))
    rows = math.ceil(len(sheets) / columns)
    width_mm, height_mm = (max(getattr(sheet, side) for sheet in sheets) for side in ("width_mm", "height_mm"))
    scale = min(SHEET_PX / max(width_mm, height_mm), MAX_PX / (columns * width_mm), MAX_PX / (rows * height_mm))
    cell = width_mm * scale + MARGIN_PX, height_mm * scale + HEADING_PX
    used = {shape.layer for sheet in sheets for shape in sheet.shapes}
    keys = [Line2D([], [], color=layer.hex, lw=3, label=layer.name) for layer in LAYERS.values() if layer.name in used]
    wide = columns * cell[0] + MARGIN_PX
    across = len(keys) if len(keys) * KEY_PX <= wide else math.ceil(len(keys) / 2)
    high = rows * cell[1] + math.ceil(len(keys) / across) * LEGEND_PX + HEADING_PX
    figure = Figure(figsize=(wide / DPI, high / DPI), dpi=DPI, facecolor="white")
    figure.text(MARGIN_PX / wide, 1 - 0.6 * HEADING_PX / high, title, fontsize=18, va="center")
    for number, sheet in enumerate(sheets):
        row, column = divmod(number, columns)
        left, low = MARGIN_PX + column * cell[0], high - HEADING_PX - (row + 1) * cell[1]
        axes = figure.add_axes(
            (left / wide, low / high, sheet.width_mm * scale / wide, sheet.height_mm * scale / high),
            xlim=(0, sheet.width_mm), ylim=(0, sheet.height_mm), frame_on=False, xticks=[], yticks=[],
        )  # fmt: skip
        axes.set_title(f"{sheet.name}: {sheet.film}", fontsize=14, loc="left")
        axes.add_patch(Rectangle((0, 0), sheet.width_mm, sheet.height_mm, fill=False, edgecolor="0.7", clip_on=False))
        outer = itertools.chain.from_iterable(sheet.cuts_on("CUT_OUTER"))
        outlines = [_picture_points(shape) for shape in outer if isinstance(shape, Path) and shape.closed]
        axes.add_collection(PolyCollection(outlines, facecolors="#eef3f8"))
        for layer, groups in sheet.layers:
            lines = [_picture_points(shape) for shape in itertools.chain.from_iterable(groups)]
            # Modules of the QR code are to be seen as squares: their lines are drawn at scale.
            points = layer.width_mm * scale * 72 / DPI if layer.name == "QR_CODE" else LINE_PT
            cap = "butt" if layer.name == "QR_CODE" else "round"
            axes.add_collection(LineCollection(lines, colors=layer.hex, linewidths=points, capstyle=cap))
    corner = MARGIN_PX / wide, 0.0
    figure.legend(handles=keys, loc="lower left", bbox_to_anchor=corner, ncols=across, fontsize=14, frameon=False)
    binary = io.BytesIO()
    # Without the version of matplotlib.
    figure.savefig(binary, format="png", metadata={"Software": None})
    return binary.getvalue()


def _picture_points(shape: Shape) -> list[Point]:
    """Return the points of the shape's line; a closed line ends at its start, a circle is a polygon."""
    if isinstance(shape, Circle):
        return on_circle(shape.radius_mm, (2 * math.pi * k / FACETS for k in range(FACETS + 1)), shape.center_mm)
    return [*shape.points_mm, *shape.points_mm[: shape.closed]]


# Writers of a sheet's file, by its ending.
WRITERS = {"svg": svg, "dxf": dxf, "lbrn2": lbrn}
