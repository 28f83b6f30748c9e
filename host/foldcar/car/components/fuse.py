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
    """Unite the faces of a graph that rigid links connect; return the united faces by the path of their first atom.

    An *atom* is a face as one component has made it. Edges between two atoms of a group disappear. Raises ComponentError
    if the outline of a group is not one polygon.
    """
    rigid_links = [link for link in graph.links if link.kind == "rigid"]
    # For each atom: the atoms that rigid links connect it with, and their poses in its frame.
    neighbours: dict[str, list[tuple[str, Pose]]] = defaultdict(list)
    inner_edges: set[Edge] = set()
    for link in rigid_links:
        inner_edges.update((link.a, link.b))
        for edge, opposite_edge in ((link.a, link.b), (link.b, link.a)):
            pose = across_crease(graph.ends_mm(edge), graph.ends_mm(opposite_edge), 0.0)
            atom, opposite_atom = edge[0], opposite_edge[0]
            neighbours[atom].append((opposite_atom, pose))
    poses_by_first: dict[str, dict[str, Pose]] = {}
    first_of_atom: dict[str, str] = {}
    for path in graph.atoms:
        if path not in first_of_atom:
            poses_by_first[path] = propagate_poses(path, IDENTITY, neighbours)
            first_of_atom |= dict.fromkeys(poses_by_first[path], path)
    # Two edges in a line become one edge if they are linked in the same way to the same face: if their tags are equal.
    tags: dict[Edge, object] = {}
    for link in graph.links:
        if link.kind != "rigid":
            kind = (link.kind, link.angle_rad, link.depth_mm)
            tags[link.a] = (*kind, "a", first_of_atom[link.b[0]])
            tags[link.b] = (*kind, "b", first_of_atom[link.a[0]])
    return {first: _fused(graph, poses, tags, inner_edges) for first, poses in poses_by_first.items()}


def propagate_poses(start: Key, pose: Pose, steps: Mapping[Key, list[tuple[Key, Pose]]]) -> dict[Key, Pose]:
    """Return the poses of ``start``, whose ``pose`` is given, and of all nodes that can be reached from it.

    ``steps`` has the neighbours of each node, with their poses in the frame of the node. Near nodes come first.
    """
    poses = {start: pose}
    queue = [start]
    for node in queue:
        for neighbour, pose_in_node in steps.get(node, ()):
            if neighbour not in poses:
                poses[neighbour] = compose(poses[node], pose_in_node)
                queue.append(neighbour)
    return poses


def _fused(graph: Graph, poses: dict[str, Pose], tags: dict[Edge, object], inner: set[Edge]) -> Fused:
    """Unite the atoms with these poses in the frame of the first atom.

    ``inner`` edges lie between two atoms and disappear. Neighbouring edges in a line become one edge if their ``tags``
    are equal.
    """
    first = graph.atoms[next(iter(poses))]
    ring = _ring(graph, poses, inner)
    corners = [index for index in range(len(ring)) if not _is_collinear(ring, tags, index)]
    # Edge n of the outline starts at corner n. Edges of the ring before the first corner continue the last edge.
    edges: dict[Edge, int] = {}
    for index, (edge, _) in enumerate(ring):
        corners_until_here = sum(corner <= index for corner in corners)
        edges[edge] = (corners_until_here - 1) % len(corners)
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
    """Return the outer edges of the atoms in the order in which they follow each other, each with its start (mm).

    ``inner_edges`` lie between two atoms and are left out. Raises ComponentError if the outer edges form no single ring.
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
    """Return whether the edges before and after point ``i`` of the ring lie in a line and have equal tags."""
    edge_before, point_before = ring[i - 1]
    edge_after, point = ring[i]
    _, point_after = ring[(i + 1) % len(ring)]
    if tags.get(edge_before) != tags.get(edge_after):
        return False
    ux, uy = point[0] - point_before[0], point[1] - point_before[1]
    vx, vy = point_after[0] - point[0], point_after[1] - point[1]
    cross, dot = ux * vy - uy * vx, ux * vx + uy * vy
    return abs(cross) <= GRID_MM * math.hypot(ux, uy) * math.hypot(vx, vy) and dot > 0


def _moved(hole: Hole, pose: Pose) -> Hole:
    center = None if hole.center_mm is None else _flat(pose, hole.center_mm)
    return replace(hole, outline_mm=tuple(_flat(pose, point) for point in hole.outline_mm), center_mm=center)


def _flat(pose: Pose, point: Point) -> Point:
    return apply(pose, *point)[:2]


def _key(point: Point) -> tuple[int, int]:
    return (round(point[0] / GRID_MM / 100), round(point[1] / GRID_MM / 100))
