"""Short HTML that notebooks show for an object. Names in a store may come from others, so all texts are escaped."""

import html
from base64 import b64encode
from collections.abc import Iterable, Sequence
from typing import Any


def image_html(png: bytes) -> str:
    """Return an <img> of a PNG."""
    return f'<img style="max-width: 100%" alt="" src="data:image/png;base64,{b64encode(png).decode()}">'


def table_html(head: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a <table> with a head; cells are escaped."""

    def row(tag: str, cells: Sequence[Any]) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(str(cell))}</{tag}>" for cell in cells) + "</tr>"

    return "<table>" + row("th", head) + "".join(row("td", cells) for cells in rows) + "</table>"


def lines_html(lines: Iterable[str]) -> str:
    """Return a paragraph for each line that is not empty, escaped; the first is bold."""
    first, *others = [html.escape(line) for line in lines if line]
    return f"<p><b>{first}</b></p>" + "".join(f"<p>{line}</p>" for line in others)
