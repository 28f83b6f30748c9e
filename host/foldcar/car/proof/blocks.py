"""Film and parts as convex solids, whether they collide while they move, and a way out of what surrounds them.

A face is a plate of its film's thickness without its holes, cut into triangles that are extruded. From all solids a skin
is taken: what touches, or overlaps by less, does not collide. A solid that is translated sweeps the convex hull of both
ends, so nothing is stepped over, however thin. Lengths in mm.
"""

import itertools
import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import fcl
import numpy as np
import shapely
from numpy.typing import NDArray

from foldcar.car.folded.model import Access, Mount, Pose, Solid
from foldcar.car.folded.pose import translation
from foldcar.car.proof.step import Vector

# Solids may overlap by twice this.
SKIN_MM = 0.05
LEAST_MM = 0.01
SIDES = 16
# The hull of points needs no faces, which fcl.Convex uses for large bodies only; an open one keeps it to the points.
_NO_FACES = np.array([3, 0, 1, 2], dtype=np.int32)

Points = NDArray[np.float64]
Ring = list[tuple[float, float]]


@dataclass(eq=False)
class Block:
    """One convex solid: its corners, (k, 3) in mm, and what it belongs to."""

    corners_mm: Points
    title: str

    @cached_property
    def solid(self) -> fcl.CollisionObject:
        """The solid for fcl."""
        return hull(self.corners_mm)


@dataclass(frozen=True)
class Blocks:
    """Convex solids and their bounds along the axes, (n, 3) in mm."""

    blocks: tuple[Block, ...]
    low: Points
    high: Points

    def where(self, titles: Collection[str], among: bool = True) -> "Blocks":
        """The solids whose title is ``among`` these, or is not."""
        kept = [i for i, block in enumerate(self.blocks) if (block.title in titles) == among]
        return Blocks(tuple(self.blocks[i] for i in kept), self.low[kept], self.high[kept])

    def moved(self, pose: Pose) -> "Blocks":
        """The solids moved by a pose."""
        if not self.blocks:
            return self
        matrix = np.array(pose)
        corners = np.concatenate([block.corners_mm for block in self.blocks]) @ matrix[:3, :3].T + matrix[:3, 3]
        ends = np.cumsum([len(block.corners_mm) for block in self.blocks])
        starts = np.concatenate([[0], ends[:-1]])
        bounds = np.minimum.reduceat(corners, starts), np.maximum.reduceat(corners, starts)
        parts = zip(self.blocks, starts.tolist(), ends.tolist(), strict=True)
        return Blocks(tuple(Block(corners[start:end], block.title) for block, start, end in parts), *bounds)


def blocks_of(corners_mm: Iterable[Points], title: str) -> Blocks:
    """Convex solids from their corners."""
    blocks = tuple(Block(corners, title) for corners in corners_mm)
    bounds = (np.array([pick(one.corners_mm, axis=0) for one in blocks]).reshape(-1, 3) for pick in (np.min, np.max))
    return Blocks(blocks, *bounds)


def together(several: Iterable[Blocks]) -> Blocks:
    """All solids of several."""
    several = [one for one in several if one.blocks]
    if not several:
        return Blocks((), np.zeros((0, 3)), np.zeros((0, 3)))
    bounds = np.concatenate([one.low for one in several]), np.concatenate([one.high for one in several])
    return Blocks(tuple(itertools.chain.from_iterable(one.blocks for one in several)), *bounds)


def hull(points: Points) -> fcl.CollisionObject:
    """The convex hull of points (mm)."""
    return fcl.CollisionObject(fcl.Convex(np.ascontiguousarray(points), 1, _NO_FACES))


def plate(shape: shapely.Geometry, thickness_mm: float, title: str) -> Blocks:
    """A flat shape as a plate around the plane z = 0."""
    half = thickness_mm / 2 - SKIN_MM
    flat = [np.array(part) for part in convex_parts(shape.buffer(-SKIN_MM, join_style="mitre"))]
    solids = (np.column_stack([np.repeat(part, 2, axis=0), np.tile((-half, half), len(part))]) for part in flat)
    return blocks_of(solids, title)


