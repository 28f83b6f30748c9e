"""Written SVG, DXF and PDF files: true scale, layers and colours for independent readers."""

import io
import math
import re
from dataclasses import replace
from xml.etree import ElementTree

import ezdxf
import pytest
import segno
import svgelements
from ezdxf.addons.drawing import RenderContext
from pypdf import PdfReader
from shapely.geometry import LineString, box
from shapely.ops import linemerge, unary_union

from cut_samples import folded_box
from foldcar.car.parts.catalogue import catalogue
from foldcar.fabrication.patterns.cutting import coupon
from foldcar.fabrication.patterns.drawing import LAYERS, Circle, Motion, Path, Sheet, bounds
from foldcar.fabrication.patterns.dxf import dxf, read_dxf
from foldcar.fabrication.patterns.lbrn import lbrn, read_lbrn
from foldcar.fabrication.patterns.options import options
from foldcar.fabrication.patterns.pdf import pdf, read_pdf
from foldcar.fabrication.patterns.sheets import pattern
from foldcar.fabrication.patterns.svg import read_svg, svg
from foldcar.fabrication.patterns.verify import check_pdf, check_sheet, check_text
from written_sheet import CHOSEN, COMMAND, Made, written_sample

# RGB by number, as its documentation lists them.
LIGHTBURN = {
    "C00": (0, 0, 0), "C01": (0, 0, 255), "C02": (255, 0, 0), "C05": (255, 128, 0), "C11": (0, 160, 0),
    "C15": (160, 0, 160), "C16": (128, 128, 128),
}  # fmt: skip


@pytest.fixture(scope="module")
def made() -> Made:
    return written_sample()


def test_written_files_have_no_findings(made: Made) -> None:
    assert check_sheet(made.sheet, CHOSEN.margin_mm) == []
    assert check_text(read_svg, made.sheet, made.svg, CHOSEN) == []
    assert check_text(read_dxf, made.sheet, made.dxf, CHOSEN) == []
    assert check_pdf([made.sheet, made.sheet], made.pdf) == []


def test_an_independent_reader_of_svg_sees_the_same_points(made: Made) -> None:
    def ours(shape: Path | Circle) -> list[tuple[float, float]]:
        return list(shape.points_mm) if isinstance(shape, Path) else [shape.center_mm]

    seen = set()
    for element in svgelements.SVG.parse(io.StringIO(made.svg), ppi=25.4).elements():
        if isinstance(element, svgelements.Circle):
            seen.add((round(element.cx, 3), round(made.sheet.height_mm - element.cy, 3)))
        elif isinstance(element, svgelements.Path):
            ends = [segment.end for segment in element if segment.end is not None]
            seen |= {(round(end.x, 3), round(made.sheet.height_mm - end.y, 3)) for end in ends}

    found = {(round(x, 3), round(y, 3)) for shape in read_svg(made.svg).shapes for x, y in ours(shape)}
    assert len(found) > 100 and found == seen


def reference_bars(sheet: Sheet) -> list[float]:
    """Lengths of the straight label lines of more than 90 mm."""
    return [s.length_mm for s in sheet.shapes if isinstance(s, Path) and s.layer == "LABEL" and s.length_mm > 90]


def test_the_reference_bar_is_100_mm_in_every_format(made: Made) -> None:
    assert reference_bars(read_svg(made.svg)) == [pytest.approx(100.0, abs=1e-3)]
    assert reference_bars(read_dxf(made.dxf)) == [pytest.approx(100.0, abs=1e-3)]
    assert [reference_bars(page) for page in read_pdf(made.pdf)] == 2 * [[pytest.approx(100.0, abs=1e-3)]]


def test_layers_have_their_names_colours_and_widths_in_every_file(made: Made) -> None:
    document = ezdxf.read(io.StringIO(made.dxf))

    assert (document.dxfversion, document.header["$INSUNITS"]) == ("AC1024", 4)
    assert document.audit().errors == []
    for layer in LAYERS.values():
        drawn = document.layers.get(layer.name)
        rgb = None if layer.name == "CUT_OUTER" else layer.rgb
        assert (drawn.color, drawn.rgb, drawn.dxf.lineweight) == (layer.aci, rgb, round(100 * layer.width_mm))
        group = re.search(rf'<g id="{layer.name}" inkscape:groupmode="layer"[^>]*>', made.svg)
        assert group and f'stroke="{layer.hex}" stroke-width="{layer.width_mm:g}"' in group[0]
        assert ('stroke-linecap="butt"' in group[0]) == (layer.name == "QR_CODE")
    # The lines of the code are as wide as its modules.
    codes = document.modelspace().query("LWPOLYLINE[layer=='QR_CODE']")
    assert {line.dxf.const_width for line in codes} == {LAYERS["QR_CODE"].width_mm}


def test_colours_are_layers_of_lightburn() -> None:
    assert {layer.lightburn: layer.rgb for layer in LAYERS.values()} == LIGHTBURN


