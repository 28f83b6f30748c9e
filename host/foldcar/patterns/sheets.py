"""A folded car's pieces on sheets: flat, split to size, labelled, nested, with a reference bar and a title.

Input: a FoldedCar, Options, a title. Output: a Pattern. NestingError if a piece fits no sheet.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from shapely.geometry import Polygon

from foldcar.patterns.drawing import Path, Point, Shape, Sheet
from foldcar.patterns.flat_piece import FlatPiece, flat_piece
from foldcar.patterns.labels import EdgeMark, number_runs
from foldcar.patterns.nesting import nest
from foldcar.patterns.options import Options
from foldcar.patterns.piece_shapes import piece_shapes
from foldcar.patterns.layers import LAYERS
from foldcar.patterns.split import split_to_fit
from foldcar.patterns.stroke_font import text_strokes
from foldcar.sheet.model import FoldedCar, Join

# Length of the bar that shows whether a sheet was cut or printed to scale.
REFERENCE_MM = 100.0
TICK_MM = 3.0
TITLE_HEIGHT_MM = 2.5
# The corner of a sheet that bar and title take.
CORNER_MM = (REFERENCE_MM + 2.0, 9.0)


@dataclass(frozen=True, slots=True)
class Pattern:
    """Everything that is cut of one car. ``warnings`` are in words."""

    title: str
    pieces: tuple[FlatPiece, ...]
    sheets: tuple[Sheet, ...]
    warnings: tuple[str, ...]
    options: Options

    @property
    def cut_length_mm(self) -> float:
        """How far blade or beam travels through film; dashes count, scored folds and labels do not."""
        return sum(
            shape.length_mm
            for sheet in self.sheets
            for shape in sheet.shapes
            if LAYERS[shape.layer].cut or (LAYERS[shape.layer].fold and self.options.fold == "dash")
        )

    @property
    def film_area_mm2(self) -> float:
        """Film that ends up in the car, overlaps included."""
        return sum(piece.area_mm2 * piece.count for piece in self.pieces)


def pattern(folded: FoldedCar, chosen: Options, title: str) -> Pattern:
    """The car's sheets."""
    pieces = [part for piece in folded.pieces for part in split_to_fit(flat_piece(piece, chosen), chosen)]
    shapes: list[list[Shape]] = []
    warnings: list[str] = []
    for piece in pieces:
        drawn, missing = piece_shapes(piece, chosen, number_runs(_marks(piece, folded.joins)))
        shapes.append(drawn)
        warnings += missing
    sheets, unmarked = lay_out([p.label for p in pieces], shapes, [p.count for p in pieces], chosen, title)
    return Pattern(title, tuple(pieces), sheets, (*warnings, *unmarked), chosen)


def lay_out(
    labels: Sequence[str],
    shapes: Sequence[Sequence[Shape]],
    counts: Sequence[int],
    chosen: Options,
    title: str,
) -> tuple[tuple[Sheet, ...], list[str]]:
    """Pieces, given by their shapes, nested on sheets; warnings about sheets without a reference bar."""
    outlines = [_outline(drawn) for drawn in shapes]
    pieces = list(zip(labels, outlines, counts, strict=True))
    width, height = chosen.sheet_size_mm
    nested = nest(pieces, (width, height), chosen.margin_mm, chosen.gap_mm, CORNER_MM)
    on_sheets: list[list[Shape]] = [[] for _ in nested.reserved]
    for drawn, copies in zip(shapes, nested.placements, strict=True):
        for copy in copies:
            on_sheets[copy.sheet] += [shape.moved(copy.motion) for shape in drawn]
    count = len(on_sheets)
    warnings = []
    for index, reserved in enumerate(nested.reserved):
        if reserved:
            on_sheets[index] += corner_shapes(
                f"{title}  sheet {index + 1} of {count}", chosen.margin_mm, chosen.margin_mm
            )
        else:
            warnings.append(f"sheet {index + 1}: no room for the {REFERENCE_MM:g} mm reference bar")
    sheets = tuple(
        Sheet(f"sheet_{index + 1}", width, height, tuple(_rounded(on_sheet)))
        for index, on_sheet in enumerate(on_sheets)
    )
    return sheets, warnings


def corner_shapes(title: str, x: float, y: float) -> list[Shape]:
    """The reference bar with a tick at both ends and every 10 mm, its length and the title over it."""
    x, y = x + 1, y + 1
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


def _outline(drawn: Iterable[Shape]) -> Polygon:
    return Polygon(next(s.points_mm for s in drawn if isinstance(s, Path) and s.layer == "CUT_OUTER"))


def _marks(piece: FlatPiece, joins: Iterable[Join]) -> Iterable[EdgeMark]:
    """The numbers of all joins that the piece takes part in."""
    for join in joins:
        for name, edge in ((join.piece_a, join.a), (join.piece_b, join.b)):
            # Parts of a split piece keep its name in front.
            if piece.name != name and piece.name.rpartition(" ")[0] != name:
                continue
            for face in piece.faces:
                if face.name == edge.face and edge.index in face.edges:
                    a, b = face.edges[edge.index]
                    if math.dist(a, b) > 0:
                        yield EdgeMark(str(join.number), face.name, a, b)


def _rounded(shapes: Iterable[Shape]) -> Iterable[Shape]:
    """Coordinates to a tenth of a micrometre, as files hold them."""
    for shape in shapes:
        if isinstance(shape, Path):
            yield Path(shape.layer, tuple(_round(p) for p in shape.points_mm), shape.closed)
        else:
            yield type(shape)(shape.layer, _round(shape.center_mm), round(shape.radius_mm, 4))


def _round(p: Point) -> Point:
    return round(p[0], 4) + 0.0, round(p[1], 4) + 0.0

