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
from foldcar.car.parts.bought import Film
from foldcar.car.parts.catalogue import film_of
from foldcar.fabrication.patterns.drawing import LAYERS, Motion, Path, Point, Shape, Sheet
from foldcar.fabrication.patterns.flat_piece import FlatPiece, flat_piece, moved_to_origin
from foldcar.fabrication.patterns.join_marks import join_marks
from foldcar.fabrication.patterns.labels import text_strokes
from foldcar.fabrication.patterns.nesting import NestingError, nest
from foldcar.fabrication.patterns.options import MACHINES, TORN_FILM_MM, OptionError, Options
from foldcar.fabrication.patterns.piece_shapes import NarrowestFilm, narrowest_film, outer_cut, piece_shapes
from foldcar.fabrication.patterns.sheet_fit import all_fit, suggest_sheet
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
    """Wrap the texts to lines no longer than the reference bar, at blanks; a longer word is broken anywhere."""
    lines = []
    for text in texts:
        line = ""
        for word in _words(text):
            extended = f"{line} {word}".strip()
            if line and _width_mm(extended) > REFERENCE_MM:
                lines.append(line)
                extended = word
            line = extended
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
    """Draw the reference bar with a tick every 10 mm, and the lines of text (see `wrapped`) above it.

    The lower left corner is 1 mm from the origin on both sides.
    """
    x = y = 1.0
    shapes: list[Shape] = [Path("LABEL", ((x, y), (x + REFERENCE_MM, y)))]
    for i in range(11):
        tick_mm = TICK_MM if i in (0, 10) else TICK_MM / 2
        shapes.append(Path("LABEL", ((x + 10 * i, y), (x + 10 * i, y + tick_mm))))
    for row, line in enumerate(reversed(lines)):
        base_y = y + TICK_MM + 1 + row * LINE_MM
        strokes, _ = text_strokes(line, TEXT_MM)
        shapes += [Path("LABEL", tuple((x + u, base_y + v) for u, v in stroke)) for stroke in strokes]
    return shapes


def modules(text: str) -> tuple[tuple[bool, ...], ...]:
    """Return the rows of the QR code of a text, from the top; a dark module is True.

    The code has the smallest version that holds the text, and the best correction of errors of this version.
    """
    code = segno.make(text, error="l", micro=False)
    return tuple(tuple(bool(module) for module in row) for row in code.matrix)


def code_size_mm(text: str) -> float:
    """Return the side length (mm) of the QR code, with the blank border around it."""
    return (len(modules(text)) + 2 * QUIET_MODULES) * MODULE_MM


def code_shapes(text: str) -> list[Shape]:
    """Draw the QR code as horizontal lines, one for each run of dark modules.

    The lower left corner of its blank border is at the origin.
    """
    rows = modules(text)
    shapes: list[Shape] = []
    for row_number, row in enumerate(reversed(rows)):
        y = (QUIET_MODULES + row_number + 0.5) * MODULE_MM
        start = QUIET_MODULES
        for is_dark, run in itertools.groupby(row):
            end = start + len(list(run))
            if is_dark:
                shapes.append(Path("QR_CODE", ((start * MODULE_MM, y), (end * MODULE_MM, y))))
            start = end
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
    film: Film
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


def cut_car(folded: FoldedCar, options: Options) -> CutCar:
    """Return the flat pieces of a car; pieces that are too large for the sheet are split if that helps.

    Raises OptionError if the machine does not cut the car's film.
    """
    film = folded.parts.film
    if getattr(film.cutting, options.machine) is None:
        machines = " or ".join(name for name, cutting in film.cutting if cutting is not None)
        raise OptionError(f"machine {options.machine}: does not cut {film.title}; only {machines} would do")
    car = split_to_fit(folded, options)
    wheel_pieces = {placed.piece for placed in car.placed if placed.body.startswith("wheel")}
    pieces = []
    for flat in (flat_piece(piece, options) for piece in car.pieces):
        # The origin of a disc is its centre; other pieces are moved so that their lower left corner is the origin.
        is_disc = flat.name in wheel_pieces and not flat.bends
        pieces.append(flat if is_disc else moved_to_origin(flat))
    return CutCar(car, tuple(pieces), folded)


def enlarge_sheet(folded: FoldedCar, options: Options) -> Options:
    """Return the options with a larger sheet, if a piece does not fit on the sheet of ``options``.

    The sheet is the smallest one of the machine on which every piece fits. If there is none, the options are returned
    unchanged.
    """
    sheets = MACHINES[options.machine].sheets
    for sheet in sheets[sheets.index(options.sheet) :]:
        larger = replace(options, sheet=sheet)
        outlines = [outer_cut(piece, larger.kerf_mm) for piece in cut_car(folded, larger).pieces]
        if all_fit(outlines, larger):
            return larger
    return options


def pattern(folded: FoldedCar, options: Options, title: str, command: str = "") -> Pattern:
    """Return the car's sheets. Raises NestingError if a piece does not fit on a sheet."""
    return pattern_of(cut_car(folded, options), options, title, command)