@pytest.mark.parametrize("form", ["svg", "dxf", "pdf"])
def test_the_code_says_the_command(made: Made, form: str) -> None:
    readers = {"svg": lambda: read_svg(made.svg), "dxf": lambda: read_dxf(made.dxf), "pdf": lambda: read_pdf(made.pdf)[0]}
    shapes = readers[form]().shapes
    lines = [s for s in shapes if isinstance(s, Path) and s.layer == "QR_CODE"]
    left, low, right, top = bounds(lines)
    module = LAYERS["QR_CODE"].width_mm
    matrix = [[bool(module) for module in row] for row in segno.make(COMMAND, error="l", micro=False).matrix]
    seen = [[False] * len(matrix) for _ in matrix]
    for line in lines:
        (x0, y), (x1, _) = line.points_mm
        for column in range(round((x0 - left) / module), round((x1 - left) / module)):
            seen[round((top - y) / module)][column] = True

    assert module >= 0.5
    assert seen == matrix
    quiet = box(left, low, right, top).buffer(4 * module - module / 2 - 0.01, join_style="mitre")
    others = [LineString(s.points_mm) for s in shapes if isinstance(s, Path) and s.layer != "QR_CODE"]
    assert not any(quiet.intersects(line) for line in others)


def test_folds_that_no_machine_cuts_are_dashed_lines() -> None:
    chosen = options("scissors")
    sheet = pattern(folded_box(30.0), chosen, "sample").sheets[0]
    drawn, written, printed = svg(sheet), dxf(sheet), pdf([sheet], "sample")
    document = ezdxf.read(io.StringIO(written))

    for name, kind in (("FOLD_MOUNTAIN", "DASHDOT"), ("FOLD_VALLEY", "DASHED"), ("CUT_OUTER", "CONTINUOUS")):
        assert document.layers.get(name).dxf.linetype.upper() == kind
        group = re.search(rf'<g id="{name}"[^>]*>', drawn)
        assert group and ("stroke-dasharray" in group[0]) == (kind != "CONTINUOUS")
    pattern_tags = document.linetypes.get("DASHED").pattern_tags
    assert pattern_tags.tags.get_first_value(40) == pytest.approx(sum(LAYERS["FOLD_VALLEY"].dashes_mm))
    # One line for a fold, whatever its look.
    folds = [s for s in read_dxf(written).shapes if s.layer == "FOLD_VALLEY"]
    assert max(s.length_mm for s in folds) > 100
    assert [*check_text(read_svg, sheet, drawn, chosen), *check_text(read_dxf, sheet, written, chosen)] == []
    assert check_pdf([sheet], printed) == []


@pytest.mark.parametrize("ground", ["#ffffff", "#212830", "#000000"])
def test_dxf_lines_are_seen_on_light_and_dark_grounds(made: Made, ground: str) -> None:
    """As a program draws them: AutoCAD's ground is dark, LibreCAD's black, a print's white."""
    document = ezdxf.read(io.StringIO(made.dxf))
    context = RenderContext(document)
    context.set_current_layout(document.modelspace())
    context.current_layout_properties.set_colors(ground)

    for entity in document.modelspace():
        # The ratio of luminances by WCAG 2; blue on black, the usual colour of valley folds, has 2.4.
        assert contrast(context.resolve_color(entity)[:7], ground) > 1.7, entity.dxf.layer
    (outline, *_) = document.modelspace().query('*[layer=="CUT_OUTER"]')
    assert contrast(context.resolve_color(outline)[:7], ground) > 10


def contrast(one: str, other: str) -> float:
    """The ratio of the luminances of two colours (#rrggbb), 1 to 21."""
    luminances = []
    for colour in (one, other):
        parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        r, g, b = (part / 12.92 if part <= 0.03928 else ((part + 0.055) / 1.055) ** 2.4 for part in parts)
        luminances.append(0.2126 * r + 0.7152 * g + 0.0722 * b)
    return (max(luminances) + 0.05) / (min(luminances) + 0.05)


def test_pages_of_a_pdf_are_as_large_as_their_sheets(made: Made) -> None:
    sizes = [(float(page.mediabox.width), float(page.mediabox.height)) for page in PdfReader(io.BytesIO(made.pdf)).pages]

    assert sizes == 2 * [(pytest.approx(300 / 25.4 * 72, abs=1e-3), pytest.approx(200 / 25.4 * 72, abs=1e-3))]


def test_a_sheet_that_a_cutter_cannot_cut_is_found(made: Made) -> None:
    (first, *others) = made.sheet.groups
    outline = next(s for s in first if isinstance(s, Path) and s.layer == "CUT_OUTER")

    def with_more(*shapes: Path | Circle) -> Sheet:
        return replace(made.sheet, groups=((*first, *shapes), *others))

    assert "lines on each other" in check_sheet(with_more(Path("CUT_INNER", outline.points_mm[:2])), 5.0)[0]
    assert "is not closed" in check_sheet(with_more(Path("CUT_OUTER", ((50, 50), (60, 60)))), 5.0)[0]
    assert "no length" in check_sheet(with_more(Path("SCORE", ((50, 50), (50, 50)))), 5.0)[0]
    assert "leave the usable part" in check_sheet(with_more(Circle("CUT_INNER", (298, 100), 4)), 5.0)[0]


