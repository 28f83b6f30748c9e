"""Draws a folded car's pieces on sheets: flat, split to size, labelled, nested, with a reference bar and a title.

Input: a FoldedCar, Options, a title. Output: a Pattern. NestingError if a piece does not fit on a sheet.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from shapely.geometry import Polygon

from foldcar.car.folded.model import FoldedCar
from foldcar.fabrication.patterns.drawing import Path, Point, Shape, Sheet
from foldcar.fabrication.patterns.flat_piece import FlatPiece, flat_piece
from foldcar.fabrication.patterns.join_marks import join_marks
from foldcar.fabrication.patterns.layers import LAYERS
from foldcar.fabrication.patterns.nesting import nest
from foldcar.fabrication.patterns.options import Options
from foldcar.fabrication.patterns.piece_shapes import outer_cut, piece_shapes
from foldcar.fabrication.patterns.split_body import as_cut
from foldcar.fabrication.patterns.split_strip import split_to_fit
from foldcar.fabrication.patterns.stroke_font import text_strokes

# Length of the bar by which the scale of a cut or printed sheet is checked.
REFERENCE_MM = 100.0
TICK_MM = 3.0
TITLE_HEIGHT_MM = 2.5
# Size of the sheet's corner for bar and title.
CORNER_MM = (REFERENCE_MM + 2.0, 9.0)


@dataclass(frozen=True, slots=True)
class Pattern:
    """The flat pieces and sheets of one car, the options and warnings as texts."""

    title: str
    pieces: tuple[FlatPiece, ...]
    sheets: tuple[Sheet, ...]
    warnings: tuple[str, ...]
    options: Options

    @property
    def cut_length_mm(self) -> float:
        """Length of all cuts, with dashes, without scored folds and labels (mm)."""
        return sum(
            shape.length_mm
            for sheet in self.sheets
            for shape in sheet.shapes
            if LAYERS[shape.layer].cut or (LAYERS[shape.layer].fold and self.options.fold == "dash")
        )

    @property
    def film_area_mm2(self) -> float:
        """Area of all copies of the pieces, overlaps included (mm²)."""
        return sum(piece.area_mm2 * piece.count for piece in self.pieces)


@dataclass(frozen=True, slots=True)
class CutCar:
    """A car split to fit the sheets: ``car`` has pieces split along folds, ``pieces`` are flat, strips cut across."""

    car: FoldedCar
    pieces: tuple[FlatPiece, ...]

    @property
    def strips(self) -> dict[str, int]:
        """The number of parts of each strip that is cut across, by its piece's name."""
        return {name: count for name, count in Counter(piece.origin for piece in self.pieces).items() if count > 1}


def cut_car(folded: FoldedCar, chosen: Options) -> CutCar:
    """The car's pieces, split to fit the sheet as far as possible."""
    car = as_cut(folded, chosen)
    return CutCar(car, tuple(part for piece in car.pieces for part in split_to_fit(flat_piece(piece, chosen), chosen)))


def pattern(folded: FoldedCar, chosen: Options, title: str) -> Pattern:
    """The car's sheets; NestingError."""
    return pattern_of(cut_car(folded, chosen), chosen, title)


def pattern_of(cut: CutCar, chosen: Options, title: str) -> Pattern:
    """The sheets of a car whose pieces are split already; NestingError."""
    missing: dict[str, None] = {}

    def draw(index: int, turn: int) -> list[Shape]:
        piece = cut.pieces[index]
        shapes, unlabelled = piece_shapes(piece, chosen, join_marks(piece, cut.car.joins), turn)
        missing.update(dict.fromkeys(unlabelled))
        return shapes

    laid = [LaidPiece(piece.label, outer_cut(piece, chosen.kerf_mm), piece.count) for piece in cut.pieces]
    sheets, unmarked = lay_out(laid, draw, chosen, title)
    return Pattern(title, cut.pieces, sheets, (*missing, *unmarked), chosen)


@dataclass(frozen=True, slots=True)
class LaidPiece:
    """A piece to lay out: ``outline`` with the kerf (mm), ``count`` copies."""

    label: str
    outline: Polygon
    count: int


def lay_out(
    pieces: Sequence[LaidPiece], draw: Callable[[int, int], list[Shape]], chosen: Options, title: str
) -> tuple[tuple[Sheet, ...], list[str]]:
    """Pieces nested on sheets, and warnings about sheets without a reference bar. NestingError.

    ``draw(index, quarter_turns)`` returns a piece's shapes in its own frame, texts upright after the turns.
    """
    width, height = chosen.sheet_size_mm
    listed = [(piece.label, piece.outline, piece.count) for piece in pieces]
    nested = nest(listed, (width, height), chosen.margin_mm, chosen.gap_mm, CORNER_MM)
    on_sheets: list[list[Iterable[Shape]]] = [[] for _ in nested.reserved]
    drawn: dict[tuple[int, int], list[Shape]] = {}
    for index, copies in enumerate(nested.placements):
        for copy in copies:
            key = (index, copy.motion.quarter_turns)
            if key not in drawn:
                drawn[key] = draw(*key)
            on_sheets[copy.sheet].append([shape.moved(copy.motion) for shape in drawn[key]])
    count = len(on_sheets)
    warnings = []
    for index, reserved in enumerate(nested.reserved):
        if reserved:
            title_and_bar = corner_shapes(f"{title}  sheet {index + 1} of {count}", chosen.margin_mm)
            on_sheets[index].append(title_and_bar)
        else:
            warnings.append(f"sheet {index + 1}: no room for the {REFERENCE_MM:g} mm reference bar")
    sheets = tuple(
        Sheet(f"sheet_{index + 1}", width, height, tuple(tuple(rounded(group)) for group in on_sheet))
        for index, on_sheet in enumerate(on_sheets)
    )
    return sheets, warnings


def corner_shapes(title: str, margin_mm: float) -> list[Shape]:
    """The reference bar with a tick every 10 mm, and above it its length and the title."""
    x = y = margin_mm + 1
    shapes: list[Shape] = [Path("LABEL", ((x, y), (x + REFERENCE_MM, y)))]
    for i in range(11):
        tall = TICK_MM if i in (0, 10) else TICK_MM / 2
        shapes.append(Path("LABEL", ((x + 10 * i, y), (x + 10 * i, y + tall))))
    text = f"{REFERENCE_MM:g} mm  {title}"
    height = TITLE_HEIGHT_MM
    width = text_strokes(text, height)[1]
    height *= min(1.0, (REFERENCE_MM - 1) / width)
    strokes, _ = text_strokes(text, height)
    shapes += [Path("LABEL", tuple((x + u, y + TICK_MM + 1 + v) for u, v in stroke)) for stroke in strokes]
    return shapes


def rounded(shapes: Iterable[Shape]) -> Iterable[Shape]:
    """The shapes with coordinates rounded to 1 µm, as in the files."""
    for shape in shapes:
        if isinstance(shape, Path):
            yield Path(shape.layer, tuple(_round(p) for p in shape.points_mm), shape.closed)
        else:
            yield type(shape)(shape.layer, _round(shape.center_mm), round(shape.radius_mm, 3))


def _round(p: Point) -> Point:
    return round(p[0], 3) + 0.0, round(p[1], 3) + 0.0

