"""Whether convex solids collide while they move, and a way out of what surrounds them.

Input: Blocks that move, Blocks that stand. A convex solid that is translated sweeps the convex hull of both ends, so
nothing is stepped over, however thin. Lengths in mm.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import fcl
import numpy as np
from numpy.typing import NDArray

from foldcar.car.folded.pose import translation
from foldcar.car.proof.blocks import Block, Blocks, Points, hull
from foldcar.car.proof.step import Vector

# How far a first move goes, if a second one is needed.
FIRST_MM = (1.0, 2.0, 4.0, 8.0, 15.0, 25.0, 40.0, 60.0)
# A way ends this far beyond everything.
CLEAR_MM = 20.0
AXES: tuple[Vector, ...] = ((0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, -1))


@dataclass(frozen=True)
class Way:
    """A way out as straight moves, or, if there is none, what is met in each direction that was tried."""

    moves_mm: tuple[Vector, ...] | None
    met: tuple[tuple[Vector, str], ...] = ()
    stuck: str = ""


# Pairs of titles that may overlap: what is joined.
Ignored = frozenset[tuple[str, str]]
NOTHING: Ignored = frozenset()


def hit(moving: Blocks, standing: Blocks, move_mm: Vector = (0.0, 0.0, 0.0), ignored: Ignored = NOTHING) -> str | None:
    """What the solids meet first while they are moved, or None."""
    return swept(moving, moving.moved(translation(*move_mm)) if any(move_mm) else moving, standing, ignored)


def swept(start: Blocks, end: Blocks, standing: Blocks, ignored: Ignored = NOTHING) -> str | None:
    """What the hulls of the solids at two places meet, or None; the nearest first."""
    if not start.blocks or not standing.blocks:
        return None
    pairs = _near(np.minimum(start.low, end.low), np.maximum(start.high, end.high), standing)
    first, second = pairs.T
    # Distances of the bounds at the start: the nearest obstacle is named.
    gaps = np.maximum(standing.low[second] - start.high[first], start.low[first] - standing.high[second])
    hulls: dict[int, fcl.CollisionObject] = {}
    for i, k in pairs[np.argsort(gaps.max(axis=1), kind="stable")].tolist():
        one: Block = start.blocks[i]
        obstacle: Block = standing.blocks[k]
        if (one.title, obstacle.title) in ignored:
            continue
        if i not in hulls:
            hulls[i] = one.solid if start is end else hull(np.vstack([one.corners_mm, end.blocks[i].corners_mm]))
        if fcl.collide(hulls[i], obstacle.solid):
            return obstacle.title
    return None


def _near(low: Points, high: Points, standing: Blocks) -> NDArray[np.intp]:
    """Index pairs (n, 2) of bounds that overlap: of the moving and of the standing solids."""
    # The few standing solids that reach into the bounds of all moving ones.
    some = np.flatnonzero(((standing.low <= high.max(axis=0)) & (standing.high >= low.min(axis=0))).all(axis=1))
    overlap = (low[:, None] <= standing.high[None, some]) & (high[:, None] >= standing.low[None, some])
    first, second = np.nonzero(overlap.all(axis=2))
    return np.column_stack([first, some[second]])


def way_out(
    moving: Blocks, standing: Blocks, own: Iterable[Vector] = (), ignored: Ignored = NOTHING, only_own: bool = False
) -> Way:
    """A straight way out, or two; tries the car's axes and those of the part (``own``), or ``only_own``, straight."""
    place = hit(moving, standing, ignored=ignored)
    if place is not None:
        return Way(None, stuck=place)
    met: list[tuple[Vector, str]] = []
    for direction, move in _shortest_first(moving, standing, own if only_own else (*AXES, *own)):
        obstacle = hit(moving, standing, move, ignored)
        if obstacle is None:
            return Way((move,))
        met.append((direction, obstacle))
    two = () if only_own else _two_moves(moving, standing, [direction for direction, _ in met], ignored)
    for first, second in two:
        return Way((first, second), tuple(met))
    return Way(None, tuple(met))


def _two_moves(
    moving: Blocks, standing: Blocks, directions: Sequence[Vector], ignored: Ignored
) -> Iterator[tuple[Vector, Vector]]:
    """Free ways of two straight moves, short first moves first."""
    ends: dict[Vector, Blocks] = {}
    for length in FIRST_MM:
        for direction in directions:
            if length > FIRST_MM[0] and direction not in ends:
                continue
            move = vector(np.array(direction) * length)
            if hit(moving, standing, move, ignored) is not None:
                ends.pop(direction, None)
                continue
            ends[direction] = moving.moved(translation(*move))
            for then in directions:
                if abs(np.dot(then, direction)) < 0.9:
                    out = _out(ends[direction], standing, then)
                    if hit(ends[direction], standing, out, ignored) is None:
                        yield move, out


def _shortest_first(moving: Blocks, standing: Blocks, several: Iterable[Vector]) -> list[tuple[Vector, Vector]]:
    """Directions, no two alike, and the moves that lead out along them; a way from above counts half its length."""
    directions: list[Vector] = []
    for one in several:
        if all(np.dot(one, other) < 0.999 for other in directions):
            directions.append(one)
    moves = [(direction, _out(moving, standing, direction)) for direction in directions]
    return sorted(moves, key=lambda pair: float(np.linalg.norm(pair[1])) * (0.5 if pair[0][2] > 0.999 else 1.0))


def _out(moving: Blocks, standing: Blocks, direction: Vector) -> Vector:
    """The move in a direction that takes the bounds of the moving solids clear of the standing ones'."""
    if not standing.blocks:
        return vector(np.array(direction) * CLEAR_MM)
    low, high = moving.low.min(axis=0), moving.high.max(axis=0)
    least, most = standing.low.min(axis=0), standing.high.max(axis=0)
    lengths = [
        (most[i] - low[i] if direction[i] > 0 else high[i] - least[i]) / abs(direction[i])
        for i in range(3)
        if abs(direction[i]) > 1e-6
    ]
    return vector(np.array(direction) * (max(0.0, min(lengths)) + CLEAR_MM))


def vector(values: NDArray[np.float64]) -> Vector:
    """The (3,) numbers of an array, zeros without a sign."""
    x, y, z = (float(value) + 0.0 for value in values)
    return (x, y, z)
