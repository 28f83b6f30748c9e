"""Fuse faces that are linked rigidly into one face.

Input: a graph of atoms and links. Output: fused faces with outline and holes; each outer edge of an atom maps to an
edge of its fused face. Neighbouring collinear edges that are linked to the same face in the same way become one edge.
"""

import math
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, replace

from foldcar.car.components.parameter import ComponentError
from foldcar.car.components.shape import Atom, Graph, Link
from foldcar.car.folded.model import IDENTITY, Access, Face, Hole, Mark, Point, Pose
from foldcar.car.folded.pose import across_crease, apply, compose, side

Edge = tuple[str, int]
# Directions count as parallel below this sine; points closer than 100 times this, in mm, are the same.
GRID_MM = 1e-6


@dataclass
class Fused:
    """A face made of atoms: ``poses`` of the atoms in its frame, ``edges`` from an atom's edge to an outline edge.

    Its frame is that of the atom ``first``.
    """

    face: Face
    first: Atom
    poses: dict[str, Pose]
    edges: dict[Edge, int]


def fuse(graph: Graph) -> dict[str, Fused]:
    """The fused faces by the path of their first atom; ComponentError if an outline is not one closed polygon."""
    groups = _groups(graph)
    owner = {path: first for first, poses in groups.items() for path in poses}
    tags: dict[Edge, object] = {}
    inner: set[Edge] = set()
    for link in graph.links:
        if link.kind == "rigid":
            inner.update((link.a, link.b))
        else:
            how = (link.kind, link.angle_rad, link.depth_mm)
            tags[link.a] = (*how, "a", owner[link.b[0]])
            tags[link.b] = (*how, "b", owner[link.a[0]])
    return {first: _fused(graph, poses, tags, inner) for first, poses in groups.items()}


def _groups(graph: Graph) -> dict[str, dict[str, Pose]]:
    """Groups of rigidly linked atoms, by the first one's path: the atoms' poses in its frame."""
    neighbours: dict[str, list[tuple[Edge, Edge]]] = defaultdict(list)
    for link in graph.links:
        if link.kind == "rigid":
            neighbours[link.a[0]].append((link.a, link.b))
            neighbours[link.b[0]].append((link.b, link.a))
    groups: dict[str, dict[str, Pose]] = {}
    done: set[str] = set()
    for path in graph.atoms:
        if path in done:
            continue
        poses = {path: IDENTITY}
        stack = [path]
        while stack:
            here = stack.pop()
            for mine, other in neighbours[here]:
                if other[0] not in poses:
                    step = across_crease(_ends(graph, mine), _ends(graph, other), 0.0)
                    poses[other[0]] = compose(poses[here], step)
                    stack.append(other[0])
        done.update(poses)
        groups[path] = poses
    return groups


def _ends(graph: Graph, edge: Edge) -> tuple[Point, Point]:
    return side(graph.atoms[edge[0]].outline_mm, edge[1])


def _fused(graph: Graph, poses: dict[str, Pose], tags: dict[Edge, object], inner: set[Edge]) -> Fused:
    first = graph.atoms[next(iter(poses))]
    if len(poses) == 1:
        ring = [((first.path, i), point) for i, point in enumerate(first.outline_mm)]
    else:
        ring = _ring(graph, poses, inner)
    outline, edges = _merge(ring, tags)
    holes, marks, accesses = list[Hole](), list[Mark](), list[Access]()
    for path, pose in poses.items():
        atom = graph.atoms[path]
        holes += atom.holes if pose is IDENTITY else (_moved(hole, pose) for hole in atom.holes)
        marks += (Mark(mark.name, tuple(_flat(pose, at) for at in mark.outline_mm)) for mark in atom.marks)
        accesses += (replace(one, pose=compose(pose, one.pose)) for one in atom.accesses)
    face = Face(first.path, outline, tuple(holes), first.role, "", tuple(marks), tuple(accesses))
    return Fused(face, first, poses, edges)


