"""Instructions for cutting a film on a machine: a page about the sheets, and a calibration coupon.

The coupon determines the fold dashes, slot clearance and kerf of a film and a machine. "folds" is a comb of tongues with
dashes of the labelled lengths of cut and bridge: fold each, and choose the one that bends cleanly and does not tear.
"slots" fits the 10 mm tongue: the tab clearance is the smallest whose slot accepts the tongue without bulging. "kerf":
if the kerf is right, the 20 mm square fills its window without play, and the bar is 100.0 mm long.
"""

from typing import NamedTuple

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
# Height of the bar, and of the backs of comb and tongue, in which a label has room (mm).
BACK_MM = 8.0
# Side of the square that fits its window, the film around the window, and the film for the label above it (mm).
SQUARE_MM = 20.0
FRAME_MM = 5.0
WINDOW_LABEL_MM = 9.0
# Height of the tongue over its back, and that of the comb's tongues (mm).
TONGUE_LENGTH_MM = 12.0
COMB_LENGTH_MM = 16.0
# Film between two tongues of the comb, and between two slots (mm).
COMB_GAP_MM = 2.0
SLOT_GAP_MM = 5.0
# Heights over a fold of the comb at which its cut and its bridge are written (mm).
CUT_LABEL_MM, BRIDGE_LABEL_MM = 10.5, 6.0
# Height of the piece with slots, and in it those of its label, of the slots and of the clearances (mm).
SLOTS_HEIGHT_MM = 16.0
SLOTS_LABEL_MM, SLOTS_FROM_MM, CLEARANCES_LABEL_MM = 1.5, 7.0, 10.5


class CouponPiece(NamedTuple):
    """A test piece of the coupon, with the marks on it."""

    flat: FlatPiece
    marks: list[Shape]


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
        # The page calls this function to get the corners of what is drawn on a sheet.
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
    bar = CouponPiece(
        _piece("bar", box(0, 0, REFERENCE_MM, BACK_MM)),
        _text(f"{REFERENCE_MM:g} mm", REFERENCE_MM / 2, _centred_y(0, BACK_MM)),
    )
    square = CouponPiece(
        _piece("square", box(0, 0, SQUARE_MM, SQUARE_MM)),
        _text(f"{SQUARE_MM:g} mm", SQUARE_MM / 2, _centred_y(0, SQUARE_MM)),
    )
    rows = [[bar], [_slots(parts), square], [_folds(options), _tongue()], [_window()]]
    margin = options.margin_mm
    lines = wrapped([f"Coupon: {parts.film.title}, {options.machine}, kerf {options.kerf_mm:g} mm, {BAR}"])
    # The title, at the lower left corner of the sheet, where the origin is.
    to_title = Motion(0, (margin, margin))
    groups: list[tuple[Shape, ...]] = [tuple(shape.moved(to_title) for shape in title_shapes(lines))]
    _, title_height = title_size_mm(len(lines))
    # Each row stands above the one before, and in a row the pieces stand beside each other. Between two pieces are the
    # gap and a kerf, because cuts lie half a kerf outside of the pieces.
    y, right = margin + title_height + options.gap_mm, margin
    for row in rows:
        x, top_of_row = margin + options.kerf_mm, y
        for flat, marks in row:
            to_place = Motion(0, (x, y))
            shapes = (*marks, *cut_shapes(flat, options.kerf_mm))
            groups.append(tuple(shape.moved(to_place) for shape in shapes))
            _, _, width, height = flat.outline.bounds
            right = max(right, x + width)
            top_of_row = max(top_of_row, y + height)
            x += width + options.gap_mm + options.kerf_mm
        y = top_of_row + options.gap_mm + options.kerf_mm
    # The coupon must fit on a sheet. The sheet is turned if the coupon is wider than it.
    occupied = Polygon(box(margin, margin, right, y).exterior)
    if not fits((right - margin, y - margin), options.sheet_size_mm, margin):
        large = too_large_message("calibration coupon", occupied, options.sheet_size_mm, margin)
        suggestion = suggest_sheet(lambda other: all_fit([occupied], other), [occupied], options)
        raise NestingError(f"{large}; {suggestion}")
    sheet_width, sheet_height = options.sheet_size_mm
    if right + margin > sheet_width:
        sheet_width, sheet_height = sheet_height, sheet_width
    rounded_groups = tuple(tuple(rounded(group)) for group in groups)
    return Sheet("coupon", sheet_width, sheet_height, rounded_groups, options.dashed)


