"""The title block of a sheet: a bar to check the scale, what the sheet is, the command that made it as text and QR code.

Bar and text stand together where the pieces leave room, the code where there is room besides. All of it is on layers that
are not cut. A code is drawn as lines as wide as a module, one for each run of dark ones, so that
it looks the same on screen, on paper and from a pen.
"""

import itertools
from collections.abc import Iterable, Iterator, Sequence

import segno

from foldcar.fabrication.patterns.drawing import Path, Point, Shape
from foldcar.fabrication.patterns.layers import LAYERS
from foldcar.fabrication.patterns.stroke_font import text_strokes

# Length of the bar by which the scale of a cut or printed sheet is checked.
REFERENCE_MM = 100.0
TICK_MM = 3.0
TEXT_MM = 1.8
LINE_MM = 2.9
# The standard (ISO/IEC 18004) asks for four modules of blank around a code.
QUIET_MODULES = 4
MODULE_MM = LAYERS["QR_CODE"].width_mm


def wrapped(texts: Iterable[str]) -> list[str]:
    """The texts in lines no longer than the bar, broken at blanks where there are any."""
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
    """Width and height of the place for the bar and that many lines of text."""
    return REFERENCE_MM + 2.0, TICK_MM + 2.0 + lines * LINE_MM


def title_shapes(lines: Sequence[str]) -> list[Shape]:
    """The reference bar with a tick every 10 mm, and the lines of text (see `wrapped`) above it; from the origin."""
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
    """The code's rows from the top, dark modules true; the smallest version, with the best correction that it holds."""
    return tuple(tuple(map(bool, row)) for row in segno.make(text, error="l", micro=False).matrix)


def code_size_mm(text: str) -> float:
    """The side of the code with the blank around it."""
    return (len(modules(text)) + 2 * QUIET_MODULES) * MODULE_MM


def code_shapes(text: str) -> list[Shape]:
    """The code, its blank's lower left corner at the origin."""
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
