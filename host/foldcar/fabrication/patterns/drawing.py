"""The geometry of a sheet: polylines and circles on layers, in millimetres, x right and y up from a corner.

Names, colours and line weights of layers are equal in all file formats. The colours are of LightBurn's palette
(docs.lightburnsoftware.com, Color Palette), so that LightBurn gives each layer its own settings. They are also those of
Origami Simulator: mountain red, valley blue, outline black. Layers are written in the order of cutting, outlines last,
so that pieces do not move before.
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

LayerName = Literal["LABEL", "QR_CODE", "SCORE", "FOLD_MOUNTAIN", "FOLD_VALLEY", "CUT_INNER", "CUT_OUTER"]
Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Layer:
    """A layer: ``rgb`` is its colour, ``lightburn`` its number in LightBurn's palette, ``width_mm`` the line weight.

    ``aci`` is the nearest AutoCAD colour index; ``line_type`` and ``dashes_mm`` (line and gap by turns) are those of
    folds that are drawn.
    """

    name: LayerName
    rgb: tuple[int, int, int]
    lightburn: str
    aci: int
    width_mm: float
    line_type: str = "CONTINUOUS"
    dashes_mm: tuple[float, ...] = ()

    @property
    def hex(self) -> str:
        """The colour as in SVG: #rrggbb."""
        return "#{:02x}{:02x}{:02x}".format(*self.rgb)

    @property
    def cut(self) -> bool:
        """Whether its lines are cut through the film."""
        return self.name.startswith("CUT")

    @property
    def fold(self) -> bool:
        """Whether its lines, or the dashes on them, are folds."""
        return self.name.startswith("FOLD")


# A module of the QR code is as wide as its layer's lines: phones read 0.5 mm and more.
LAYERS: dict[LayerName, Layer] = {
    layer.name: layer
    for layer in (
        Layer("LABEL", (128, 128, 128), "C16", 8, 0.18),
        Layer("QR_CODE", (160, 0, 160), "C15", 212, 0.6),
        Layer("SCORE", (255, 128, 0), "C05", 30, 0.18),
        Layer("FOLD_MOUNTAIN", (255, 0, 0), "C02", 1, 0.18, "DASHDOT", (3.0, 1.0, 0.3, 1.0)),
        Layer("FOLD_VALLEY", (0, 0, 255), "C01", 5, 0.18, "DASHED", (3.0, 1.5)),
        Layer("CUT_INNER", (0, 160, 0), "C11", 92, 0.25),
        Layer("CUT_OUTER", (0, 0, 0), "C00", 7, 0.25),
    )
}


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
        """Return the line after a motion."""
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
        """Return the circle after a motion."""
        return replace(self, center_mm=motion.apply(self.center_mm))


Shape = Path | Circle


@dataclass(frozen=True, slots=True)
class Motion:
    """A rotation about the origin by ``quarter_turns`` · 90°, counter-clockwise, followed by a shift."""

    quarter_turns: int = 0
    shift_mm: Point = (0.0, 0.0)

    def apply(self, point: Point) -> Point:
        """Return the image of ``point`` (mm)."""
        x, y = point
        for _ in range(self.quarter_turns % 4):
            x, y = -y, x
        return x + self.shift_mm[0], y + self.shift_mm[1]


@dataclass(frozen=True, slots=True)
class Sheet:
    """One sheet of film, whose title is ``film``. Each group has the shapes that move together: a piece with its labels.

    ``dashed``: folds are drawn in their dashed line types, because nothing is cut or scored along them by a machine.
    """

    name: str
    width_mm: float
    height_mm: float
    groups: tuple[tuple[Shape, ...], ...]
    dashed: bool = False
    film: str = ""

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """Everything drawn on it."""
        return tuple(itertools.chain.from_iterable(self.groups))

    @property
    def layers(self) -> Iterator[tuple[Layer, list[tuple[Shape, ...]]]]:
        """Yield every layer in the order of cutting, with its cuts in their order."""
        return ((layer, list(self.cuts_on(layer.name))) for layer in LAYERS.values())

    def cuts_on(self, layer: LayerName) -> Iterator[tuple[Shape, ...]]:
        """Yield the cuts of a layer in the order in which a machine makes them.

        A cut is a circle, a closed line, or all open lines of a group of shapes. Small cuts come first, because large
        cuts loosen the film. For this, cuts are divided into classes of size. In a class, the next cut is the one that
        starts nearest to the end of the last cut, so that the machine moves little. The machine begins at the lower left
        corner of the sheet, where the origin is.
        """
        cuts_by_size: dict[int, list[tuple[Shape, ...]]] = {}
        for cut in self._cuts(layer):
            cuts_by_size.setdefault(_size_class(cut), []).append(cut)
        position = (0.0, 0.0)
        for _, remaining in sorted(cuts_by_size.items()):
            while remaining:
                distances = []
                for cut in remaining:
                    start, _ = _ends(cut[0])
                    distances.append(math.dist(position, start))
                nearest_cut = remaining.pop(distances.index(min(distances)))
                _, position = _ends(nearest_cut[-1])
                yield nearest_cut

    def _cuts(self, layer: LayerName) -> Iterator[tuple[Shape, ...]]:
        """Yield the cuts of a layer: all open lines of a group of shapes together, each circle and each closed line."""
        for group in self.groups:
            shapes = [shape for shape in group if shape.layer == layer]
            open_lines = tuple(shape for shape in shapes if isinstance(shape, Path) and not shape.closed)
            if open_lines:
                yield open_lines
            for shape in shapes:
                if isinstance(shape, Circle) or shape.closed:
                    yield (shape,)


def _size_class(cut: Sequence[Shape]) -> int:
    """Return a number for the size of a cut, the larger side of its bounding box: n for sizes from 2^(n-1) to 2^n mm."""
    x0, y0, x1, y1 = bounds(cut)
    _, exponent = math.frexp(max(x1 - x0, y1 - y0))
    return exponent


def _ends(shape: Shape) -> tuple[Point, Point]:
    """Return where the cut of a shape starts and ends (mm); a circle's is its rightmost point."""
    if isinstance(shape, Circle):
        right = shape.center_mm[0] + shape.radius_mm, shape.center_mm[1]
        return right, right
    return shape.points_mm[0], shape.points_mm[0 if shape.closed else -1]


def bounds(shapes: Iterable[Shape]) -> tuple[float, float, float, float]:
    """Return the bounding box of the shapes: minimum x and y, maximum x and y (mm)."""
    points = []
    for shape in shapes:
        if isinstance(shape, Circle):
            (x, y), radius = shape.center_mm, shape.radius_mm
            points += [(x - radius, y - radius), (x + radius, y + radius)]
        else:
            points += shape.points_mm
    xs, ys = zip(*points, strict=True)
    return min(xs), min(ys), max(xs), max(ys)