def _tongue() -> CouponPiece:
    """Return the test piece with a tongue. You push it into the slots of another test piece to choose their clearance.

    Both are parts of the *coupon*, a sheet that is cut before the car. The tongue stands on the middle of a rectangular
    back that is three times as wide. A slot is as long as the tongue is wide, plus the slot's clearance.
    """
    width = 3 * TONGUE_MM
    left, right = TONGUE_MM, 2 * TONGUE_MM
    top = BACK_MM + TONGUE_LENGTH_MM
    back = [(0, 0), (width, 0), (width, BACK_MM)]
    tongue = [(right, BACK_MM), (right, top), (left, top), (left, BACK_MM)]
    outline = Polygon([*back, *tongue, (0, BACK_MM)])
    label = _text(f"{TONGUE_MM:g} mm", width / 2, _centred_y(0, BACK_MM))
    return CouponPiece(_piece("tongue", outline), label)


def _window() -> CouponPiece:
    """Return the window that the square fills, in a frame with a label above."""
    end, width = FRAME_MM + SQUARE_MM, SQUARE_MM + 2 * FRAME_MM
    top = end + WINDOW_LABEL_MM
    outline = Polygon(box(0, 0, width, top).exterior, [box(FRAME_MM, FRAME_MM, end, end).exterior])
    return CouponPiece(_piece("window", outline), _text("kerf", width / 2, _centred_y(end, top)))


def _piece(label: str, outline: Polygon) -> FlatPiece:
    return FlatPiece(label, label, outline, (), (), (), ())


def _text(text: str, x: float, y: float, height: float = TEXT_MM) -> list[Shape]:
    """Return the strokes of a text centred at x with its base line at y."""
    strokes, width = text_strokes(text, height)
    return [Path("LABEL", tuple((x - width / 2 + u, y + v) for u, v in stroke)) for stroke in strokes]


def _centred_y(low: float, high: float) -> float:
    """Return the base line of a text that is centred between two heights."""
    return (low + high - TEXT_MM) / 2


def _folds(options: Options) -> CouponPiece:
    """Return the coupon's comb, with which you choose how folds are cut.

    It has several tongues with a fold at the base of each. A fold is a line of dashes. The lengths of its cuts and of the
    bridges between them differ from tongue to tongue, and are written on the tongue.
    """
    # The tongues stand side by side on a back, with half a gap on both sides of each.
    step = TONGUE_MM + COMB_GAP_MM
    width, top = len(DASHES_MM) * step, BACK_MM + COMB_LENGTH_MM
    # The outline, counter-clockwise from the lower left corner, so the tongues follow each other from right to left.
    points: list[Point] = [(0.0, 0.0), (width, 0.0), (width, BACK_MM)]
    marks = _text("folds", width / 2, _centred_y(0, BACK_MM))
    for number, (cut_mm, bridge_mm) in reversed(list(enumerate(DASHES_MM))):
        left = number * step + COMB_GAP_MM / 2
        right = (number + 1) * step - COMB_GAP_MM / 2
        points += [(right, BACK_MM), (right, top), (left, top), (left, BACK_MM)]
        for cut in dashes((left, BACK_MM), (right, BACK_MM), cut_mm, bridge_mm, options.kerf_mm):
            marks.append(Path("FOLD_VALLEY", cut))
        middle = (left + right) / 2
        marks += _text(f"{cut_mm:g}", middle, BACK_MM + CUT_LABEL_MM)
        marks += _text(f"{bridge_mm:g}", middle, BACK_MM + BRIDGE_LABEL_MM)
    points.append((0.0, BACK_MM))
    return CouponPiece(_piece("folds", Polygon(points)), marks)


def _slots(parts: Catalogue) -> CouponPiece:
    """Return the coupon's piece with slots of several lengths, into which you push the coupon's tongue.

    The length of a slot is the width of the tongue plus a clearance. The clearance is written above the slot. The slots
    are as wide as those of the car.
    """
    # The slots lie side by side. This is the distance of their middles.
    step = TONGUE_MM + SLOT_GAP_MM
    width = len(CLEARANCES_MM) * step
    outline = box(0, 0, width, SLOTS_HEIGHT_MM)
    slot_width = parts.film.thickness_mm.value + parts.assembly.slot_clearance_mm.value
    holes = []
    marks = _text("slots", width / 2, SLOTS_LABEL_MM)
    for number, clearance in enumerate(CLEARANCES_MM):
        middle = (number + 0.5) * step
        half_length = (TONGUE_MM + clearance) / 2
        slot = box(middle - half_length, SLOTS_FROM_MM, middle + half_length, SLOTS_FROM_MM + slot_width)
        holes.append(slot.exterior)
        marks += _text(f"+{clearance:g}", middle, CLEARANCES_LABEL_MM)
    return CouponPiece(_piece("slots", Polygon(outline.exterior, holes)), marks)
