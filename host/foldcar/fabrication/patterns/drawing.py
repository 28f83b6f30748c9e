"""The geometry of a sheet: polylines and circles on layers, in millimetres, x right and y up from a corner.

Writers take it and readers of the written files return it, so that both can be compared.
"""

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from foldcar.fabrication.patterns.layers import LayerName

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Path:
    """A polyline; a closed one does not repeat its first point."""

    layer: LayerName
    points_mm: tuple[Point, ...]
    closed: bool = False

    @property
    def segments(self) -> Iterator[tuple[Point, Point]]:
        """Its straight segments in order."""
        yield from itertools.pairwise(self.points_mm)
        if self.closed:
            yield self.points_mm[-1], self.points_mm[0]

    @property
    def length_mm(self) -> float:
        """Length along the line (mm)."""
        return sum(math.dist(a, b) for a, b in self.segments)

    def moved(self, motion: "Motion") -> "Path":
        """The line after a motion."""
        return replace(self, points_mm=tuple(motion.apply(p) for p in self.points_mm))


@dataclass(frozen=True, slots=True)
class Circle:
    """A full circle."""

    layer: LayerName
    center_mm: Point
    radius_mm: float

    @property
    def length_mm(self) -> float:
        """Its circumference (mm)."""
        return 2 * math.pi * self.radius_mm

    def moved(self, motion: "Motion") -> "Circle":
        """The circle after a motion."""
        return replace(self, center_mm=motion.apply(self.center_mm))


Shape = Path | Circle


@dataclass(frozen=True, slots=True)
class Motion:
    """A rotation about the origin by ``quarter_turns`` · 90°, counter-clockwise, followed by a shift."""

    quarter_turns: int = 0
    shift_mm: Point = (0.0, 0.0)

    def apply(self, point: Point) -> Point:
        """The image of ``point`` (mm)."""
        x, y = point
        for _ in range(self.quarter_turns % 4):
            x, y = -y, x
        return x + self.shift_mm[0], y + self.shift_mm[1]


@dataclass(frozen=True, slots=True)
class Sheet:
    """One sheet of film, whose title is ``film``. Each group has the shapes that move together: a piece with its labels.

    ``dashed``: folds are drawn in their dashed line types, because nothing is cut or scored along them by a machine.
    ``tab_gap_mm`` is the width of the gaps in outlines that leave holding tabs, 0 if outlines are closed.
    """

    name: str
    width_mm: float
    height_mm: float
    groups: tuple[tuple[Shape, ...], ...]
    dashed: bool = False
    film: str = ""
    tab_gap_mm: float = 0.0

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """Everything drawn on it."""
        return tuple(itertools.chain.from_iterable(self.groups))

    def on(self, layer: LayerName) -> Iterator[tuple[Shape, ...]]:
        """Each group's shapes on one layer, in order."""
        for group in self.groups:
            shapes = tuple(shape for shape in group if shape.layer == layer)
            if shapes:
                yield shapes


def bounds(shapes: Iterable[Shape]) -> tuple[float, float, float, float]:
    """Minimum x and y, maximum x and y of the shapes (mm)."""
    points = []
    for shape in shapes:
        if isinstance(shape, Circle):
            (x, y), r = shape.center_mm, shape.radius_mm
            points += [(x - r, y - r), (x + r, y + r)]
        else:
            points += shape.points_mm
    xs, ys = zip(*points, strict=True)
    return min(xs), min(ys), max(xs), max(ys)
