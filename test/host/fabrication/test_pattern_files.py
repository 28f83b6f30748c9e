"""Written sheets, their order of cuts and their picture: true scale, layers and colours for independent readers."""

import io
import itertools
import math
import re
from dataclasses import replace
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pytest
import segno
import svgelements
from matplotlib.image import imread
from numpy.typing import NDArray
from pypdf import PdfReader
from shapely.geometry import LineString, box

from cut_samples import folded_box
from foldcar.car.parts.catalogue import catalogue
from foldcar.fabrication.patterns import nesting
from foldcar.fabrication.patterns.cutting import coupon
from foldcar.fabrication.patterns.drawing import LAYERS, Circle, LayerName, Path, Shape, Sheet, bounds
from foldcar.fabrication.patterns.options import options
from foldcar.fabrication.patterns.sheet_files import SHEET_PX, WRITERS, dxf, preview, svg
from foldcar.fabrication.patterns.sheets import pattern
from sheet_reader import READERS, check_pdf, check_same, check_sheet, check_text, read_dxf, read_pdf, read_svg
from written_sheet import CHOSEN, COMMAND, Made, written_sample

# RGB by number, as its documentation lists them.
LIGHTBURN = {
    "C00": (0, 0, 0), "C01": (0, 0, 255), "C02": (255, 0, 0), "C05": (255, 128, 0), "C11": (0, 160, 0),
    "C15": (160, 0, 160), "C16": (128, 128, 128),
}  # fmt: skip


@pytest.fixture(scope="module")
def made() -> Made:
    return written_sample()


@pytest.fixture(scope="module")
def sheets(made: Made) -> dict[str, Sheet]:
    """What is read back, by ending."""
    return {ending: read(made.texts[ending]) for ending, read in READERS.items()} | {"pdf": read_pdf(made.pdf)[1]}


def test_written_files_have_no_findings_and_a_reference_bar_of_100_mm(made: Made, sheets: dict[str, Sheet]) -> None:
    assert check_sheet(made.sheet, CHOSEN.margin_mm) == []
    for ending, sheet in sheets.items():
        assert check_same(made.sheet, sheet) == [], ending
        long = [s.length_mm for s in sheet.shapes if isinstance(s, Path) and s.layer == "LABEL" and s.length_mm > 90]
        assert long == [pytest.approx(100.0, abs=1e-3)]
    assert check_pdf([made.sheet, made.sheet], made.pdf) == []
    sizes = [(float(page.mediabox.width), float(page.mediabox.height)) for page in PdfReader(io.BytesIO(made.pdf)).pages]
    assert sizes == 2 * [(pytest.approx(300 / 25.4 * 72, abs=1e-3), pytest.approx(200 / 25.4 * 72, abs=1e-3))]


@pytest.mark.parametrize(
    ("ending", "part", "other", "finding"),
    [
        ("svg", r'(?s)(id="CUT_OUTER".*?)<path d="M[^"]*z"/>', r"\1", "a line on CUT_OUTER .* is missing"),
        ("svg", 'width="300mm" height="200mm"', 'width="300" height="200"', "not given in mm"),
        ("svg", '<circle cx="', '<circle cx="1', "CUT_INNER"),
        ("dxf", r"\$INSUNITS\n 70\n4", "$INSUNITS\n 70\n1", r"\$INSUNITS is 1"),
        ("lbrn2", "<VertList>V", "<VertList>V1", "is missing"),
        ("lbrn2", '<name Value="CUT_INNER" />', '<name Value="CUT_OUTER" />', "not cut in their order"),
    ],
)
def test_the_reader_finds_damage(made: Made, ending: str, part: str, other: str, finding: str) -> None:
    damaged = re.sub(part, other, made.texts[ending], count=1)

    assert damaged != made.texts[ending]
    assert re.search(finding, "\n".join(check_text(READERS[ending], made.sheet, damaged, CHOSEN)))


def test_the_reader_finds_pages_that_are_missing_or_not_meant(made: Made) -> None:
    assert check_pdf([made.sheet], made.pdf) == ["has 2 pages, should have 1"]
    other = replace(made.sheet, groups=made.sheet.groups[1:])
    assert "page 1: a line on LABEL" in check_pdf([other, other], made.pdf)[0]


