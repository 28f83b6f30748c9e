"""Faces that are linked rigidly become one: fused outlines, with the holes, marks and accesses of all of them.

Input: a graph of faces and links. Output: each fused face with where its atoms lie in it and what became of their edges.
"""

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple, TypeVar

from foldcar.car.components.component import ComponentError
from foldcar.car.components.shape import Atom, Edge, Graph
from foldcar.car.folded.model import IDENTITY, Access, Face, Hole, Mark, Point, Pose
from foldcar.car.folded.pose import across_crease, apply, compose

Key = TypeVar("Key")
# Directions count as parallel below this sine; points closer than 100 times this, in mm, are the same.
GRID_MM = 1e-6


class Fused(NamedTuple):
    """A face made of atoms: ``poses`` of the atoms in its frame, ``edges`` from an atom's edge to an outline edge.

    Its frame is that of the atom ``first``.
    """

    face: Face
    first: Atom
    poses: dict[str, Pose]
    edges: dict[Edge, int]


def fuse(graph: Graph) -> dict[str, Fused]:
    """The fused faces by the path of their first atom; ComponentError if an outline is not one closed polygon."""
    steps: dict[str, list[tuple[str, Pose]]] = defaultdict(list)
    inner: set[Edge] = set()
    for link in (link for link in graph.links if link.kind == "rigid"):
        inner.update((link.a, link.b))
        for one, other in ((link.a, link.b), (link.b, link.a)):
            steps[one[0]].append((other[0], across_crease(graph.ends_mm(one), graph.ends_mm(other), 0.0)))
    groups: dict[str, dict[str, Pose]] = {}
    owner: dict[str, str] = {}
    for path in graph.atoms:
        if path not in owner:
            groups[path] = spread(path, IDENTITY, steps)
            owner |= dict.fromkeys(groups[path], path)
    tags: dict[Edge, object] = {}
    for link in (link for link in graph.links if link.kind != "rigid"):
        how = (link.kind, link.angle_rad, link.depth_mm)
        tags[link.a] = (*how, "a", owner[link.b[0]])
        tags[link.b] = (*how, "b", owner[link.a[0]])
    return {first: _fused(graph, poses, tags, inner) for first, poses in groups.items()}


def spread(start: Key, pose: Pose, steps: Mapping[Key, list[tuple[Key, Pose]]]) -> dict[Key, Pose]:
    """The poses of all that steps lead to, breadth first; a step is a neighbour and its pose in the frame here."""
    poses, queue = {start: pose}, [start]
    for here in queue:
        for other, step in steps.get(here, ()):
            if other not in poses:
                poses[other] = compose(poses[here], step)
                queue.append(other)
    return poses


def _fused(graph: Graph, poses: dict[str, Pose], tags: dict[Edge, object], inner: set[Edge]) -> Fused:
    """One face; neighbouring collinear edges that are linked to the same face in the same way become one edge."""
    first = graph.atoms[next(iter(poses))]
    ring = _ring(graph, poses, inner)
    corners = [i for i in range(len(ring)) if not _goes_on(ring, tags, i)]
    # Edges before the first corner go on the last one.
    edges = {edge: (sum(corner <= i for corner in corners) - 1) % len(corners) for i, (edge, _) in enumerate(ring)}
    holes, marks, accesses = list[Hole](), list[Mark](), list[Access]()
    for path, pose in poses.items():
        atom = graph.atoms[path]
        holes += atom.holes if pose is IDENTITY else (_moved(hole, pose) for hole in atom.holes)
        marks += (Mark(mark.name, tuple(_flat(pose, at) for at in mark.outline_mm)) for mark in atom.marks)
        accesses += (replace(access, pose=compose(pose, access.pose)) for access in atom.accesses)
    outline = tuple(ring[i][1] for i in corners)
    face = Face(first.path, outline, tuple(holes), first.role, tuple(marks), tuple(accesses))
    return Fused(face, first, poses, edges)


def _ring(graph: Graph, poses: dict[str, Pose], inner: set[Edge]) -> list[tuple[Edge, Point]]:
    """The atoms' outer edges in the order of the fused outline, each with its start point (mm)."""
    first = next(iter(poses))
    if len(poses) == 1:
        return [((first, i), point) for i, point in enumerate(graph.atoms[first].outline_mm)]
    starts: dict[tuple[int, int], tuple[Edge, Point, Point]] = {}
    for path, pose in poses.items():
        for edge in ((path, index) for index in range(len(graph.atoms[path].outline_mm))):
            if edge not in inner:
                a, b = (_flat(pose, point) for point in graph.ends_mm(edge))
                starts[_key(a)] = edge, a, b
    edge, begin, b = next(iter(starts.values()))
    ring = [(edge, begin)]
    while _key(b) != _key(begin):
        if _key(b) not in starts or len(ring) > len(starts):
            raise ComponentError(edge[0], "is fused with its neighbours into something without a closed outline")
        edge, a, b = starts[_key(b)]
        ring.append((edge, a))
    if len(ring) != len(starts):
        raise ComponentError(edge[0], "is fused with its neighbours into more than one outline")
    return ring


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