def _ring(graph: Graph, poses: dict[str, Pose], inner: set[Edge]) -> list[tuple[Edge, Point]]:
    """The atoms' outer edges in the order of the fused outline, each with its start point (mm)."""
    starts: dict[tuple[int, int], tuple[Edge, Point, Point]] = {}
    for path, pose in poses.items():
        for index in range(len(graph.atoms[path].outline_mm)):
            if (path, index) not in inner:
                a, b = (_flat(pose, point) for point in _ends(graph, (path, index)))
                starts[_key(a)] = ((path, index), a, b)
    begin = edge, a, b = next(iter(starts.values()))
    ring = [(edge, a)]
    while _key(b) != _key(begin[1]):
        if _key(b) not in starts or len(ring) > len(starts):
            raise ComponentError(edge[0], "is fused with its neighbours into something without a closed outline")
        edge, a, b = starts[_key(b)]
        ring.append((edge, a))
    if len(ring) != len(starts):
        raise ComponentError(edge[0], "is fused with its neighbours into more than one outline")
    return ring


def _merge(ring: list[tuple[Edge, Point]], tags: dict[Edge, object]) -> tuple[tuple[Point, ...], dict[Edge, int]]:
    """Merge neighbouring collinear edges with equal tags: the outline's points and each atom edge's new index."""
    corners = [i for i in range(len(ring)) if not _goes_on(ring, tags, i)]
    edges = {}
    for i, (edge, _) in enumerate(ring):
        # Edges before the first corner go on the last one.
        edges[edge] = (sum(corner <= i for corner in corners) - 1) % len(corners)
    return tuple(ring[i][1] for i in corners), edges


def _goes_on(ring: list[tuple[Edge, Point]], tags: dict[Edge, object], i: int) -> bool:
    """Whether the edges before and after point i are collinear and have equal tags."""
    if tags.get(ring[i - 1][0]) != tags.get(ring[i][0]):
        return False
    a, b, c = ring[i - 1][1], ring[i][1], ring[(i + 1) % len(ring)][1]
    ux, uy, vx, vy = b[0] - a[0], b[1] - a[1], c[0] - b[0], c[1] - b[1]
    return abs(ux * vy - uy * vx) <= GRID_MM * math.hypot(ux, uy) * math.hypot(vx, vy) and ux * vx + uy * vy > 0


def _moved(hole: Hole, pose: Pose) -> Hole:
    center = None if hole.center_mm is None else _flat(pose, hole.center_mm)
    return replace(hole, outline_mm=tuple(_flat(pose, point) for point in hole.outline_mm), center_mm=center)


def _flat(pose: Pose, point: Point) -> Point:
    return apply(pose, *point)[:2]


def _key(point: Point) -> tuple[int, int]:
    return (round(point[0] / GRID_MM / 100), round(point[1] / GRID_MM / 100))


def seams(links: Iterable[Link], fused: dict[str, Fused]) -> list[tuple[Link, Edge, Edge, float]]:
    """Each connection of two fused faces once: one of its links, its edges (first atom's path, index), length (mm).

    ComponentError if the two edges differ in length after fusing.
    """
    owner = {path: first for first, one in fused.items() for path in one.poses}
    found: dict[tuple[Edge, Edge], tuple[Link, Edge, Edge, float]] = {}
    for link in (link for link in links if link.kind != "rigid"):
        a, b = ((owner[path], fused[owner[path]].edges[path, index]) for path, index in (link.a, link.b))
        if (a, b) not in found:
            first, second = (math.dist(*side(fused[path].face.outline_mm, index)) for path, index in (a, b))
            if abs(first - second - 2 * link.inset_mm) > 1e-4:
                told = f"meets {link.b[0]} in edges of {first:g} and {second:g} mm once they are fused"
                raise ComponentError(link.a[0], told)
            found[a, b] = (link, a, b, second)
    return list(found.values())
