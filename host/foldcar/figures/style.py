"""The style of all figures: fonts, lines and colours, suitable for print and for colour-blind readers."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

# Any: matplotlib types its settings by a literal of every name, which older versions do not.
RC: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Arial", "Helvetica", "sans-serif"],
    # Names are no formulas: they may contain dollar signs.
    "text.parse_math": False,
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": "#d9d9d9",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "figure.dpi": 100,
    "savefig.dpi": 200,
    "savefig.facecolor": "white",
    # Text is kept as text, for search, screen readers and editors.
    "svg.fonttype": "none",
    # TrueType, which editors and publishers take; the default, Type 3, many refuse.
    "pdf.fonttype": 42,
    # Ids depend on the content only, so that the same data give the same bytes.
    "svg.hashsalt": "foldcar",
}

# Fonts with Chinese, Japanese or Korean characters, which DejaVu Sans lacks.
CJK_FONTS = (
    *("Noto Sans CJK SC", "Noto Sans CJK JP", "Noto Sans CJK KR", "Noto Sans SC", "Noto Sans JP", "Noto Sans KR"),
    *("Source Han Sans SC", "WenQuanYi Micro Hei", "WenQuanYi Zen Hei", "Droid Sans Fallback", "IPAGothic", "UnDotum"),
    *("Microsoft YaHei", "SimHei", "Yu Gothic", "MS Gothic", "Malgun Gothic"),
    *("PingFang SC", "Hiragino Sans", "Apple SD Gothic Neo", "Arial Unicode MS", "Unifont"),
)


@contextmanager
def drawing_style(settings: Any = RC) -> Iterator[None]:
    """Within the block, matplotlib draws with ``settings`` and with installed fonts for characters of East Asia.

    Where no font has a character, matplotlib draws a box.

    Example: with drawing_style(): figure = Figure()
    """
    import matplotlib

    with_fonts = {**settings, "font.family": ["sans-serif", *_cjk_fonts()]}
    with matplotlib.rc_context(with_fonts), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        yield


@cache
def _cjk_fonts() -> list[str]:
    """Return the installed fonts of CJK_FONTS, in their order."""
    from matplotlib.font_manager import fontManager

    installed_fonts = {font.name for font in fontManager.ttflist}
    return [font for font in CJK_FONTS if font in installed_fonts]


INK = "#222222"
ACCENT = "#0072b2"
FAILURE = "#d62728"

# The palette of Okabe and Ito, ordered so that neighbours in a stack also differ in lightness.
OUTCOME_COLOURS = {
    "passed": "#009e73",
    "tipped": "#d55e00",
    "stuck": "#56b4e9",
    "off_course": "#cc79a7",
    "timeout": "#f0e442",
    "fault": "#222222",
    "terminated": "#0072b2",
    "rejected": "#e69f00",
    "failed": "#999999",
}
OUTCOME_LABELS = {
    "passed": "passed",
    "tipped": "tipped over",
    "stuck": "stuck",
    "off_course": "off course",
    "timeout": "time-out",
    "fault": "fault",
    "terminated": "ended by program",
    "rejected": "rejected",
    "failed": "failed",
}
