"""Rich's console for texts that come from files, names and cars: without markup, and shown as in shown_text.py."""

import sys
from collections.abc import Iterable
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.text import Text

from foldcar.shown_text import plain_stream, shown


def shown_console(plain_width: int | None = None, *, stderr: bool = False) -> Console:
    """A console; where its output is no terminal it has ``plain_width`` characters (None: as rich chooses)."""
    # Past the stream that would write out rich's own escape sequences.
    stream = plain_stream(sys.stderr if stderr else sys.stdout)
    width = None if stream.isatty() else plain_width
    return _ShownConsole(file=stream, width=width, markup=False, emoji=False, highlight=False)


class _ShownConsole(Console):
    def render_str(self, text: str, **options: Any) -> Text:
        # Columns are measured by what this returns.
        return super().render_str(shown(text), **options)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else shown(text), style, control)
