"""Fuses rigidly linked faces to one face with a common outline and all their holes, marks and clearances.

Input: a graph of faces and links. Output: fused faces, their atoms' poses, and the outline edge of each atom's edge.
"""

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple, TypeVar

from foldcar.car.components.component import ComponentError
from foldcar.car.components.shape import Atom, Edge, Graph
from foldcar.car.folded.model import IDENTITY, Face, Hole, Point, Pose, PrintedOutline, ToolClearance
from foldcar.car.folded.pose import across_crease, apply, compose

Key = TypeVar("Key")
# Directions count as parallel below this sine; points closer than 100 times this, in mm, are the same.
GRID_MM = 1e-6


class Fused(NamedTuple):
    """A face made of atoms. Its frame is that of the atom ``first``.

    ``poses`` are the atoms' poses in it, ``edges`` maps an atom's edge to the index of an outline edge.
    """

    face: Face
    first: Atom
    poses: dict[str, Pose]
    edges: dict[Edge, int]


def fuse(graph: Graph) -> dict[str, Fused]:
    """Return the fused faces by the path of their first atom: each is a group of atoms that rigid links connect.

    Edges between atoms disappear. Collinear edges become one if their tags are equal: the link's kind, angle and depth,
    which of its ends the edge is, and the face at the other end.

    Raises ComponentError if a group's outline is not one polygon.
    """
    steps: dict[str, list[tuple[str, Pose]]] = defaultdict(list)
    inner_edges: set[Edge] = set()
    for link in (link for link in graph.links if link.kind == "rigid"):
        inner_edges.update((link.a, link.b))
        for edge, opposite in ((link.a, link.b), (link.b, link.a)):
            steps[edge[0]].append((opposite[0], across_crease(graph.ends_mm(edge), graph.ends_mm(opposite), 0.0)))
    poses_by_first: dict[str, dict[str, Pose]] = {}
    first_of_atom: dict[str, str] = {}
    for path in graph.atoms:
        if path not in first_of_atom:
            poses_by_first[path] = propagate_poses(path, IDENTITY, steps)
            first_of_atom |= dict.fromkeys(poses_by_first[path], path)
    tags: dict[Edge, object] = {}
    for link in (link for link in graph.links if link.kind != "rigid"):
        kind = (link.kind, link.angle_rad, link.depth_mm)
        tags[link.a] = (*kind, "a", first_of_atom[link.b[0]])
        tags[link.b] = (*kind, "b", first_of_atom[link.a[0]])
    return {first: _fused(graph, poses, tags, inner_edges) for first, poses in poses_by_first.items()}


def propagate_poses(start: Key, pose: Pose, steps: Mapping[Key, list[tuple[Key, Pose]]]) -> dict[Key, Pose]:
    """Return the poses of all nodes that can be reached from ``start``, which has ``pose``, nearest first.

    ``steps`` has each node's neighbours with their poses in the node's frame.
    """
    poses, queue = {start: pose}, [start]
    for current in queue:
        for neighbour, step in steps.get(current, ()):
            if neighbour not in poses:
                poses[neighbour] = compose(poses[current], step)
                queue.append(neighbour)
    return poses


def _fused(graph: Graph, poses: dict[str, Pose], tags: dict[Edge, object], inner: set[Edge]) -> Fused:
    """Return the face made of the atoms with these poses in the first atom's frame.

    ``inner`` edges lie between two atoms and disappear. Neighbouring collinear edges become one edge if their ``tags``
    are equal: the same kind of link to the same face.
    """
    first = graph.atoms[next(iter(poses))]
    ring = _ring(graph, poses, inner)
    corners = [i for i in range(len(ring)) if not _is_collinear(ring, tags, i)]
    # Edge n of the outline starts at corner n. Edges of the ring before the first corner continue the last edge.
    edges = {edge: (sum(corner <= i for corner in corners) - 1) % len(corners) for i, (edge, _) in enumerate(ring)}
    holes, marks, clearances = list[Hole](), list[PrintedOutline](), list[ToolClearance]()
    for path, pose in poses.items():
        atom = graph.atoms[path]
        holes += atom.holes if pose is IDENTITY else (_moved(hole, pose) for hole in atom.holes)
        marks += (PrintedOutline(mark.name, tuple(_flat(pose, at) for at in mark.outline_mm)) for mark in atom.marks)
        clearances += (replace(clearance, pose=compose(pose, clearance.pose)) for clearance in atom.clearances)
    outline = tuple(ring[i][1] for i in corners)
    face = Face(first.path, outline, tuple(holes), first.role, tuple(marks), tuple(clearances))
    return Fused(face, first, poses, edges)


def _ring(graph: Graph, poses: dict[str, Pose], inner_edges: set[Edge]) -> list[tuple[Edge, Point]]:
    """Return the atoms' outer edges in the order of the fused outline, each with its start point (mm).

    ``inner_edges`` lie between two atoms. Each outer edge is followed by the one that starts where it ends.
    """
    first = next(iter(poses))
    if len(poses) == 1:
        return [((first, i), point) for i, point in enumerate(graph.atoms[first].outline_mm)]
    # Edges with their start and end in the first atom's frame, by the rounded start.
    edges_by_start: dict[tuple[int, int], tuple[Edge, Point, Point]] = {}
    for path, pose in poses.items():
        for index in range(len(graph.atoms[path].outline_mm)):
            edge = path, index
            if edge not in inner_edges:
                start, end = (_flat(pose, point) for point in graph.ends_mm(edge))
                edges_by_start[_key(start)] = edge, start, end
    edge, first_start, end = next(iter(edges_by_start.values()))
    ring = [(edge, first_start)]
    while _key(end) != _key(first_start):
        if _key(end) not in edges_by_start or len(ring) > len(edges_by_start):
            # The ring ends at a gap, or runs into its own middle.
            raise ComponentError(edge[0], "is fused with its neighbours into something without a closed outline")
        edge, start, end = edges_by_start[_key(end)]
        ring.append((edge, start))
    if len(ring) != len(edges_by_start):
        raise ComponentError(edge[0], "is fused with its neighbours into more than one outline")
    return ring


def _is_collinear(ring: list[tuple[Edge, Point]], tags: dict[Edge, object], i: int) -> bool:
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
