"""Writes a sheet as DXF R2010 in millimetres."""

import io
import itertools

from ezdxf import colors, units
from ezdxf._options import options
from ezdxf.filemanagement import new

from foldcar.fabrication.patterns.drawing import LAYERS, Circle, Sheet


def dxf(sheet: Sheet) -> str:
    """The file's text: LWPOLYLINEs and CIRCLEs on named layers, $INSUNITS 4, the sheet's limits set."""
    # Fixed dates and ids, so that the same sheet gives the same bytes.
    fixed = options.write_fixed_meta_data_for_testing
    options.write_fixed_meta_data_for_testing = True
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
        space.reset_extents((0, 0, 0), (sheet.width_mm, sheet.height_mm, 0))
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
        options.write_fixed_meta_data_for_testing = fixed
