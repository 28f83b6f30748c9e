"""Film and parts as convex solids: collisions while they move, and straight paths out of their surroundings.

A face is a plate of its film's thickness without its holes, cut into triangles that are extruded. All solids are shrunk
by a skin: solids that touch, or overlap by less, do not collide. A translated solid sweeps the convex hull of both
positions, so that no obstacle is skipped, however thin. Lengths in mm.
"""

import itertools
import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import fcl
import numpy as np
import shapely
from numpy.typing import NDArray

from foldcar.car.folded.model import Pose, Solid, ToolClearance
from foldcar.car.folded.pose import translation
from foldcar.car.proof.step import Vector

# Solids may overlap by twice this.
SKIN_MM = 0.05
MIN_SIZE_MM = 0.01
SIDES = 16
# fcl.Convex uses faces for large bodies only; with one open face it uses the points alone.
_NO_FACES = np.array([3, 0, 1, 2], dtype=np.int32)

Points = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Blocks:
    """Convex solids: the corners of all of them, (n, 3) in mm.

    The index of the first corner of each; the title of each.
    """

    corners_mm: Points
    starts: NDArray[np.intp]
    titles: tuple[str, ...]

    @cached_property
    def low(self) -> Points:
        """The minimum coordinates of each solid, (k, 3)."""
        low: Points = np.minimum.reduceat(self.corners_mm, self.starts) if self.titles else self.corners_mm
        return low

    @cached_property
    def high(self) -> Points:
        """The maximum coordinates of each solid, (k, 3)."""
        high: Points = np.maximum.reduceat(self.corners_mm, self.starts) if self.titles else self.corners_mm
        return high

    def part(self, i: int) -> Points:
        """Return the corners of solid ``i``, (n, 3)."""
        return self.corners_mm[self.starts[i] : self.starts[i + 1] if i + 1 < len(self.titles) else None]

    @cached_property
    def _collision_objects(self) -> dict[int, fcl.CollisionObject]:
        """Cache of fcl's objects by the solids' indices."""
        return {}

    def collision_object(self, i: int) -> fcl.CollisionObject:
        """Return solid ``i`` as an object of fcl, which is made once only."""
        if i not in self._collision_objects:
            self._collision_objects[i] = hull(self.part(i))
        return self._collision_objects[i]

    def with_titles(self, titles: Collection[str]) -> "Blocks":
        """Return the solids whose title is among ``titles``."""
        return self._selected([i for i, title in enumerate(self.titles) if title in titles])

    def without_titles(self, titles: Collection[str]) -> "Blocks":
        """Return the solids whose title is not among ``titles``."""
        return self._selected([i for i, title in enumerate(self.titles) if title not in titles])

    def _selected(self, indices: Sequence[int]) -> "Blocks":
        return blocks_of([self.part(i) for i in indices], [self.titles[i] for i in indices])

    def moved(self, pose: Pose) -> "Blocks":
        """Return the solids moved by a pose."""
        matrix = np.array(pose)
        return Blocks(self.corners_mm @ matrix[:3, :3].T + matrix[:3, 3], self.starts, self.titles)


def blocks_of(corners_mm: Iterable[Points], titles: str | Sequence[str]) -> Blocks:
    """Return convex solids from their corners, with one common title or one title for each."""
    parts = list(corners_mm)
    starts = np.cumsum([0, *map(len, parts)])[:-1]
    names = (titles,) * len(parts) if isinstance(titles, str) else tuple(titles)
    return Blocks(np.concatenate([np.zeros((0, 3)), *parts]), starts, names)


def merge_blocks(groups: Iterable[Blocks]) -> Blocks:
    """Return the solids of all groups as one group."""
    # The empty arrays make the result valid without any group.
    corners: list[Points] = [np.zeros((0, 3))]
    starts: list[NDArray[np.intp]] = [np.zeros(0, dtype=np.intp)]
    titles: list[str] = []
    corner_count = 0
    for group in groups:
        # ``starts`` are indices into the corners, of which those of the groups before come first.
        starts.append(group.starts + corner_count)
        corners.append(group.corners_mm)
        titles += group.titles
        corner_count += len(group.corners_mm)
    return Blocks(np.concatenate(corners), np.concatenate(starts), tuple(titles))


