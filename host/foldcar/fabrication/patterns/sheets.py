"""Draws a folded car's pieces on sheets: flat, split to size, labelled, nested, with a title block.

Input: a FoldedCar, Options, a title, the command that makes the sheets. Output: a Pattern. NestingError if a piece does
not fit on a sheet.
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import segno
from shapely.geometry import Polygon

from foldcar.car.folded.model import FoldedCar
from foldcar.car.parts.bought import Film as SoldFilm
from foldcar.car.parts.catalogue import film_of
from foldcar.fabrication.patterns.drawing import LAYERS, Motion, Path, Point, Shape, Sheet
from foldcar.fabrication.patterns.flat_piece import FlatPiece, flat_piece, moved_to_origin
from foldcar.fabrication.patterns.labels import join_marks, text_strokes
from foldcar.fabrication.patterns.nesting import NestingError, all_fit, nest, suggest_sheet
from foldcar.fabrication.patterns.options import MACHINES, TORN_FILM_MM, OptionError, Options
from foldcar.fabrication.patterns.piece_shapes import Film, narrowest_film, outer_cut, piece_shapes
from foldcar.fabrication.patterns.splitting import split_to_fit

# Length of the bar by which the scale of a cut or printed sheet is checked.
REFERENCE_MM = 100.0
BAR = f"bar {REFERENCE_MM:g} mm"
TICK_MM = 3.0
TEXT_MM = 1.8
LINE_MM = 2.9
# The standard (ISO/IEC 18004) asks for four modules of blank around a code.
QUIET_MODULES = 4
MODULE_MM = LAYERS["QR_CODE"].width_mm


def wrapped(texts: Iterable[str]) -> list[str]:
    """Wrap the texts to lines no longer than the reference bar, at blanks where there are any."""
    lines = []
    for text in texts:
        line = ""
        for word in _words(text):
            longer = f"{line} {word}".strip()
            if line and _width_mm(longer) > REFERENCE_MM:
                lines.append(line)
                longer = word
            line = longer
        lines.append(line)
    return lines


def _words(text: str) -> Iterator[str]:
    for word in text.split():
        while _width_mm(word) > REFERENCE_MM:
            cut = next(n for n in range(len(word), 0, -1) if _width_mm(word[:n]) <= REFERENCE_MM)
            yield word[:cut]
            word = word[cut:]
        yield word


def _width_mm(text: str) -> float:
    return text_strokes(text, TEXT_MM)[1]


def title_size_mm(lines: int) -> Point:
    """Width and height (mm) of the title: the bar and that many lines of text."""
    return REFERENCE_MM + 2.0, TICK_MM + 2.0 + lines * LINE_MM


def title_shapes(lines: Sequence[str]) -> list[Shape]:
    """Draw the reference bar with a tick every 10 mm, and the lines of text (see `wrapped`) above it, at the origin."""
    x = y = 1.0
    shapes: list[Shape] = [Path("LABEL", ((x, y), (x + REFERENCE_MM, y)))]
    for i in range(11):
        tall = TICK_MM if i in (0, 10) else TICK_MM / 2
        shapes.append(Path("LABEL", ((x + 10 * i, y), (x + 10 * i, y + tall))))
    for up, line in enumerate(reversed(lines)):
        base = y + TICK_MM + 1 + up * LINE_MM
        strokes, _ = text_strokes(line, TEXT_MM)
        shapes += [Path("LABEL", tuple((x + u, base + v) for u, v in stroke)) for stroke in strokes]
    return shapes


def modules(text: str) -> tuple[tuple[bool, ...], ...]:
    """Return the QR code's rows from the top, dark modules true: the smallest version, with its best correction."""
    return tuple(tuple(map(bool, row)) for row in segno.make(text, error="l", micro=False).matrix)


def code_size_mm(text: str) -> float:
    """The side (mm) of the QR code with the blank around it."""
    return (len(modules(text)) + 2 * QUIET_MODULES) * MODULE_MM


def code_shapes(text: str) -> list[Shape]:
    """Draw the QR code, its blank's lower left corner at the origin."""
    rows = modules(text)
    shapes: list[Shape] = []
    for up, row in enumerate(reversed(rows)):
        y = (QUIET_MODULES + up + 0.5) * MODULE_MM
        at = QUIET_MODULES
        for dark, run in itertools.groupby(row):
            end = at + len(list(run))
            if dark:
                shapes.append(Path("QR_CODE", ((at * MODULE_MM, y), (end * MODULE_MM, y))))
            at = end
    return shapes


