"""Draws faces in space as SVG: hidden parts removed, faces shaded, folds dashed, numbers.

Input: a Shape, a Camera, marks, arrows, the facets in the background. Output: a self-contained SVG element as
text, in millimetres of the picture.
"""

import html
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import shapely
from markupsafe import Markup
from shapely.geometry.base import BaseGeometry

from foldcar.fabrication.assembly.facets import PictureContent
from foldcar.fabrication.assembly.hidden_surfaces import Camera, Vector, VisibleFacet, visible_facets

# RGB (0 to 255) of the printed and the other side.
COLOURS = {
    "film": ((250, 246, 235), (205, 217, 230)),
    "tyre": ((118, 122, 130), (96, 100, 108)),
    "servo": ((88, 138, 196), (88, 138, 196)),
    "board": ((92, 160, 110), (92, 160, 110)),
    "battery": ((214, 172, 92), (214, 172, 92)),
    "other": ((190, 190, 190), (190, 190, 190)),
}
# Colour, dashes in line widths, width in hundredths of the picture's larger side.
LINES = {
    "cut": ("#222222", None, 0.28),
    "mountain": ("#c2272d", (5, 2, 1, 2), 0.32),
    "valley": ("#0b62a8", (3.5, 2), 0.32),
    "flat": ("#777777", (1, 2), 0.24),
}
# Colour of parts that are in place already: fraction of the way to a pale grey.
FADED, PALE = 0.62, np.array((243, 244, 246))
ARROWS = {"way": ("#c8102e", 0.6), "tool": ("#6a3d9a", 0.45)}
# Lines along the common edge of two faces lie on the border of their visible regions: tolerance for drawing them.
EDGE_SLACK_MM = 0.08
# Fractions of the picture's larger side.
MARGIN, MIN_ARROW = 0.04, 0.012
# Height of an arrow's text as a fraction of the larger side, width of a letter as a fraction of that height.
TEXT, LETTER = 0.03, 0.6
# How far the base line of an arrow's text lies below the start of the arrow, in heights of the text: for a text above the
# start and for one below it.
ABOVE_START, BELOW_START = -0.4, 1.1
# Width of the white edge of an arrow's text, as a fraction of the larger side.
TEXT_EDGE = 0.008
# The brightness of a face without light, and what full light adds to it.
AMBIENT, DIRECT = 0.72, 0.28
# Width of the stroke that closes the gaps between faces, as a fraction of the larger side.
GAP_STROKE = 0.0015
# An arrow's tip: its length as a fraction of the larger side, without and for each unit of the arrow's width; its largest
# length as a fraction of the arrow's last line; half of its width as a fraction of its length; and how far the line
# reaches into the tip, so that no gap shows.
TIP, TIP_PER_WIDTH, MAX_TIP, HALF_TIP_WIDTH, INTO_TIP = 0.008, 0.025, 0.6, 0.42, 0.2
# Widths of the white edges of an arrow's line and tip, in widths of its line.
LINE_EDGE, TIP_EDGE = 2.2, 0.5
# A mark is a number in a circle: radius of the circle up to two digits and above, and height of the number, as fractions
# of the larger side; width of the circle's line as a fraction of its radius.
MARK_RADIUS, WIDE_MARK_RADIUS, MARK_TEXT, MARK_LINE = 0.017, 0.023, 0.024, 0.12
# Minimum distance of two marks as a fraction of the larger side, a little more than their diameter.
MARKS_APART = 0.036
# Computed distances carry errors of rounding. Points that are nearer than the second one are the same.
ROUNDING, SAME_POINT = 1e-9, 1e-6


@dataclass(frozen=True)
class DrawnText:
    """A short text at a point of the facet ``key``, drawn if that point is visible."""

    text: str
    at_mm: Vector
    key: str


@dataclass(frozen=True)
class Arrow:
    """The path of a part or a tool: points (n, 3) in mm.

    It is drawn over everything, and ``text`` stands at its start.
    """

    points_mm: Vector
    kind: Literal["way", "tool"] = "way"
    text: str = ""


@dataclass(frozen=True)
class Drawing:
    """One picture. It is drawn when its SVG is read.

    ``enlarged`` scales the marks of a picture that is shown small. Facets whose keys are in ``faded`` are drawn
    paler.
    """

    shape: PictureContent
    view: Camera
    title: str
    marks: Sequence[DrawnText] = ()
    enlarged: float = 1.0
    faded: Collection[str] = ()
    arrows: Sequence[Arrow] = ()
    caption: str = ""

    @cached_property
    def visible(self) -> list[VisibleFacet]:
        """The facets that are at least partly visible, farthest first."""
        return visible_facets(self.shape.facets, self.view)

    @cached_property
    def svg(self) -> Markup:
        """The SVG element as markup that a template does not escape; its viewBox (mm) fits faces, arrows and texts.

        In SVG y points down, so y of the picture is negated.
        """
        view, facets = self.view, self.visible
        regions = [visible.region for visible in facets]
        regions += [shapely.linestrings(view.flat(arrow.points_mm)) for arrow in self.arrows]
        left, low, right, high = shapely.total_bounds(regions)
        # All sizes of lines and texts are fractions of the picture's larger side, so that pictures look alike.
        size = max(right - left, high - low)
        for arrow in self.arrows:
            text_width = len(arrow.text) * LETTER * TEXT * size
            start_u, _ = view.flat(arrow.points_mm)[0]
            # A text stands to the left or to the right of its arrow's start. There must be room on both sides.
            left = min(left, start_u - text_width)
            right = max(right, start_u + text_width)
        margin = MARGIN * size
        width, height = right - left + 2 * margin, high - low + 2 * margin
        box = f"{left - margin:.2f} {-high - margin:.2f} {width:.2f} {height:.2f}"
        elements = [_face(visible, size, visible.facet.key in self.faded) for visible in facets]
        elements += _lines(self.shape, facets, view, size)
        elements += [_arrow(arrow, view, size) for arrow in self.arrows]
        elements += _marks(self.marks, facets, view, size * self.enlarged)
        title = f"<title>{html.escape(self.title)}</title>"
        head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{box}" role="img">{title}'
        return Markup("".join([head, *elements, "</svg>"]))


