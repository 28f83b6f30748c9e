"""Facets of film between two discs, with hooks on their edges that hold the discs.

A facet's frame: x along the strip, y across it from the inner disc to the outer one, z towards the axle. Lengths in
millimetres.
"""

from dataclasses import dataclass
from itertools import pairwise

from foldcar.car.folded.model import Point

DEPTH_MM = 2.5
# The tip of a hook is shorter than its head by this on each hooking side, so that it finds its slot.
TAPER_MM = 1.0


@dataclass(frozen=True)
class Hook:
    """A neck that passes a disc over ``reach_mm``, and a head that reaches beyond it to the left, the right or both."""

    neck_mm: float
    left_mm: float
    right_mm: float
    reach_mm: float

    def path(self, x: float, y: float, out: float) -> tuple[list[Point], tuple[Point, Point]]:
        """Its points from left to right for a neck at ``x`` on an edge at ``y``, and its tip; ``out`` is -1 or 1."""
        near, far = y + out * self.reach_mm, y + out * (self.reach_mm + DEPTH_MM)
        a, b = x - self.neck_mm / 2, x + self.neck_mm / 2
        left, right = a - self.left_mm, b + self.right_mm
        tip = ((left + TAPER_MM * (self.left_mm > 0), far), (right - TAPER_MM * (self.right_mm > 0), far))
        points = [(a, y), *[(a, near), (left, near)][: 2 if self.left_mm else 0], *tip]
        points += [*[(right, near), (b, near)][: 2 if self.right_mm else 0], (b, y)]
        return points, tip


def facet(
    length_mm: float,
    width_mm: float,
    hooks: tuple[Hook | None, Hook | None] = (None, None),
    at_mm: float = 0.0,
    base_mm: float = 0.0,
) -> tuple[list[Point], list[str]]:
    """The outline of a facet and the names of its edges, counter-clockwise from the origin.

    Edges ``next`` and ``last`` lie at x = length and 0. ``hooks`` for the inner and outer disc stand at x = ``at_mm``,
    their tips are ``inner tip`` and ``outer tip``; without an inner one that edge is ``inner``. With ``base_mm`` the
    middle of ``last`` is an edge ``base``, so long.
    """
    named: dict[tuple[Point, Point], str] = {}
    points: list[Point] = [(0.0, 0.0)]
    inner, outer = hooks
    if inner is not None:
        path, tip = inner.path(at_mm, 0.0, -1.0)
        points += path
        named[tip] = "inner tip"
    else:
        named[points[0], (length_mm, 0.0)] = "inner"
    points += [(length_mm, 0.0), (length_mm, width_mm)]
    named[points[-2], points[-1]] = "next"
    if outer is not None:
        path, tip = outer.path(at_mm, width_mm, 1.0)
        points += reversed(path)
        named[tip[1], tip[0]] = "outer tip"
    points.append((0.0, width_mm))
    if base_mm:
        ends = ((0.0, (width_mm + base_mm) / 2), (0.0, (width_mm - base_mm) / 2))
        points += ends
        named[ends] = "base"
    else:
        named[points[-1], points[0]] = "last"
    edges = pairwise([*points, points[0]])
    return points, [named.get(edge, str(i)) for i, edge in enumerate(edges)]