@dataclass(frozen=True, slots=True)
class Pattern:
    """The flat pieces and sheets of one car, the options, warnings, the narrowest film between two cuts (mm).

    ``film`` is the film that the car is cut from. ``torn`` are findings: film too narrow to be cut at all.
    """

    title: str
    pieces: tuple[FlatPiece, ...]
    sheets: tuple[Sheet, ...]
    warnings: tuple[str, ...]
    options: Options
    film: SoldFilm
    least_film_mm: float
    torn: tuple[str, ...] = ()

    @property
    def cut_length_mm(self) -> float:
        """Length (mm) of all cuts, including dashes, without scored folds and labels."""
        return sum(
            shape.length_mm
            for sheet in self.sheets
            for shape in sheet.shapes
            if LAYERS[shape.layer].cut or (LAYERS[shape.layer].fold and self.options.fold == "dash")
        )

    @property
    def film_area_mm2(self) -> float:
        """Area (mm²) of all copies of the pieces, including overlaps."""
        return sum(piece.area_mm2 * piece.count for piece in self.pieces)


@dataclass(frozen=True, slots=True)
class CutCar:
    """A car split along folds to fit the sheets, and its flat ``pieces``; ``unsplit_car`` is the car before."""

    car: FoldedCar
    pieces: tuple[FlatPiece, ...]
    unsplit_car: FoldedCar


def cut_car(folded: FoldedCar, chosen: Options) -> CutCar:
    """Return the car's pieces, split to fit the sheet as far as possible.

    Raises OptionError if the machine does not cut the car's film.
    """
    film = folded.parts.film
    if getattr(film.cutting, chosen.machine) is None:
        others = " or ".join(name for name, how in film.cutting if how is not None)
        raise OptionError(f"--machine {chosen.machine}: does not cut {film.title}; only {others} would do")
    car = split_to_fit(folded, chosen)
    turning = {placed.piece for placed in car.placed if placed.body.startswith("wheel")}
    flat = (flat_piece(piece, chosen) for piece in car.pieces)
    # Discs stay around their centres.
    pieces = tuple(piece if piece.name in turning and not piece.bends else moved_to_origin(piece) for piece in flat)
    return CutCar(car, pieces, folded)


def enlarge_sheet(folded: FoldedCar, chosen: Options) -> Options:
    """Return the options with the machine's smallest sheet, from the chosen one on, that every piece fits on.

    If the pieces fit on none of the sheets, the options are returned unchanged.
    """
    names = MACHINES[chosen.machine].sheets
    for name in names[names.index(chosen.sheet) :]:
        other = replace(chosen, sheet=name)
        if all_fit([outer_cut(piece, other.kerf_mm) for piece in cut_car(folded, other).pieces], other):
            return other
    return chosen


def pattern(folded: FoldedCar, chosen: Options, title: str, command: str = "") -> Pattern:
    """Return the car's sheets. Raises NestingError if a piece does not fit on a sheet."""
    return pattern_of(cut_car(folded, chosen), chosen, title, command)


def pattern_of(cut: CutCar, chosen: Options, title: str, command: str = "") -> Pattern:
    """Return the sheets of a car whose pieces are split already. Raises NestingError if a piece does not fit."""
    films = {piece.label: film for piece in cut.pieces if (film := narrowest_film(piece, chosen)) is not None}
    narrow = [f"{label}: {_narrow(film)}" for label, film in films.items() if film.narrow]
    try:
        sheets, unmarked = _lay_out(cut, chosen, title, command)
    except NestingError as error:
        raise NestingError(f"{error}; {_suggested_sheet(cut.car, chosen)}") from error
    least = min((film.width_mm for film in films.values()), default=math.inf)
    torn = tuple(f"{label}: {_narrow(film)}" for label, film in films.items() if film.width_mm < TORN_FILM_MM)
    return Pattern(title, cut.pieces, sheets, (*narrow, *unmarked), chosen, cut.car.parts.film, least, torn)


def _narrow(film: Film) -> str:
    return f"only {film.width_mm:.2f} mm of film between {film.between[0]} and {film.between[1]}: it may tear"