def _face(seen: VisibleFacet, size: float, faded: bool) -> str:
    """Return a visible facet as a filled path. Its brightness depends on the light, and it is paler if ``faded``.

    ``size`` is the picture's larger side (mm).
    """
    front_colour, back_colour = COLOURS[seen.facet.material]
    base = np.array(front_colour if seen.front else back_colour)
    if faded:
        base = base + (PALE - base) * FADED
    red, green, blue = (base * (AMBIENT + DIRECT * seen.lit)).astype(int)
    colour = f"#{red:02x}{green:02x}{blue:02x}"
    # The thin stroke closes the gaps that renderers leave between neighbours.
    return (
        f'<path d="{_path(seen.region)}" fill="{colour}" fill-rule="evenodd" '
        f'stroke="{colour}" stroke-width="{size * GAP_STROKE:.3f}"/>'
    )


def _lines(shape: PictureContent, seen: Sequence[VisibleFacet], view: Camera, size: float) -> list[str]:
    """Return the visible parts of edges and creases as stroked paths, one path for each kind of line.

    A line is visible where it lies in a visible region of one of its facets, or not farther than EDGE_SLACK_MM from
    it. ``size`` is the larger side of the picture (mm).
    """
    visible = {visible_facet.facet.key: visible_facet for visible_facet in seen}
    # Edges of the same kind and facets are cut at once, which is faster.
    edges_by_keys: dict[tuple[str, tuple[str, ...]], list[Vector]] = {}
    for line in shape.lines:
        keys = tuple(key for key in line.keys if key in visible)
        if keys:
            edges_by_keys.setdefault((line.kind, keys), []).append(line.ends_mm)
    # The data of the path of each kind of line.
    path_data = dict.fromkeys(LINES, "")
    for (kind, keys), edges in edges_by_keys.items():
        # The places (edges, 2 ends, 2) in the picture. Edges that are seen end-on, as points, are left out.
        ends = view.flat(np.concatenate(edges)).reshape(-1, 2, 2)
        extents = np.ptp(ends, axis=1).max(axis=1)
        visible_lines = _visible_parts(ends[extents > EDGE_SLACK_MM], [visible[key] for key in keys])
        path_data[kind] += "".join(_polyline(line) for line in visible_lines)
    return [_stroked_path(kind, data, size) for kind, data in path_data.items() if data]


def _visible_parts(edges: Vector, facets: Sequence[VisibleFacet]) -> Iterable[Vector]:
    """Return the parts of edges, (edges, 2 ends, 2), that are visible beside one of these facets, as lines (n, 2)."""
    if any(facet.whole for facet in facets):
        return edges
    regions = [facet.region.buffer(EDGE_SLACK_MM, quad_segs=1) for facet in facets]
    all_edges = shapely.multilinestrings(shapely.linestrings(edges))
    parts = shapely.get_parts(shapely.intersection(all_edges, shapely.union_all(regions)))
    return [shapely.get_coordinates(part) for part in parts if part.length > 0]


def _stroked_path(kind: str, data: str, size: float) -> str:
    """Return the SVG of all lines of one kind. ``data`` is that of the path, and ``size`` the picture's size (mm)."""
    colour, dashes, width_percent = LINES[kind]
    width_mm = size * width_percent / 100
    dashed = ""
    if dashes is not None:
        lengths = " ".join(f"{dash * width_mm:.3f}" for dash in dashes)
        dashed = f' stroke-dasharray="{lengths}"'
    return (
        f'<path d="{data}" fill="none" stroke="{colour}" stroke-width="{width_mm:.3f}" stroke-linecap="round"{dashed}/>'
    )


