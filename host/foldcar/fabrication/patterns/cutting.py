"""Instructions for cutting a film on a machine: a page about the sheets, and a calibration coupon.

The coupon determines the fold dashes, slot clearance and kerf of a film and a machine. "folds" is a comb of tongues with
dashes of the labelled lengths of cut and bridge: fold each, and choose the one that bends cleanly and does not tear.
"slots" fits the 10 mm tongue: the tab clearance is the smallest whose slot accepts the tongue without bulging. "kerf":
if the kerf is right, the 20 mm square fills its window without play, and the bar is 100.0 mm long.
"""

from shapely.geometry import Polygon, box

from foldcar.car.parts.catalogue import Catalogue
from foldcar.fabrication.patterns.drawing import LAYERS, Motion, Path, Point, Shape, Sheet, bounds
from foldcar.fabrication.patterns.flat_piece import FlatPiece
from foldcar.fabrication.patterns.labels import text_strokes
from foldcar.fabrication.patterns.nesting import NestingError
from foldcar.fabrication.patterns.options import MACHINES, Options
from foldcar.fabrication.patterns.piece_shapes import cut_shapes, dashes
from foldcar.fabrication.patterns.sheet_fit import all_fit, fits, suggest_sheet, too_large_message
from foldcar.fabrication.patterns.sheets import BAR, REFERENCE_MM, Pattern, rounded, title_shapes, title_size_mm, wrapped
from foldcar.figures.page import page_template

MEANINGS = {
    "LABEL": "names, numbers, reference bar",
    "QR_CODE": "the command that made the sheet",
    "SCORE": "line to lay another part against",
    "FOLD_MOUNTAIN": "fold away from the printed side",
    "FOLD_VALLEY": "fold towards the printed side",
    "CUT_INNER": "openings, screw holes, slots",
    "CUT_OUTER": "outlines",
}
# Cut and bridge lengths to choose from.
DASHES_MM = ((1.0, 1.0), (1.5, 1.0), (2.0, 1.0), (1.5, 0.6), (2.5, 0.8), (4.0, 1.0))
CLEARANCES_MM = (0.0, 0.2, 0.3, 0.5, 0.8)
TONGUE_MM = 10.0
TEXT_MM = 2.0


def how_to_cut(made: Pattern, command: str) -> str:
    """Return the page how_to_cut.md for the sheets, in Markdown."""
    options = made.options
    used = {shape.layer for sheet in made.sheets for shape in sheet.shapes}
    return page_template("foldcar.fabrication.patterns", "how_to_cut.md").render(
        made=made,
        command=command,
        chosen=options,
        machine=MACHINES[options.machine],
        bar_mm=REFERENCE_MM,
        bounds=bounds,
        layers=[layer for layer in LAYERS.values() if layer.name in used],
        meanings=MEANINGS,
        drawn={"CONTINUOUS": "", "DASHED": ", dashed", "DASHDOT": ", dash-dotted"},
        scored=options.fold == "score" and options.machine != "scissors",
    )