def convex_parts(shape: shapely.Geometry) -> list[Ring]:
    """The corners of convex polygons that make up a shape: its triangles, joined while they stay convex."""
    parts: list[Ring] = []
    for one in shapely.get_parts(shape):
        if one.geom_type == "Polygon" and one.area > LEAST_MM**2:
            triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(one))
            parts += _joined([list(shapely.orient_polygons(t).exterior.coords)[:-1] for t in triangles])
    return parts


def _joined(polygons: list[Ring]) -> list[Ring]:
    """Convex polygons (counter-clockwise) after neighbours are joined over their common edge, if the result is convex."""
    alive = dict(enumerate(polygons))
    owner = {(a, b): i for i, p in alive.items() for a, b in zip(p, [*p[1:], p[0]], strict=True)}
    for edge in list(owner):
        one, other = owner.get(edge), owner.get((edge[1], edge[0]))
        if one is None or other is None or one == other:
            continue
        merged = _merge(alive[one], alive[other], edge)
        if merged is None:
            continue
        del owner[edge], owner[edge[1], edge[0]]
        for a, b in zip(alive[other], [*alive[other][1:], alive[other][0]], strict=True):
            if owner.get((a, b)) == other:
                owner[a, b] = one
        alive[one] = merged
        del alive[other]
    return list(alive.values())


def _merge(one: Ring, other: Ring, edge: tuple[tuple[float, float], ...]) -> Ring | None:
    i, k = one.index(edge[0]), other.index(edge[1])
    # Both start behind the common edge: one from its end, the other from its start.
    merged = [*(one[i + 1 :] + one[: i + 1]), *(other[k + 1 :] + other[:k])[1:]]
    for a, b, c in zip(merged, [*merged[1:], merged[0]], [*merged[2:], *merged[:2]], strict=True):
        if (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]) < -1e-9:
            return None
    return merged


def mount_blocks(mount: Mount) -> Blocks:
    """A mount's solids, or its box, in its own frame."""
    return together(solid_blocks(solid, mount.name) for solid in mount.shape)


def solid_blocks(solid: Solid, title: str) -> Blocks:
    """A box or cylinder in its part's frame."""
    x, y, z = solid.size_mm
    corners = box((x, y, z)) if solid.kind == "box" else prism(x / 2 - SKIN_MM, -z / 2 + SKIN_MM, z / 2 - SKIN_MM)
    if not solid.bores:
        return blocks_of([corners], title).moved(solid.pose)
    # Bores are polygons around their circles.
    wide = 1 / math.cos(math.pi / SIDES)
    bores = [shapely.Point(u, v).buffer(d / 2 * wide, quad_segs=SIDES // 4) for u, v, d in solid.bores]
    shape = shapely.MultiPoint(corners[:, :2]).convex_hull.buffer(SKIN_MM, join_style="mitre")
    return plate(shape.difference(shapely.union_all(bores)), z, title).moved(solid.pose)


def access_blocks(access: Access, title: str) -> Blocks:
    """The cylinder that must be free, in its part's frame."""
    corners = prism(access.diameter_mm / 2 - SKIN_MM, SKIN_MM, access.length_mm)
    return blocks_of([corners], title).moved(access.pose)


def box(size_mm: tuple[float, float, float]) -> Points:
    """The corners of a box around the origin, (8, 3)."""
    half = np.maximum(np.array(size_mm) / 2 - SKIN_MM, LEAST_MM)
    return np.array(list(itertools.product((-1, 1), repeat=3))) * half


def prism(radius_mm: float, low_mm: float, high_mm: float) -> Points:
    """The corners of a cylinder along z; the prism has the cylinder's section area."""
    radius = max(radius_mm, LEAST_MM) * math.sqrt(2 * math.pi / SIDES / math.sin(2 * math.pi / SIDES))
    turns = 2 * math.pi * np.arange(SIDES) / SIDES
    circle = np.column_stack([radius * np.cos(turns), radius * np.sin(turns)])
    return np.vstack([np.column_stack([circle, np.full(SIDES, z)]) for z in (low_mm, high_mm)])


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