def _marks(marks: Sequence[DrawnText], seen: Sequence[VisibleFacet], view: Camera, size: float) -> list[str]:
    """Return the SVG of the marks on visible faces: numbers of joins in circles.

    Circles that would overlap are moved apart. ``size`` is the picture's larger side (mm), times the enlargement of
    marks.
    """
    regions = {visible_facet.facet.key: visible_facet.region for visible_facet in seen}
    elements: list[str] = []
    placed: list[Vector] = []
    for mark in marks:
        point = view.flat(mark.at_mm[None, :])[0]
        region = regions.get(mark.key)
        if region is None or not region.buffer(EDGE_SLACK_MM).covers(shapely.Point(*point)):
            continue
        point = _moved_clear(point, placed, size * MARKS_APART)
        placed.append(point)
        u, v = point
        radius = size * (MARK_RADIUS if len(mark.text) < 3 else WIDE_MARK_RADIUS)
        elements.append(
            f'<circle cx="{u:.2f}" cy="{-v:.2f}" r="{radius:.2f}" fill="#ffffff" stroke="#222222" '
            f'stroke-width="{radius * MARK_LINE:.3f}"/>'
            f'<text x="{u:.2f}" y="{-v:.2f}" font-size="{size * MARK_TEXT:.2f}" text-anchor="middle" dy=".35em" '
            f'fill="#222222">{html.escape(mark.text)}</text>'
        )
    return elements


def _moved_clear(point: Vector, placed: Sequence[Vector], min_distance: float) -> Vector:
    """Move a point (2,) away from the points that are already placed, until it has the minimum distance from each.

    The point is moved away from the nearest of them. Then it may be too near to another one, so this is repeated, at
    most once for each point.
    """
    for _ in placed:
        nearest = min(placed, key=lambda other: float(np.linalg.norm(point - other)))
        offset = point - nearest
        distance = float(np.linalg.norm(offset))
        if distance > min_distance - ROUNDING:
            break
        # If the two points coincide, any direction will do: to the right.
        coincide = distance <= SAME_POINT
        direction = np.array([1.0, 0.0]) if coincide else offset / distance
        point = nearest + direction * min_distance
    return point


def _arrow(arrow: Arrow, view: Camera, size: float) -> str:
    """Return the SVG of an arrow with its text. It has a white edge, so that it is visible on any colour.

    A very short arrow is not drawn: the result is "". ``size`` is the picture's larger side (mm).
    """
    points = view.flat(arrow.points_mm)
    colour, width_percent = ARROWS[arrow.kind]
    line_width = size * width_percent / 100
    last_section = points[-1] - points[-2]
    last_length = float(np.linalg.norm(last_section))
    if last_length < MIN_ARROW * size:
        return ""
    # The tip is a triangle. ``tip`` is the vector from the middle of its base to its point.
    tip_length = min(size * (TIP + TIP_PER_WIDTH * width_percent), MAX_TIP * last_length)
    tip = last_section / last_length * tip_length
    tip_base = points[-1] - tip
    half_width = HALF_TIP_WIDTH * np.array([-tip[1], tip[0]])
    line_path = _polyline(np.vstack([points[:-1], tip_base + INTO_TIP * tip]))
    tip_path = _polyline(np.stack([points[-1], tip_base + half_width, tip_base - half_width])) + "Z"
    label = _arrow_label(arrow.text, points, size, colour) if arrow.text else ""
    return (
        f'<path d="{line_path}" fill="none" stroke="#ffffff" stroke-width="{LINE_EDGE * line_width:.3f}"/>'
        f'<path d="{line_path}" fill="none" stroke="{colour}" stroke-width="{line_width:.3f}"/>'
        f'<path d="{tip_path}" fill="{colour}" stroke="#ffffff" stroke-width="{TIP_EDGE * line_width:.3f}"/>' + label
    )


def _arrow_label(text: str, points: Vector, size: float, colour: str) -> str:
    """Return the SVG of an arrow's text. ``points`` (n, 2) are those of the arrow, and ``size`` is the picture's size.

    The text stands beside the start of the arrow, on the side that is away from the tip.
    """
    u, v = points[0]
    # From the tip to the start.
    right, up = points[0] - points[-1]
    # If the arrow comes mainly from the left, its text is at the left of its start, and ends there.
    comes_from_left = right < -abs(up) / 2
    anchor = "end" if comes_from_left else "start"
    # How far the text's base line is below the start of the arrow, in units of the font size. In SVG, dy is positive
    # downwards.
    points_down = up > 0
    line_shift = ABOVE_START if points_down else BELOW_START
    return (
        f'<text x="{u:.2f}" y="{-v:.2f}" dy="{line_shift:g}em" font-size="{size * TEXT:.2f}" '
        f'fill="{colour}" text-anchor="{anchor}" stroke="#ffffff" stroke-width="{size * TEXT_EDGE:.2f}" '
        'paint-order="stroke">'
        f"{html.escape(text)}</text>"
    )


def _path(region: BaseGeometry) -> str:
    """Return the data of an SVG path with the outlines and the holes of a region's polygons."""
    rings = []
    for polygon in shapely.get_parts(region):
        if polygon.geom_type == "Polygon":
            rings += [polygon.exterior, *polygon.interiors]
    return "".join(_polyline(shapely.get_coordinates(ring)) + "Z" for ring in rings)


def _polyline(points: Vector) -> str:
    """Return the data of an SVG path through these points (n, 2). In SVG, y points down."""
    return "M" + "L".join(f"{u:.2f},{-v:.2f}" for u, v in points.tolist())