def pattern_of(cut: CutCar, options: Options, title: str, command: str = "") -> Pattern:
    """Return the sheets of a car whose pieces are split already. Raises NestingError if a piece does not fit."""
    # A narrow place in the film of a piece gives a warning. If it is so narrow that the film tears there, the message
    # is also returned as ``torn``.
    narrow_warnings, torn_findings = [], []
    min_width_mm = math.inf
    for piece in cut.pieces:
        film = narrowest_film(piece, options)
        if film is None:
            continue
        min_width_mm = min(min_width_mm, film.width_mm)
        message = f"{piece.label}: {_narrow_text(film)}"
        if film.narrow:
            narrow_warnings.append(message)
        if film.width_mm < TORN_FILM_MM:
            torn_findings.append(message)
    try:
        sheets, room_warnings = _lay_out(cut, options, title, command)
    except NestingError as error:
        raise NestingError(f"{error}; {_suggested_sheet(cut.car, options)}") from error
    return Pattern(
        title=title,
        pieces=cut.pieces,
        sheets=sheets,
        warnings=(*narrow_warnings, *room_warnings),
        options=options,
        film=cut.car.parts.film,
        least_film_mm=min_width_mm,
        torn=tuple(torn_findings),
    )


def _narrow_text(film: NarrowestFilm) -> str:
    return f"only {film.width_mm:.2f} mm of film between {film.between[0]} and {film.between[1]}: it may tear"


def _suggested_sheet(car: FoldedCar, options: Options) -> str:
    """Return a sentence on the sheet that would be large enough."""

    def fits_on(other: Options) -> bool:
        outlines: list[Polygon] = [outer_cut(piece, other.kerf_mm) for piece in cut_car(car, other).pieces]
        return all_fit(outlines, other)

    unsplit_outlines = [outer_cut(flat_piece(piece, options), options.kerf_mm) for piece in car.pieces]
    return suggest_sheet(fits_on, unsplit_outlines, options)


def _lay_out(cut: CutCar, options: Options, title: str, command: str) -> tuple[tuple[Sheet, ...], list[str]]:
    """Nest the pieces on sheets of their films, and draw them with title and QR code.

    Also return warnings on labels, reference bars and QR codes for which there is no room.
    """
    width, height = options.sheet_size_mm
    film_titles = [film_of(cut.car.parts.film, piece.thickness_mm).title for piece in cut.pieces]
    # As many lines as with the longest numbers.
    title_mm = title_size_mm(max(len(_title_lines(title, "99 of 99", film, command, options)) for film in film_titles))
    code_mm = code_size_mm(command) if command else 0.0
    film_of_sheet: list[str] = []
    free_places: list[tuple[Motion | None, Motion | None]] = []
    groups_of_sheet: list[list[Iterable[Shape]]] = []
    unlabelled_texts: dict[str, None] = {}
    for film in dict.fromkeys(film_titles):
        pieces = [piece for piece, film_title in zip(cut.pieces, film_titles, strict=True) if film_title == film]
        outlines = [(piece.label, outer_cut(piece, options.kerf_mm), piece.count) for piece in pieces]
        nested = nest(outlines, (width, height), options.margin_mm, options.gap_mm, title_mm, (code_mm, code_mm))
        first_sheet = len(groups_of_sheet)
        free_places += zip(nested.titles, nested.boxes, strict=True)
        film_of_sheet += [film] * len(nested.titles)
        groups_of_sheet += [[] for _ in nested.titles]
        for piece, copies in zip(pieces, nested.placements, strict=True):
            shapes_by_turn: dict[int, list[Shape]] = {}
            for copy in copies:
                turn = copy.motion.quarter_turns
                if turn not in shapes_by_turn:
                    marks = join_marks(piece, cut.car, cut.unsplit_car)
                    shapes_by_turn[turn], warnings_of_piece = piece_shapes(piece, options, marks, turn)
                    unlabelled_texts |= dict.fromkeys(warnings_of_piece)
                shapes = [shape.moved(copy.motion) for shape in shapes_by_turn[turn]]
                groups_of_sheet[first_sheet + copy.sheet].append(shapes)
    count = len(groups_of_sheet)
    warnings = list(unlabelled_texts)
    for index, (title_motion, code_motion) in enumerate(free_places):
        if title_motion is not None:
            lines = _title_lines(title, f"{index + 1} of {count}", film_of_sheet[index], command, options)
            groups_of_sheet[index].append([shape.moved(title_motion) for shape in title_shapes(lines)])
        else:
            warnings.append(f"sheet {index + 1}: no room for the {REFERENCE_MM:g} mm reference bar")
        if command and code_motion is not None:
            groups_of_sheet[index].append([shape.moved(code_motion) for shape in code_shapes(command)])
    if command and not any(code_motion for _, code_motion in free_places):
        warnings.append("no sheet has room for the QR code of its command; how_to_cut.md has the command")
    sheets = tuple(
        Sheet(f"sheet_{i + 1}", width, height, tuple(map(tuple, map(rounded, groups))), options.dashed, film)
        for i, (groups, film) in enumerate(zip(groups_of_sheet, film_of_sheet, strict=True))
    )
    return sheets, warnings


def _title_lines(title: str, number: str, film: str, command: str, options: Options) -> list[str]:
    """Return the lines of a sheet's title: the car, the sheet's number, film and machine, and the command."""
    width, height = options.sheet_size_mm
    machine = f"{film}, {options.machine}, {width:g} x {height:g} mm, kerf {options.kerf_mm:g}, {BAR}"
    texts = [f"{title}, sheet {number}", machine]
    if command:
        texts.append(command)
    return wrapped(texts)


def rounded(shapes: Iterable[Shape]) -> Iterable[Shape]:
    """Yield the shapes with coordinates that are rounded to 1 µm, as in the files."""
    for shape in shapes:
        if isinstance(shape, Path):
            yield Path(shape.layer, tuple(_round(p) for p in shape.points_mm), shape.closed)
        else:
            yield type(shape)(shape.layer, _round(shape.center_mm), round(shape.radius_mm, 3))


def _round(p: Point) -> Point:
    return round(p[0], 3) + 0.0, round(p[1], 3) + 0.0
