"""A small folded car defined by hand: a box beam with two caps and one servo."""

import itertools
import math

import numpy as np

from foldcar.car.folded.model import Crease, EdgeRef, Face, FoldedCar, Hole, Join, Mount, Piece, PlacedPiece, Pose
from foldcar.car.parts.catalogue import catalogue

LENGTH_MM, WIDTH_MM, HEIGHT_MM, FLAP_MM, THICKNESS_MM = 60.0, 40.0, 30.0, 8.0, 0.25
QUARTER = math.pi / 2


def rectangle(name: str, along: float, across: float, holes: tuple[Hole, ...] = ()) -> Face:
    return Face(name, ((0, 0), (along, 0), (along, across), (0, across)), holes, label=name)


def tab(name: str, length: float) -> Face:
    """A mitred tab whose edge 0 is the fold."""
    return Face(name, ((0, 0), (length, 0), (length - 4, FLAP_MM), (4, FLAP_MM)), role="tab")


def hole_in_side() -> Hole:
    """The servo's opening."""
    return Hole("opening", "opening", ((10, 8), (33.4, 8), (33.4, 20.7), (10, 20.7)))


def beam() -> Piece:
    """Floor, side, lid, side and flap in a row; edges 2 of each meet edges 0 of the next."""
    faces = (
        rectangle("floor", LENGTH_MM, WIDTH_MM),
        rectangle("left side", LENGTH_MM, HEIGHT_MM, (hole_in_side(),)),
        rectangle("lid", LENGTH_MM, WIDTH_MM),
        rectangle("right side", LENGTH_MM, HEIGHT_MM),
        tab("flap", LENGTH_MM),
    )
    creases = tuple(
        Crease(f"fold {i}", EdgeRef(a.name, 2), EdgeRef(b.name, 0), QUARTER)
        for i, (a, b) in enumerate(itertools.pairwise(faces))
    )
    return Piece("beam", "Beam", faces, creases, THICKNESS_MM)


def cap() -> Piece:
    """A wall with a tab on every edge, folded to the unprinted side."""
    wall = rectangle("wall", WIDTH_MM, HEIGHT_MM)
    lengths = (WIDTH_MM, HEIGHT_MM, WIDTH_MM, HEIGHT_MM)
    tabs = tuple(tab(f"tab {i}", length) for i, length in enumerate(lengths))
    creases = tuple(
        Crease(f"fold {i}", EdgeRef("wall", i), EdgeRef(face.name, 0), -QUARTER) for i, face in enumerate(tabs)
    )
    return Piece("cap", "Cap", (wall, *tabs), creases, THICKNESS_MM, count=2)


def pose(x: list[float], y: list[float], at: list[float]) -> Pose:
    """The frame with these x and y axes at a point."""
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = x, y, np.cross(x, y), at
    return tuple(tuple(float(value) for value in row) for row in matrix)  # type: ignore[return-value]


def folded_box() -> FoldedCar:
    """The box: printed sides inward for the beam, outward for the caps."""
    half_length, half_width, half_height = LENGTH_MM / 2, WIDTH_MM / 2, HEIGHT_MM / 2
    front = pose([0, 1, 0], [0, 0, 1], [half_length, -half_width, -half_height])
    rear = pose([0, -1, 0], [0, 0, 1], [-half_length, half_width, -half_height])
    floor = pose([1, 0, 0], [0, 1, 0], [-half_length, -half_width, -half_height])
    middle = pose([1, 0, 0], [0, 1, 0], [0, half_width - 11.5, 0])
    servo = Mount("FS90R servo", "left servo", "segment0", middle, (23.2, 22.0, 12.5), 0.009, "left side")
    return FoldedCar(
        pieces=(beam(), cap()),
        placed=(
            PlacedPiece("beam", 0, "segment0", floor),
            PlacedPiece("cap", 0, "segment0", front),
            PlacedPiece("cap", 1, "segment0", rear),
        ),
        joins=(
            Join(1, "lap", "beam", EdgeRef("flap", 0), "beam", EdgeRef("floor", 0), LENGTH_MM),
            Join(2, "tab", "cap", EdgeRef("tab 0", 0), "beam", EdgeRef("floor", 1), WIDTH_MM),
        ),
        mounts=(servo,),
        axles=(),
        hinges=(),
        wires=(),
        parts=catalogue(),
    )