def test_an_independent_reader_of_svg_sees_the_same_points(made: Made) -> None:
    seen = set()
    for element in svgelements.SVG.parse(io.StringIO(made.texts["svg"]), ppi=25.4).elements():
        if isinstance(element, svgelements.Circle):
            seen.add((round(element.cx, 3), round(made.sheet.height_mm - element.cy, 3)))
        elif isinstance(element, svgelements.Path):
            ends = [segment.end for segment in element if segment.end is not None]
            seen |= {(round(end.x, 3), round(made.sheet.height_mm - end.y, 3)) for end in ends}

    points = [shape.points_mm if isinstance(shape, Path) else [shape.center_mm] for shape in made.sheet.shapes]
    meant = {(round(x, 3), round(y, 3)) for point in points for x, y in point}
    assert len(meant) > 100 and meant == seen


def test_layers_have_their_names_colours_and_widths_in_every_file(made: Made) -> None:
    document = ezdxf.read(io.StringIO(made.texts["dxf"]))

    assert (document.dxfversion, document.header["$INSUNITS"]) == ("AC1024", 4)
    assert document.audit().errors == []
    drawn_mm = bounds(made.sheet.shapes)
    assert (*document.header["$EXTMIN"][:2], *document.header["$EXTMAX"][:2]) == pytest.approx(drawn_mm, abs=1e-3)
    for layer in LAYERS.values():
        drawn = document.layers.get(layer.name)
        rgb = None if layer.name == "CUT_OUTER" else layer.rgb
        assert (drawn.color, drawn.rgb, drawn.dxf.lineweight) == (layer.aci, rgb, round(100 * layer.width_mm))
        group = re.search(rf'<g id="{layer.name}" inkscape:groupmode="layer"[^>]*>', made.texts["svg"])
        assert group and f'stroke="{layer.hex}" stroke-width="{layer.width_mm:g}"' in group[0]
        assert ('stroke-linecap="butt"' in group[0]) == (layer.name == "QR_CODE")
    # The lines of the code are as wide as its modules.
    codes = document.modelspace().query("LWPOLYLINE[layer=='QR_CODE']")
    assert {line.dxf.const_width for line in codes} == {LAYERS["QR_CODE"].width_mm}


def test_colours_are_layers_of_lightburn() -> None:
    assert {layer.lightburn: layer.rgb for layer in LAYERS.values()} == LIGHTBURN


def test_the_code_says_the_command(sheets: dict[str, Sheet]) -> None:
    shapes = sheets["pdf"].shapes
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


def test_folds_that_no_machine_cuts_are_dashed_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nesting, "MAX_TRIES", 0)
    chosen = options("scissors")
    sheet = pattern(folded_box(30.0), chosen, "sample").sheets[0]
    drawn, written = svg(sheet), dxf(sheet)
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
    assert check_same(sheet, read_svg(drawn)) == []


def test_a_sheet_that_a_cutter_cannot_cut_is_found(made: Made) -> None:
    (first, *others) = made.sheet.groups
    outline = next(s for s in first if isinstance(s, Path) and s.layer == "CUT_OUTER")

    def with_more(*shapes: Path | Circle) -> Sheet:
        return replace(made.sheet, groups=((*first, *shapes), *others))

    assert "lines on each other" in check_sheet(with_more(Path("CUT_INNER", outline.points_mm[:2])), 5.0)[0]
    assert "is not closed" in check_sheet(with_more(Path("CUT_OUTER", ((50, 50), (60, 60)))), 5.0)[0]
    assert "no length" in check_sheet(with_more(Path("SCORE", ((50, 50), (50, 50)))), 5.0)[0]
    assert "leave the usable part" in check_sheet(with_more(Circle("CUT_INNER", (298, 100), 4)), 5.0)[0]


@pytest.mark.parametrize("machine", ["laser", "scissors"])
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


def test_a_lightburn_project_has_named_layers_in_the_order_of_cutting(made: Made) -> None:
    root = ElementTree.fromstring(made.texts["lbrn2"])
    settings = sorted(
        ({key.tag: key.attrib["Value"] for key in setting} for setting in root.iter("CutSetting")),
        key=lambda setting: int(setting["priority"]),
    )
    assert [setting["name"] for setting in settings] == [*LAYERS, "T1"]
    assert [f"C{int(setting['index']):02}" for setting in settings[:-1]] == [layer.lightburn for layer in LAYERS.values()]
    assert [setting["name"] for setting in settings if setting.get("doOutput") == "0"] == ["QR_CODE"]


