"""A small folded car defined by hand with every feature of sheets: a beam, caps, discs, a rim."""

import itertools
import math

from foldcar.car.components.shape import on_circle
from foldcar.car.folded.model import (
    Crease,
    EdgeRef,
    Face,
    FoldedCar,
    Hole,
    Join,
    Piece,
    Point,
)
from foldcar.car.parts.catalogue import catalogue

LENGTH, WIDTH, HEIGHT, FLAP, TAB = 120.0, 60.0, 30.0, 10.0, 8.0
RIGHT_ANGLE = math.pi / 2
THICKNESS = 0.25


def rectangle(width: float, height: float) -> tuple[Point, ...]:
    """Edges 0 bottom, 1 right, 2 top, 3 left."""
    return ((0.0, 0.0), (width, 0.0), (width, height), (0.0, height))


def tab(length: float, depth: float = TAB) -> tuple[Point, ...]:
    """A mitred tab; edge 0 is the fold."""
    return ((0.0, 0.0), (length, 0.0), (length - depth, depth), (depth, depth))


def polygon(radius: float, corners: int, center: Point = (0.0, 0.0)) -> list[Point]:
    return on_circle(radius, (2 * math.pi * i / corners for i in range(corners)), center)


def circle(name: str, x: float, y: float, diameter: float) -> Hole:
    return Hole(name, "screw", tuple(polygon(diameter / 2, 24, (x, y))), diameter, (x, y))


def beam() -> Piece:
    """Floor, side, lid, side, flap: one above the other in the flat, folded up by right angles."""
    opening = Hole("servo", "opening", ((20.0, 8.0), (43.4, 8.0), (43.4, 20.7), (20.0, 20.7)))
    faces = (
        Face("floor", rectangle(LENGTH, WIDTH)),
        Face("left", rectangle(LENGTH, HEIGHT), (opening, circle("screw", 50.0, 15.0, 2.0))),
        Face("lid", rectangle(LENGTH, WIDTH)),
        Face("right", rectangle(LENGTH, HEIGHT)),
        Face("flap", tab(LENGTH, FLAP), role="tab"),
    )
    names = [face.name for face in faces]
    creases = tuple(Crease(f"{a} {b}", EdgeRef(a, 2), EdgeRef(b, 0), RIGHT_ANGLE) for a, b in itertools.pairwise(names))
    return Piece("beam", "beam", faces, creases, THICKNESS)


def cap() -> Piece:
    """A panel with a mitred tab at each edge, folded away from the printed side."""
    panel = Face("cap", rectangle(WIDTH, HEIGHT))
    tabs = tuple(Face(f"tab {i}", tab((WIDTH, HEIGHT)[i % 2]), role="tab") for i in range(4))
    creases = tuple(Crease(f"fold {i}", EdgeRef("cap", i), EdgeRef(f"tab {i}", 0), -RIGHT_ANGLE) for i in range(4))
    return Piece("cap", "cap", (panel, *tabs), creases, THICKNESS, count=2)


def disc(radius: float) -> Piece:
    """A wheel's disc of 96 corners with a hole in the middle."""
    outline = tuple(polygon(radius, 96))
    return Piece("disc", "disc", (Face("disc", outline, (circle("axle", 0.0, 0.0, 7.4),)),), (), THICKNESS, count=4)


def rim(radius: float, width: float = 12.0, teeth: int = 40) -> Piece:
    """A strip once around the disc: facets in a row, each with a tooth at both sides."""
    facet = 2 * radius * math.sin(math.pi / teeth)
    faces = [Face(f"rim {i}", rectangle(facet, width), role="rim") for i in range(teeth)]
    creases = [
        Crease(f"bend {i}", EdgeRef(f"rim {i}", 1), EdgeRef(f"rim {i + 1}", 3), 2 * math.pi / teeth, bend=True)
        for i in range(teeth - 1)
    ]
    for i in range(teeth):
        for edge in (0, 2):
            tooth = Face(f"tooth {i} {edge}", tab(facet, 2.0), role="tab")
            faces.append(tooth)
            creases.append(Crease(tooth.name, EdgeRef(f"rim {i}", edge), EdgeRef(tooth.name, 0), RIGHT_ANGLE))
    return Piece("rim", "rim", tuple(faces), tuple(creases), THICKNESS, count=2)


def folded_box(radius: float = 40.0) -> FoldedCar:
    """All pieces, with the joins of the beam's seam and of the caps."""
    joins = [Join(1, "lap", "beam", EdgeRef("flap", 2), "beam", EdgeRef("floor", 0), LENGTH)]
    ends = (("floor", 0), ("left", 1), ("lid", 2), ("right", 3))
    for number, (face, index) in enumerate(ends, 2):
        joins.append(
            Join(number, "tab", "cap", EdgeRef(f"tab {index}", 0), "beam", EdgeRef(face, 1), (WIDTH, HEIGHT)[index % 2])
        )
    joins += [Join(6, "rim", "rim", EdgeRef(f"tooth {i} 0", 0), "disc", EdgeRef("disc", i), 1.0) for i in range(40)]
    return FoldedCar((beam(), cap(), disc(radius), rim(radius)), (), tuple(joins), (), (), (), (), catalogue())
