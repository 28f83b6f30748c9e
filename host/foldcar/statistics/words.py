"""Designs and rates in words: ``95 mm``, ``width 95 mm, radius 60 mm``, ``12 %``."""

from collections.abc import Iterable, Mapping, Sequence
from decimal import Decimal
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from foldcar.statistics.gap import RankAgreement

# Ends of columns' names, and how their units are written; longer ends first.
COLUMN_UNITS = {
    "rad_s": "rad/s", "m_s": "m/s", "mm": "mm", "cm2": "cm²", "m": "m", "deg": "°", "rad": "rad", "kg": "kg", "g": "g",
    "s": "s", "v": "V", "j": "J", "us": "µs",
}  # fmt: skip
# A rate just below a threshold is shown with at most this many decimals.
MAX_DIGITS = 6


def design_text(design: Mapping[str, float | str]) -> str:
    """Describe a design: ``95 mm``, or with names, ``width 95 mm, radius 60 mm``, if a value alone would be unclear."""
    if not design:
        return "the design"
    texts = []
    for name, value in design.items():
        label, unit = label_and_unit(name)
        text = value_text(name, value)
        if len(design) == 1 and unit:
            return text
        texts.append(f"{label} {text}")
    return ", ".join(texts)


def value_text(name: str, value: float | str | None) -> str:
    """Return the value of the parameter ``name`` with its unit; ``unknown`` for None."""
    if value is None:
        return "unknown"
    if isinstance(value, str):
        return value
    _, unit = label_and_unit(name)
    # No space before a degree sign.
    space = "" if unit in ("", "°") else " "
    return f"{value:g}{space}{unit}"


def label_and_unit(name: str) -> tuple[str, str]:
    """Return a column's label and unit: ``wheel radius`` and ``mm`` of wheel_radius_mm; "" if it has no unit."""
    for ending, unit in COLUMN_UNITS.items():
        if name.endswith(f"_{ending}"):
            return name.removesuffix(f"_{ending}").replace("_", " "), unit
    return name.replace("_", " "), ""


def percent(share: float, digits: int = 0) -> str:
    """Return a fraction of 0 to 1 in per cent: ``12 %``. Only 0 is ``0 %``, and only 1 is ``100 %``.

    Example: percent(1 / 200) is "<1 %", percent(199 / 200) is ">99 %"
    """
    return f"{percent_number(share, digits)} %"


def percent_number(share: float, digits: int = 0) -> str:
    """Return a fraction of 0 to 1 as a number in per cent, such as ``12``.

    Only 0 itself is shown as ``0``, and only 1 as ``100``. Other fractions that round to these are ``<1`` and ``>99``.
    """
    number = f"{100 * share:.{digits}f}"
    smallest_step = 10.0**-digits
    if share > 0 and float(number) == 0:
        return f"<{smallest_step:.{digits}f}"
    if share < 1 and float(number) == 100:
        return f">{100 - smallest_step:.{digits}f}"
    return number


def threshold_text(threshold: float) -> str:
    """Return a threshold of 0 to 1 in per cent, not rounded.

    Example: threshold_text(0.745) is "74.5 %"
    """
    # Decimals of the number as it was written: 0.07 is 7 %, without the errors of binary fractions.
    return f"{(100 * Decimal(str(float(threshold)))).normalize():f} %"


def percent_below(share: float, threshold: float) -> str:
    """Return a fraction that is below the threshold in per cent. It has so many digits that the text is below it, too.

    Example: percent_below(149 / 199, 0.75) is "74.9 %", percent_below(0.6, 0.75) is "60 %"
    """
    digits = 0
    while digits < MAX_DIGITS and round(100 * share, digits) >= 100 * threshold:
        digits += 1
    return percent(share, digits)


def rate_text(rate: float, low: float, high: float) -> str:
    """Return a rate of 0 to 1 with its interval: ``70 % (40 % to 89 %)``."""
    return f"{percent(rate)} ({percent(low)} to {percent(high)})"


def signed(value: float, digits: int) -> str:
    """Return a number with its sign and so many decimals: ``-1.4``. What rounds to 0 has none: ``0.0``."""
    rounded = round(value, digits)
    return f"{rounded:+.{digits}f}" if rounded else f"{0:.{digits}f}"


def points(difference: float, sign: bool = True) -> str:
    """Return a difference of rates in whole percentage points, with a sign: ``-30``."""
    return signed(100 * difference, 0) if sign else f"{abs(100 * difference):.0f}"


def points_text(difference: float) -> str:
    """Return the size of a difference of rates: ``30 points``, ``1 point``."""
    return count(round(abs(100 * difference)), "point")


def span_text(name: str, first: float, last: float) -> str:
    """Return a range of values of the parameter ``name``: ``75 to 150 mm``; ``75 mm`` if both ends are equal."""
    low, high = value_text(name, first), value_text(name, last)
    return low if low == high else f"{first:g} to {high}"


def listed(names: Iterable[str]) -> str:
    """Return ``a``, ``a and b``, ``a, b and c``; ``none`` without names.

    Numbers with one unit share it: ``95, 115 and 180 mm``. Names with commas are separated by semicolons: ``a, b; c, d``.
    """
    texts = _sharing_unit(list(names))
    if not texts:
        return "none"
    if len(texts) == 1:
        return texts[0]
    if any("," in text for text in texts):
        return "; ".join(texts)
    return f"{', '.join(texts[:-1])} and {texts[-1]}"


def estimate_text(value: float, low: float, high: float) -> str:
    """Return an estimate with its interval: ``1.2 (0.8 to 1.73)``. Below 1 % of the interval's length it is 0.

    All have three digits, as on the page: with two, 0.98 (0.94 to 1.03) would end at 1.
    """
    shown = value if abs(value) >= (high - low) / 100 else 0.0
    return f"{shown:.3g} ({low:.3g} to {high:.3g})"


def count(number: int, noun: str) -> str:
    """Return ``1 trial``, ``2 trials``."""
    return f"{number:,} {noun}{'' if number == 1 else 's'}"


def duration_text(seconds: float) -> str:
    """Return ``12 s``, ``3 min``, ``5.5 h``, ``4.2 days``: two digits."""
    for unit, length_s, maximum in (("s", 1, 100), ("min", 60, 100), ("h", 3600, 48)):
        # As it is shown, rounded to two digits: 99.6 s is 1.7 min.
        number = float(f"{seconds / length_s:.2g}")
        if number < maximum:
            return f"{number:g} {unit}"
    return f"{seconds / 86400:,.1f} days"


def _sharing_unit(texts: Sequence[str]) -> list[str]:
    """Return the texts with the unit at the last one only, if this is possible: ["80 mm", "95 mm"] gives ["80", "95 mm"].

    It is possible if each text consists of one word or number and a unit, and if all have the same unit.
    """
    words = [text.split(" ") for text in texts]
    if len(texts) < 2 or any(len(words_of_text) != 2 for words_of_text in words):
        return list(texts)
    numbers, units = [number for number, _ in words], {unit for _, unit in words}
    if "" in numbers or len(units) > 1:
        return list(texts)
    return [*numbers[:-1], texts[-1]]


def rank_text(ranks: "RankAgreement | None") -> str | None:
    """Return a sentence on how well simulation ranks the driven designs; None for fewer than two."""
    if ranks is None or ranks.mmrv is None:
        return None
    return f"Over {ranks.designs} designs: mean maximum rank violation {ranks.mmrv:.2f}."