def _suggested_sheet(car: FoldedCar, chosen: Options) -> str:
    def outlines(other: Options) -> list[Polygon]:
        return [outer_cut(piece, other.kerf_mm) for piece in cut_car(car, other).pieces]

    unsplit_outlines = [outer_cut(flat_piece(piece, chosen), chosen.kerf_mm) for piece in car.pieces]
    return suggest_sheet(lambda other: all_fit(outlines(other), other), unsplit_outlines, chosen)


def _lay_out(cut: CutCar, chosen: Options, title: str, command: str) -> tuple[tuple[Sheet, ...], list[str]]:
    """Nest the pieces on sheets of their films; also return warnings: labels, reference bars, QR codes without room."""
    width, height = chosen.sheet_size_mm
    titles = [film_of(cut.car.parts.film, piece.thickness_mm).title for piece in cut.pieces]
    # As many lines as with the longest numbers.
    title_mm = title_size_mm(max(len(_title_lines(title, "99 of 99", film, command, chosen)) for film in titles))
    code_mm = code_size_mm(command) if command else 0.0
    films: list[str] = []
    boxes: list[tuple[Motion | None, Motion | None]] = []
    on_sheets: list[list[Iterable[Shape]]] = []
    missing: dict[str, None] = {}
    for film in dict.fromkeys(titles):
        pieces = [piece for piece, of in zip(cut.pieces, titles, strict=True) if of == film]
        listed = [(piece.label, outer_cut(piece, chosen.kerf_mm), piece.count) for piece in pieces]
        nested = nest(listed, (width, height), chosen.margin_mm, chosen.gap_mm, title_mm, (code_mm, code_mm))
        first = len(on_sheets)
        boxes += zip(nested.titles, nested.boxes, strict=True)
        films += [film] * len(nested.titles)
        on_sheets += [[] for _ in nested.titles]
        for piece, copies in zip(pieces, nested.placements, strict=True):
            drawn: dict[int, list[Shape]] = {}
            for copy in copies:
                turn = copy.motion.quarter_turns
                if turn not in drawn:
                    marks = join_marks(piece, cut.car, cut.unsplit_car)
                    drawn[turn], unlabelled = piece_shapes(piece, chosen, marks, turn)
                    missing |= dict.fromkeys(unlabelled)
                on_sheets[first + copy.sheet].append([shape.moved(copy.motion) for shape in drawn[turn]])
    count = len(on_sheets)
    warnings = list(missing)
    for index, (titled, free) in enumerate(boxes):
        if titled is not None:
            lines = _title_lines(title, f"{index + 1} of {count}", films[index], command, chosen)
            on_sheets[index].append([shape.moved(titled) for shape in title_shapes(lines)])
        else:
            warnings.append(f"sheet {index + 1}: no room for the {REFERENCE_MM:g} mm reference bar")
        if command and free is not None:
            on_sheets[index].append([shape.moved(free) for shape in code_shapes(command)])
    if command and not any(free for _, free in boxes):
        warnings.append("no sheet has room for the QR code of its command; how_to_cut.md has the command")
    sheets = tuple(
        Sheet(f"sheet_{i + 1}", width, height, tuple(map(tuple, map(rounded, on_sheet))), chosen.dashed, film)
        for i, (on_sheet, film) in enumerate(zip(on_sheets, films, strict=True))
    )
    return sheets, warnings


def _title_lines(title: str, number: str, film: str, command: str, chosen: Options) -> list[str]:
    width, height = chosen.sheet_size_mm
    machine = f"{film}, {chosen.machine}, {width:g} x {height:g} mm, kerf {chosen.kerf_mm:g}, {BAR}"
    return wrapped([f"{title}, sheet {number}", machine, *([command] if command else [])])


def rounded(shapes: Iterable[Shape]) -> Iterable[Shape]:
    """The shapes with coordinates rounded to 1 µm, as in the files."""
    for shape in shapes:
        if isinstance(shape, Path):
            yield Path(shape.layer, tuple(_round(p) for p in shape.points_mm), shape.closed)
        else:
            yield type(shape)(shape.layer, _round(shape.center_mm), round(shape.radius_mm, 3))


def _round(p: Point) -> Point:
    return round(p[0], 3) + 0.0, round(p[1], 3) + 0.0
