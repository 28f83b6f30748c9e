"""Tips of figures: what a bar or a point stands for, told by the browser when the pointer rests on it.

Input: artists of matplotlib, an SVG drawn of them. Output: the SVG with <title> elements. The text travels as an id.
"""

import html
import re
from typing import Any

MARK = "tip:"


def set_tip(artist: Any, text: str) -> None:
    """Give an artist its tip."""
    artist.set_gid(MARK + text)


def with_tips(svg: str) -> str:
    """The SVG with tips as titles instead of ids."""

    def titled(match: re.Match[str]) -> str:
        # matplotlib writes an id as an attribute: it is escaped once already.
        return f"<g><title>{html.escape(html.unescape(match.group(1)), quote=False)}</title>"

    return re.sub(rf'<g id="{MARK}([^"]*)">', titled, svg)
