"""Fuses rigidly linked faces to one face with a common outline and all their holes, marks and clearances.

Input: a graph of components' faces and links. Output: the fused faces, each with the poses of the components' faces that
it consists of, and with the outline edge in which each of their edges lies.
"""

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace
from typing import Literal, NamedTuple, TypeVar

from foldcar.car.components.component import ComponentError
from foldcar.car.components.shape import ComponentFace, Edge, Graph, LinkKind
from foldcar.car.folded.model import IDENTITY, Face, Hole, Point, Pose, PrintedOutline, ToolClearance
from foldcar.car.folded.pose import across_crease, apply, compose

Key = TypeVar("Key")
# Directions count as parallel below this sine; points closer than 100 times this, in mm, are the same.
GRID_MM = 1e-6


class Fused(NamedTuple):
    """A face that consists of one or several components' faces. Its frame is that of ``first``, one of them.

    ``poses`` are their poses in it, by path. ``edges`` has the index of the outline edge in which each of their edges
    lies.
    """

    face: Face
    first: ComponentFace
    poses: dict[str, Pose]
    edges: dict[Edge, int]


class RingEdge(NamedTuple):
    """An outer edge of a fused face, with its start and its end (mm) in the frame of that face."""

    edge: Edge
    start: Point
    end: Point

    @property
    def direction(self) -> Point:
        """The vector from the start to the end."""
        return (self.end[0] - self.start[0], self.end[1] - self.start[1])


class EdgeLink(NamedTuple):
    """How an edge is linked, as edge ``a`` or ``b`` of a link, and the path of the fused face it is linked to."""

    kind: LinkKind
    angle_rad: float
    depth_mm: float
    end: Literal["a", "b"]
    partner: str


def fuse(graph: Graph) -> dict[str, Fused]:
    """Unite the faces of a graph that rigid links connect to *fused faces*, and return these.

    A fused face is known by the path of its first component's face. A face without rigid links is a fused face of its
    own. Edges between two united faces disappear. Raises ComponentError if the outline of a fused face is not one
    polygon.
    """
    poses_of_fused = _poses_of_fused(graph)
    # The path of the fused face that contains each component's face.
    fused_path: dict[str, str] = {}
    for path, poses in poses_of_fused.items():
        fused_path |= dict.fromkeys(poses, path)
    # Edges with rigid links lie inside a fused face. Other edges that follow each other in a straight line and are linked
    # equally become one edge of the fused face.
    inner_edges: set[Edge] = set()
    link_of_edge: dict[Edge, EdgeLink] = {}
    for link in graph.links:
        if link.kind == "rigid":
            inner_edges.update((link.a, link.b))
        else:
            face_a, face_b = fused_path[link.a.face], fused_path[link.b.face]
            link_of_edge[link.a] = EdgeLink(link.kind, link.angle_rad, link.depth_mm, end="a", partner=face_b)
            link_of_edge[link.b] = EdgeLink(link.kind, link.angle_rad, link.depth_mm, end="b", partner=face_a)
    return {path: _fused(graph, poses, link_of_edge, inner_edges) for path, poses in poses_of_fused.items()}


def _poses_of_fused(graph: Graph) -> dict[str, dict[str, Pose]]:
    """Return the poses of all faces that are rigidly connected to each other, group by group.

    Such a group of faces becomes one flat *fused face*. A group is known by the path of its first face, and has the poses
    of all its faces, by their paths, in the frame of the first face.
    """
    # The faces to which each face is rigidly linked, with their poses in its frame.
    neighbours: dict[str, list[tuple[str, Pose]]] = defaultdict(list)
    for link in graph.links:
        if link.kind == "rigid":
            for edge, opposite in ((link.a, link.b), (link.b, link.a)):
                pose = across_crease(graph.ends_mm(edge), graph.ends_mm(opposite), 0.0)
                neighbours[edge.face].append((opposite.face, pose))
    poses_of_fused: dict[str, dict[str, Pose]] = {}
    reached: set[str] = set()
    for path in graph.faces:
        if path not in reached:
            poses_of_fused[path] = propagate_poses(path, IDENTITY, neighbours)
            reached.update(poses_of_fused[path])
    return poses_of_fused


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


def _fused(graph: Graph, poses: dict[str, Pose], link_of_edge: dict[Edge, EdgeLink], inner_edges: set[Edge]) -> Fused:
    """Unite the components' faces whose ``poses`` are given in the frame of the first one.

    ``inner_edges`` are the edges between two of them, which disappear. Two outer edges that follow each other in a
    straight line become one edge if their values in ``link_of_edge``, which says how an edge is linked, are equal.
    """
    first = graph.faces[next(iter(poses))]
    ring = _ring(graph, poses, inner_edges)
    # An edge of the fused face consists of outer edges in a line. Its start, a corner, is that of the first of them.
    corners = [index for index in range(len(ring)) if not _continues_edge_before(ring, link_of_edge, index)]
    # The index of the fused face's edge in which each outer edge lies. The ring may begin in the middle of a line: outer
    # edges before the first corner belong to the last edge.
    edges: dict[Edge, int] = {}
    fused_edge = len(corners) - 1
    for index, ring_edge in enumerate(ring):
        if index in corners:
            fused_edge = corners.index(index)
        edges[ring_edge.edge] = fused_edge
    face = _with_contents(graph, poses, Face(first.path, tuple(ring[index].start for index in corners), role=first.role))
    return Fused(face, first, poses, edges)