def square(layer: LayerName, x: float, y: float, side: float) -> Path:
    return Path(layer, ((x, y), (x + side, y), (x + side, y + side), (x, y + side)), closed=True)


def mixed_sheet() -> Sheet:
    """Nine pieces in a mixed order: a small, a larger opening in each, a large piece first."""
    places = [(2, 2), (0, 1), (1, 1), (2, 0), (0, 0), (1, 2), (0, 2), (2, 1), (1, 0)]
    groups = []
    for column, row in places:
        x, y = 50.0 * column, 50.0 * row
        side = 40.0 if (column + row) % 2 == 0 else 15.0
        openings = square("CUT_INNER", x + 5, y + 4, 9.0), square("CUT_INNER", x + 1, y + 1, 1.0)
        groups.append((square("CUT_OUTER", x, y, side), *openings))
    return Sheet("sheet_1", 150.0, 150.0, tuple(groups))


@pytest.mark.parametrize("ending", WRITERS)
def test_files_have_openings_before_outlines_small_before_large_near_to_near(ending: str) -> None:
    shapes = READERS[ending](WRITERS[ending](mixed_sheet())).shapes

    assert [shape.layer for shape in shapes] == ["CUT_INNER"] * 18 + ["CUT_OUTER"] * 9
    for layer in ("CUT_INNER", "CUT_OUTER"):
        cuts = [shape for shape in shapes if shape.layer == layer]
        sizes = [round(shape.length_mm, 3) for shape in cuts]
        assert sizes == sorted(sizes)
        place = (0.0, 0.0)
        for _, same in itertools.groupby(cuts, key=lambda shape: round(shape.length_mm, 3)):
            left = [shape.points_mm[0] for shape in same]
            while left:
                ways = [math.dist(place, start) for start in left]
                # The one that is cut now is as near as any that is left.
                assert ways[0] == pytest.approx(min(ways), abs=1e-6)
                place = left.pop(0)


SQUARE = ((20.0, 20.0), (80.0, 20.0), (80.0, 80.0), (20.0, 80.0))


def square_sheet(number: int, hole: LayerName) -> Sheet:
    shapes: tuple[Shape, ...] = (Path("CUT_OUTER", SQUARE, closed=True), Circle(hole, (40.0, 60.0), 10.0))
    return Sheet(f"sheet_{number}", 100.0, 100.0, (shapes,), film="PET film, $0.25$ mm")


def pixels(png: bytes) -> NDArray[np.int_]:
    """(rows, columns, 3): red, green and blue from 0 to 255."""
    return np.round(255 * imread(io.BytesIO(png), format="png")[:, :, :3]).astype(int)


def test_every_sheet_is_shown_once_to_one_scale_in_the_layers_colours() -> None:
    holes: tuple[LayerName, ...] = ("CUT_INNER", "SCORE", "CUT_INNER")
    shown = pixels(preview([square_sheet(i, hole) for i, hole in enumerate(holes, 1)], "庭 car of $50 & $_^$"))
    side = 0.6 * SHEET_PX
    dark = (shown < 100).all(axis=2)

    # Of each square's lower and upper edge, one row at least is dark over the whole length.
    edges = set()
    for row, line in enumerate(dark):
        start = 0
        for black, run in itertools.groupby(line.tolist()):
            length = len(list(run))
            if black and abs(length - side) < 5:
                edges.add((row // 10, round(start, -1)))
            start += length
    corners = {(round(10 * row / side, 1), left) for row, left in edges}
    assert len({left for _, left in corners}) == 2
    assert len({(round(row), left) for row, left in corners}) == 6
    # Circles of a radius of 10 of 100 mm, in lines of a pixel and more: green ones on two sheets, an orange one on one.
    red, green, blue = np.moveaxis(shown, 2, 0)
    circle = 2 * np.pi * 0.1 * SHEET_PX
    assert 2 * circle < ((green > red + 50) & (green > blue + 50)).sum() < 6 * circle
    assert circle < ((red > green + 30) & (green > blue + 30)).sum() < 4 * circle
    # No layer that these sheets lack is in the legend.
    assert not (blue > red + 50).any()