@pytest.mark.parametrize("machine", ["silhouette", "cricut", "laser", "scissors"])
def test_the_coupon_holds_its_tests_within_a_corner_of_the_sheet(machine: str) -> None:
    chosen = options(machine)

    sheet = coupon(chosen, catalogue())

    assert check_sheet(sheet, chosen.margin_mm) == []
    outlines = [s for s in sheet.shapes if isinstance(s, Path) and s.layer == "CUT_OUTER"]
    sizes = sorted(round(max(b - a for a, b in _sides(outline)), 2) for outline in outlines)
    assert round(100 + chosen.kerf_mm, 2) in sizes
    assert len(outlines) == 6
    slots = [s for s in sheet.shapes if isinstance(s, Path) and s.layer == "CUT_INNER"]
    # A slot is as wide as the car's: 0.3 mm more than its film.
    narrow = [round(min(b - a for a, b in _sides(slot)) + chosen.kerf_mm, 2) for slot in slots]
    assert sorted(narrow) == [0.55] * 5 + [20.0]


def _sides(path: Path) -> list[tuple[float, float]]:
    x0, y0, x1, y1 = bounds([path])
    return [(x0, x1), (y0, y1)]


def test_quarter_turns_are_exact() -> None:
    assert [Motion(turn, (1, 1)).apply((2.0, 1.0)) for turn in range(4)] == [(3, 2), (0, 3), (-1, 0), (2, -1)]


def test_a_lightburn_project_has_named_layers_in_the_order_of_cutting_and_all_lines(made: Made) -> None:
    text = lbrn(made.sheet)

    root = ElementTree.fromstring(text)
    settings = sorted(
        ({key.tag: key.attrib["Value"] for key in setting} for setting in root.iter("CutSetting")),
        key=lambda setting: int(setting["priority"]),
    )
    assert [setting["name"] for setting in settings] == [*LAYERS, "T1"]
    assert [f"C{int(setting['index']):02}" for setting in settings[:-1]] == [layer.lightburn for layer in LAYERS.values()]
    assert [setting["name"] for setting in settings if setting.get("doOutput") == "0"] == ["QR_CODE"]
    assert check_text(read_lbrn, made.sheet, text, CHOSEN) == []
    assert reference_bars(read_lbrn(text)) == [pytest.approx(100.0, abs=1e-3)]


@pytest.mark.parametrize("width", [0.3, 2.0])
def test_holding_tabs_keep_each_piece_in_the_sheet_by_bridges_of_their_width(width: float) -> None:
    chosen = options("laser", sheet="300x200", holding_tabs_mm=width)

    made = pattern(folded_box(40.0), chosen, "sample")

    closed = pattern(folded_box(40.0), options("laser", sheet="300x200"), "sample")
    for held, plain in zip(made.sheets, closed.sheets, strict=True):
        assert check_text(read_svg, held, svg(held), chosen) == check_text(read_dxf, held, dxf(held), chosen) == []
        for group, whole in zip(held.groups, plain.groups, strict=True):
            cuts = [LineString(s.points_mm) for s in group if isinstance(s, Path) and s.layer == "CUT_OUTER"]
            rings = [s for s in whole if isinstance(s, Path) and s.layer == "CUT_OUTER"]
            if not rings:
                continue
            # What the beam, a kerf wide with round ends, leaves of the outline.
            outline = LineString([*rings[0].points_mm, rings[0].points_mm[0]])
            left = outline.difference(unary_union(cuts).buffer(chosen.kerf_mm / 2, quad_segs=32))
            bridges = [part.length for part in getattr(linemerge(left), "geoms", [linemerge(left)])]
            assert len(bridges) == len(cuts) >= 2
            assert bridges == [pytest.approx(width, abs=0.02 + 0.05 * width)] * len(bridges)


def test_an_outline_that_lost_a_holding_tab_is_found() -> None:
    chosen = options("laser", sheet="300x200", holding_tabs_mm=0.5)
    sheet = pattern(folded_box(40.0), chosen, "sample").sheets[0]
    index, group = next((i, g) for i, g in enumerate(sheet.groups) if any(s.layer == "CUT_OUTER" for s in g))
    cut = next(shape for shape in group if isinstance(shape, Path) and shape.layer == "CUT_OUTER")
    # A cut goes on by half of the bridge.
    (x0, y0), (x1, y1) = cut.points_mm[-2:]
    share = 0.3 / math.dist((x0, y0), (x1, y1))
    longer = replace(cut, points_mm=(*cut.points_mm[:-1], (x1 + share * (x1 - x0), y1 + share * (y1 - y0))))
    groups = (*sheet.groups[:index], tuple(longer if s is cut else s for s in group), *sheet.groups[index + 1 :])

    assert any("leaves no holding tab of 0.65 mm" in found for found in check_sheet(replace(sheet, groups=groups), 5.0))
    assert any("is not closed" in found for found in check_sheet(replace(sheet, tab_gap_mm=0.0), 5.0))