def _with_contents(graph: Graph, poses: dict[str, Pose], fused_face: Face) -> Face:
    """Return a fused face with the holes, printed outlines and clearances of the components' faces in ``poses``."""
    holes: list[Hole] = []
    marks: list[PrintedOutline] = []
    clearances: list[ToolClearance] = []
    for path, pose in poses.items():
        face = graph.faces[path]
        for hole in face.holes:
            # The first face's holes keep their exact coordinates.
            holes.append(hole if pose is IDENTITY else _moved(hole, pose))
        for mark in face.marks:
            marks.append(PrintedOutline(mark.name, tuple(_flat(pose, point) for point in mark.outline_mm)))
        for clearance in face.clearances:
            clearances.append(replace(clearance, pose=compose(pose, clearance.pose)))
    return replace(fused_face, holes=tuple(holes), marks=tuple(marks), clearances=tuple(clearances))


def _ring(graph: Graph, poses: dict[str, Pose], inner_edges: set[Edge]) -> list[RingEdge]:
    """Return the outer edges of the faces in ``poses``, in the order in which they follow each other.

    ``inner_edges`` lie between two faces and are left out. Raises ComponentError if the outer edges form no single ring.
    """
    outer_edges = _outer_edges(graph, poses, inner_edges)
    if len(poses) == 1:
        return outer_edges
    # Except for rounding, the end of an edge is the start of the next one.
    edge_by_start = {_rounded(ring_edge.start): ring_edge for ring_edge in outer_edges}
    first = next(iter(edge_by_start.values()))
    last = first
    ring = [first]
    while _rounded(last.end) != _rounded(first.start):
        next_edge = edge_by_start.get(_rounded(last.end))
        # An outline that returns to an edge other than the first one would be followed for ever.
        is_endless = len(ring) > len(edge_by_start)
        if next_edge is None or is_endless:
            message = "is fused with its neighbours into something without a closed outline"
            raise ComponentError(last.edge.face, message)
        ring.append(next_edge)
        last = next_edge
    if len(ring) != len(edge_by_start):
        raise ComponentError(last.edge.face, "is fused with its neighbours into more than one outline")
    return ring


def _outer_edges(graph: Graph, poses: dict[str, Pose], inner_edges: set[Edge]) -> list[RingEdge]:
    """Return the edges that may be on the outline of several faces that are fused to one face.

    ``poses`` are the poses of these faces in the fused one, by path. ``inner_edges``, where two of the faces meet, are
    left out. The ends of an edge are given in the frame of the fused face.
    """
    outer_edges: list[RingEdge] = []
    for path, pose in poses.items():
        for index in range(len(graph.faces[path].outline_mm)):
            edge = Edge(path, index)
            if edge in inner_edges:
                continue
            start, end = graph.ends_mm(edge)
            # A single face is not moved, so its corners keep their exact coordinates.
            if len(poses) > 1:
                start, end = _flat(pose, start), _flat(pose, end)
            outer_edges.append(RingEdge(edge, start, end))
    return outer_edges


def _continues_edge_before(ring: list[RingEdge], link_of_edge: dict[Edge, EdgeLink], index: int) -> bool:
    """Return whether edge ``index`` of the ring has the same direction and the same link as the edge before it."""
    before, ring_edge = ring[index - 1], ring[index]
    are_linked_equally = link_of_edge.get(before.edge) == link_of_edge.get(ring_edge.edge)
    return are_linked_equally and _have_same_direction(before.direction, ring_edge.direction)


def _have_same_direction(first: Point, second: Point) -> bool:
    """Return whether two vectors point in the same direction, except for rounding."""
    (ux, uy), (vx, vy) = first, second
    # The two products are the lengths of the vectors times the sine and the cosine of the angle between them.
    cross_product, dot_product = ux * vy - uy * vx, ux * vx + uy * vy
    lengths = math.hypot(ux, uy) * math.hypot(vx, vy)
    return dot_product > 0 and abs(cross_product) <= GRID_MM * lengths


def _moved(hole: Hole, pose: Pose) -> Hole:
    center = None if hole.center_mm is None else _flat(pose, hole.center_mm)
    return replace(hole, outline_mm=tuple(_flat(pose, point) for point in hole.outline_mm), center_mm=center)


def _flat(pose: Pose, point: Point) -> Point:
    return apply(pose, *point)[:2]


def _rounded(point: Point) -> tuple[int, int]:
    """Return the coordinates of a point in steps of 100 GRID_MM, as whole numbers."""
    x, y = point
    return (round(x / GRID_MM / 100), round(y / GRID_MM / 100))
