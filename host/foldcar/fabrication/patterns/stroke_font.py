"""Text as single strokes for pens and engraving beams, independent of installed fonts.

The glyphs are Hershey's simplex roman ("futural"). Missing characters are drawn as "?".
"""

from functools import cache

from HersheyFonts import HersheyFonts

from foldcar.fabrication.patterns.drawing import Point

# In the font's units: height of a capital, and the y of its base line.
CAP_UNITS = 21
BASE_LINE = 9


@cache
def _font() -> HersheyFonts:
    font = HersheyFonts()
    font.load_default_font("futural")
    return font


@cache
def text_strokes(text: str, height_mm: float) -> tuple[tuple[tuple[Point, ...], ...], float]:
    """The strokes of ``text`` with capitals ``height_mm`` high, from x = 0 on the base line, and its width (mm)."""
    scale = height_mm / CAP_UNITS
    printable = "".join(c if " " <= c <= "~" else "?" for c in text)
    strokes = [
        tuple((x * scale, (BASE_LINE - y) * scale) for x, y in stroke)
        for stroke in _font().strokes_for_text(printable)
    ]
    strokes = [stroke for stroke in strokes if len(set(stroke)) > 1]
    if not strokes:
        return (), 0.0
    left = min(x for stroke in strokes for x, _ in stroke)
    width = max(x for stroke in strokes for x, _ in stroke) - left
    return tuple(tuple((x - left, y) for x, y in stroke) for stroke in strokes), width