def coupon(options: Options, parts: Catalogue) -> Sheet:
    """Return the sheet with the coupon for a car with these parts: rows of test pieces under a title.

    Raises NestingError if it does not fit on a sheet.
    """
    window = Polygon(box(0, 0, 30, 34).exterior, [box(5, 5, 25, 25).exterior])
    # The tongue is as wide as a slot without clearance is long.
    tongue = Polygon([(0, 0), (30, 0), (30, 8), (20, 8), (20, 20), (10, 20), (10, 8), (0, 8)])
    # Each test piece with its marks.
    rows = [
        [(_piece("bar", box(0, 0, 100, 8)), _text("100 mm", 50, 3))],
        [_slots(parts), (_piece("square", box(0, 0, 20, 20)), _text("20 mm", 10, 9))],
        [_folds(options), (_piece("tongue", tongue), _text("10 mm", 15, 3.0))],
        [(_piece("window", window), _text("kerf", 15, 28.5))],
    ]
    margin = options.margin_mm
    lines = wrapped([f"Coupon: {parts.film.title}, {options.machine}, kerf {options.kerf_mm:g} mm, {BAR}"])
    groups: list[tuple[Shape, ...]] = [tuple(shape.moved(Motion(0, (margin, margin))) for shape in title_shapes(lines))]
    _, title_height = title_size_mm(len(lines))
    y, right = margin + title_height + options.gap_mm, margin
    for row in rows:
        x, top = margin + options.kerf_mm, y
        for flat, marks in row:
            motion = Motion(0, (x, y))
            groups.append(tuple(shape.moved(motion) for shape in (*marks, *cut_shapes(flat, options.kerf_mm))))
            _, _, width, height = flat.outline.bounds
            top = max(top, y + height)
            right = max(right, x + width)
            x += width + options.gap_mm + options.kerf_mm
        y = top + options.gap_mm + options.kerf_mm
    occupied = Polygon(box(margin, margin, right, y).exterior)
    if not fits((right - margin, y - margin), options.sheet_size_mm, margin):
        large = too_large_message("calibration coupon", occupied, options.sheet_size_mm, margin)
        raise NestingError(f"{large}; {suggest_sheet(lambda other: all_fit([occupied], other), [occupied], options)}")
    # The sheet is turned if the coupon is wider than the sheet.
    size = options.sheet_size_mm if right + margin <= options.sheet_size_mm[0] else options.sheet_size_mm[::-1]
    return Sheet("coupon", *size, tuple(tuple(rounded(group)) for group in groups), options.dashed)


def _piece(label: str, outline: Polygon) -> FlatPiece:
    return FlatPiece(label, label, outline, (), (), (), ())


def _text(text: str, x: float, y: float, height: float = TEXT_MM) -> list[Shape]:
    """Return the strokes of a text centred at x with its base line at y."""
    strokes, width = text_strokes(text, height)
    return [Path("LABEL", tuple((x - width / 2 + u, y + v) for u, v in stroke)) for stroke in strokes]


def _folds(options: Options) -> tuple[FlatPiece, list[Shape]]:
    """Return the coupon's comb and its marks: tongues of 10 x 16 mm, at their bases folds with dashes to choose from."""
    pitch, base_y, height = TONGUE_MM + 2, 8.0, 16.0
    points: list[Point] = [(0.0, 0.0), (len(DASHES_MM) * pitch, 0.0)]
    marks = _text("folds", len(DASHES_MM) * pitch / 2, 3.0)
    for i, (cut_mm, bridge_mm) in reversed(list(enumerate(DASHES_MM))):
        left, right = i * pitch + 1, (i + 1) * pitch - 1
        points += [(right, base_y), (right, base_y + height), (left, base_y + height), (left, base_y)]
        cuts = dashes((left, base_y), (right, base_y), cut_mm, bridge_mm, options.kerf_mm)
        marks += [Path("FOLD_VALLEY", cut) for cut in cuts]
        marks += _text(f"{cut_mm:g}", (left + right) / 2, base_y + 10.5)
        marks += _text(f"{bridge_mm:g}", (left + right) / 2, base_y + 6.0)
    # The corners of the comb's back beside the tongues, which run from right to left.
    points += [(0.0, base_y)]
    points[2:2] = [(len(DASHES_MM) * pitch, base_y)]
    return _piece("folds", Polygon(points)), marks


def _slots(parts: Catalogue) -> tuple[FlatPiece, list[Shape]]:
    """Return the coupon's piece with slots and its marks: slots as wide as the car's, with the labelled clearances."""
    pitch = TONGUE_MM + 5
    outline = box(0, 0, len(CLEARANCES_MM) * pitch, 16)
    slot_width = parts.film.thickness_mm.value + parts.assembly.slot_clearance_mm.value
    holes = []
    marks = _text("slots", len(CLEARANCES_MM) * pitch / 2, 1.5)
    for i, clearance in enumerate(CLEARANCES_MM):
        middle, half = (i + 0.5) * pitch, (TONGUE_MM + clearance) / 2
        holes.append(box(middle - half, 7, middle + half, 7 + slot_width).exterior)
        marks += _text(f"+{clearance:g}", middle, 10.5)
    return _piece("slots", Polygon(outline.exterior, holes)), marks