def hull(points: Points) -> fcl.CollisionObject:
    """Return the convex hull of points (mm)."""
    return fcl.CollisionObject(fcl.Convex(np.ascontiguousarray(points), 1, _NO_FACES))


def plate(shape: shapely.Geometry, thickness_mm: float, title: str) -> Blocks:
    """Return a flat shape as a plate around the plane z = 0."""
    half = thickness_mm / 2 - SKIN_MM
    flat = [np.array(part) for part in convex_parts(shape.buffer(-SKIN_MM, join_style="mitre"))]
    solids = (np.column_stack([np.repeat(part, 2, axis=0), np.tile((-half, half), len(part))]) for part in flat)
    return blocks_of(solids, title)


def convex_parts(shape: shapely.Geometry) -> list[Points]:
    """Return the corners of convex polygons that make up a shape: its triangles."""
    polygons = [part for part in shapely.get_parts(shape) if part.geom_type == "Polygon" and part.area > MIN_SIZE_MM**2]
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(shapely.MultiPolygon(polygons)))
    return [shapely.get_coordinates(triangle)[:-1] for triangle in triangles]


def solid_blocks(solid: Solid, title: str) -> Blocks:
    """Return a box or a cylinder in the frame of its part. A solid with bores is cut into several convex solids."""
    x_mm, y_mm, z_mm = solid.size_mm
    if solid.kind == "box":
        corners = box((x_mm, y_mm, z_mm))
    else:
        corners = prism(x_mm / 2 - SKIN_MM, -z_mm / 2 + SKIN_MM, z_mm / 2 - SKIN_MM)
    if not solid.bores:
        return blocks_of([corners], title).moved(solid.pose)
    # A bore becomes a regular polygon. So that a shaft of the same diameter passes, the sides of the polygon must touch
    # the circle of the bore. Then its corners are farther out than the circle by this factor.
    corner_factor = 1 / math.cos(math.pi / SIDES)
    bores = []
    for x, y, bore_mm in solid.bores:
        bores.append(shapely.Point(x, y).buffer(bore_mm / 2 * corner_factor, quad_segs=SIDES // 4))
    # `box` and `prism` have made the solid smaller by SKIN_MM, and `plate` will do so again. So the outline is first made
    # larger by SKIN_MM.
    outline = shapely.MultiPoint(corners[:, :2]).convex_hull.buffer(SKIN_MM, join_style="mitre")
    return plate(outline.difference(shapely.union_all(bores)), z_mm, title).moved(solid.pose)


def clearance_blocks(clearance: ToolClearance, title: str) -> Blocks:
    """Return the cylinder that must be free, in its part's frame."""
    corners = prism(clearance.diameter_mm / 2 - SKIN_MM, SKIN_MM, clearance.length_mm)
    return blocks_of([corners], title).moved(clearance.pose)


def box(size_mm: tuple[float, float, float]) -> Points:
    """Return the corners of a box around the origin, (8, 3)."""
    half = np.maximum(np.array(size_mm) / 2 - SKIN_MM, MIN_SIZE_MM)
    return np.array(list(itertools.product((-1, 1), repeat=3))) * half


def prism(radius_mm: float, low_mm: float, high_mm: float) -> Points:
    """Return the corners of a cylinder along z; the prism has the cylinder's section area."""
    radius = max(radius_mm, MIN_SIZE_MM) * math.sqrt(2 * math.pi / SIDES / math.sin(2 * math.pi / SIDES))
    turns = 2 * math.pi * np.arange(SIDES) / SIDES
    circle = np.column_stack([radius * np.cos(turns), radius * np.sin(turns)])
    return np.vstack([np.column_stack([circle, np.full(SIDES, z)]) for z in (low_mm, high_mm)])


# Lengths to try for a first move, if a second one is needed.
FIRST_MM = (1.0, 2.0, 4.0, 8.0, 15.0, 25.0, 40.0, 60.0)
# An exit path ends this far beyond all standing solids.
CLEAR_MM = 20.0
# A direction with a smaller component along an axis does not lead along this axis.
MIN_COMPONENT = 1e-6
AXES: tuple[Vector, ...] = ((0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, -1))


@dataclass(frozen=True)
class ExitPath:
    """A path out, as straight moves. If there is none, ``moves_mm`` is None.

    ``obstacles`` has, for each direction that was tried, the direction and the title of what the moving solids met.
    ``overlapped`` is the title of a solid that they overlap before they move.
    """

    moves_mm: tuple[Vector, ...] | None
    obstacles: tuple[tuple[Vector, str], ...] = ()
    overlapped: str = ""


# Pairs of titles that may overlap, because they are joined.
Ignored = frozenset[tuple[str, str]]
NOTHING: Ignored = frozenset()


def first_obstacle(
    moving: Blocks, standing: Blocks, move_mm: Vector = (0.0, 0.0, 0.0), ignored: Ignored = NOTHING
) -> str | None:
    """Return the title of the first solid that the moving solids collide with, or None."""
    return swept_obstacle(moving, moving.moved(translation(*move_mm)) if any(move_mm) else moving, standing, ignored)


def swept_obstacle(start: Blocks, end: Blocks, standing: Blocks, ignored: Ignored = NOTHING) -> str | None:
    """Return the title of a standing solid that moving solids meet on their way from ``start`` to ``end``, or None.

    If they meet several, it is the one that is nearest to them at the start. Each moving solid sweeps the convex hull of
    its corners at both positions. ``ignored`` are pairs of titles, of a moving and a standing solid, that may overlap.
    """
    if not start.titles or not standing.titles:
        return None
    # The pairs of a moving and a standing solid that may meet on the way, by their indices.
    pairs = _near(np.minimum(start.low, end.low), np.maximum(start.high, end.high), standing)
    is_at_rest = start is end
    swept: dict[int, fcl.CollisionObject] = {}
    for moving_index, standing_index in _nearest_first(pairs, start, standing).tolist():
        obstacle: str = standing.titles[standing_index]
        if (start.titles[moving_index], obstacle) in ignored:
            continue
        if moving_index not in swept:
            corners = start.part(moving_index)
            swept[moving_index] = hull(corners if is_at_rest else np.vstack([corners, end.part(moving_index)]))
        if fcl.collide(swept[moving_index], standing.collision_object(standing_index)):
            return obstacle
    return None


def _nearest_first(pairs: NDArray[np.intp], moving: Blocks, standing: Blocks) -> NDArray[np.intp]:
    """Return pairs of a moving and a standing solid, (n, 2), sorted by the distance of their bounds.

    The distance of two bounds is the largest of the gaps between them along x, y and z. A gap is negative where they
    overlap.
    """
    moving_indices, standing_indices = pairs.T
    gap_above = standing.low[standing_indices] - moving.high[moving_indices]
    gap_below = moving.low[moving_indices] - standing.high[standing_indices]
    # Only one of the two can be positive: the gap is on that side.
    gaps = np.maximum(gap_above, gap_below)
    return pairs[np.argsort(gaps.max(axis=1), kind="stable")]


def _near(low: Points, high: Points, standing: Blocks) -> NDArray[np.intp]:
    """Return the pairs of a moving and a standing solid whose bounds overlap, as their indices, (n, 2).

    The bounds of a solid are its minimum and maximum coordinates. ``low`` and ``high``, (m, 3), are those of the moving
    solids. Two solids' bounds overlap if they do so along x, y and z.
    """
    # First the few standing solids that overlap the common bounds of all moving ones are selected, which is fast.
    starts_before_end = standing.low <= high.max(axis=0)
    ends_after_start = standing.high >= low.min(axis=0)
    candidates = np.flatnonzero((starts_before_end & ends_after_start).all(axis=1))
    # Then every moving solid is compared with every candidate. The arrays have the shape (moving, candidates, 3).
    moving_low, moving_high = low[:, np.newaxis], high[:, np.newaxis]
    overlaps = (moving_low <= standing.high[candidates]) & (moving_high >= standing.low[candidates])
    moving_index, candidate_index = np.nonzero(overlaps.all(axis=2))
    return np.column_stack([moving_index, candidates[candidate_index]])


def find_exit_path(
    moving: Blocks, standing: Blocks, own_axes: Iterable[Vector] = (), ignored: Ignored = NOTHING, only_own: bool = False
) -> ExitPath:
    """Find one or two straight moves that take solids out of the standing ones.

    The directions that are tried are the axes of the car and ``own_axes``, which are the axes of the part. Single
    moves are tried first, the shortest first. A move upwards counts half, because parts are best put in from above.
    Then pairs of moves are tried, those with a short first move first. With ``only_own``, only single moves along
    ``own_axes`` are tried.
    """
    overlapped = first_obstacle(moving, standing, ignored=ignored)
    if overlapped is not None:
        return ExitPath(None, overlapped=overlapped)
    directions: list[Vector] = []
    for direction in own_axes if only_own else (*AXES, *own_axes):
        # The part's axes are often the car's.
        if all(np.dot(direction, other) < 0.999 for other in directions):
            directions.append(direction)
    moves = [(direction, _move_out(moving, standing, direction)) for direction in directions]

    def cost(direction_and_move: tuple[Vector, Vector]) -> float:
        direction, move = direction_and_move
        return float(np.linalg.norm(move)) * (0.5 if direction[2] > 0.999 else 1.0)

    moves.sort(key=cost)
    obstacles: list[tuple[Vector, str]] = []
    for direction, move in moves:
        obstacle = first_obstacle(moving, standing, move, ignored)
        if obstacle is None:
            return ExitPath((move,))
        obstacles.append((direction, obstacle))
    first_directions = [direction for direction, _ in obstacles if not only_own]
    for length in FIRST_MM:
        for direction in list(first_directions):
            first = vector(np.array(direction) * length)
            if first_obstacle(moving, standing, first, ignored) is not None:
                # A longer move would meet the same obstacle.
                first_directions.remove(direction)
                continue
            after_first = moving.moved(translation(*first))
            # A second move along the first one's line would be the same as a single move.
            for second_direction in (other for other, _ in obstacles if abs(np.dot(other, direction)) < 0.9):
                second = _move_out(after_first, standing, second_direction)
                if first_obstacle(after_first, standing, second, ignored) is None:
                    return ExitPath((first, second), tuple(obstacles))
    return ExitPath(None, tuple(obstacles))


def _move_out(moving: Blocks, standing: Blocks, direction: Vector) -> Vector:
    """Return the shortest move in a direction after which the bounds of moving and standing solids are CLEAR_MM apart."""
    if not standing.titles:
        return vector(np.array(direction) * CLEAR_MM)
    moving_low, moving_high = moving.low.min(axis=0), moving.high.max(axis=0)
    standing_low, standing_high = standing.low.min(axis=0), standing.high.max(axis=0)
    # Bounds are apart as soon as they are apart along one axis. For each axis, this is how long the move must be.
    lengths = []
    for axis, component in enumerate(direction):
        if component > MIN_COMPONENT:
            way_along_axis = standing_high[axis] - moving_low[axis]
            lengths.append(way_along_axis / component)
        elif component < -MIN_COMPONENT:
            way_along_axis = moving_high[axis] - standing_low[axis]
            lengths.append(way_along_axis / -component)
    return vector(np.array(direction) * (max(0.0, min(lengths)) + CLEAR_MM))


def vector(values: NDArray[np.float64]) -> Vector:
    """Return the numbers of an array (3,). A zero has no sign."""
    x, y, z = (float(value) + 0.0 for value in values)
    return (x, y, z)
