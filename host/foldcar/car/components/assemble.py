"""Assembles a component: joins its fused faces over folds to pieces and poses each piece in the car.

Input: a solved component. Output: distinct pieces (trees of faces) with their counts, the poses of their copies, joins,
mounts and axles. A loop of folds, or a face without any join, is a ComponentError.
"""

import math
import re
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

from foldcar.car.components.component import Component, ComponentError
from foldcar.car.components.fuse import Fused, fuse, propagate_poses
from foldcar.car.components.shape import Edge, EdgeJoin, Graph, Shape
from foldcar.car.folded.model import (
    IDENTITY,
    Axle,
    Crease,
    EdgeRef,
    Face,
    Join,
    JoinKind,
    Mount,
    Piece,
    PlacedPiece,
    Point,
    Pose,
)
from foldcar.car.folded.pose import across_crease, apply, compose, inverse, side, translation

# Links that make creases of one piece.
FOLDED = ("fold", "bend", "hinge")


@dataclass(frozen=True)
class Assembly:
    """A component's pieces and parts with their poses, in the component's frame."""

    pieces: tuple[Piece, ...]
    placed: tuple[PlacedPiece, ...]
    joins: tuple[Join, ...]
    mounts: tuple[Mount, ...]
    axles: tuple[Axle, ...]


class Seam(NamedTuple):
    """Two edges of fused faces that meet: ``a`` and ``b``, each as (path of the first atom, index); the length of
    b; a link.
    """

    link: EdgeJoin
    a: Edge
    b: Edge
    length_mm: float


class IndexedJoin(NamedTuple):
    """A join of two pieces by their indices; joins of one ``seam`` have the same number."""

    seam: object
    kind: JoinKind
    a: tuple[int, EdgeRef]
    b: tuple[int, EdgeRef]
    length_mm: float
    slot: str | None = None


def build(component: Component, graph: Graph | None = None) -> Graph:
    """Build a solved component and its subcomponents; return the graph of their faces and links."""
    graph = graph if graph is not None else Graph()
    for child in component.children.values():
        build(child, graph)
    component.build(Shape(component.path, component.body, graph, component.parts))
    return graph


def assemble(graph: Graph) -> Assembly:
    """Return the assembly of a graph.

    The pose of the face that ``graph.origin`` names is known, by default that of the first face; all others follow
    from it. Raises ComponentError for a loop of folds, or for a face that is joined to nothing.
    """
    builder = _Pieces(graph)
    roots = builder.root_poses()
    # Each atom's pose in the component's frame: from the atom to its fused face, to the root of its piece, to the frame.
    atom_poses = {
        path: compose(roots[builder.piece_of[first]], builder.local(first), pose)
        for first, fused in builder.fused.items()
        for path, pose in fused.poses.items()
    }
    # A piece belongs to the body of its root face's first atom.
    bodies = [builder.fused[next(iter(sheet))].first.body for sheet in builder.sheets]
    places = list(zip(bodies, roots, strict=True))
    distinct, placed, joins = _merge_equal_pieces(builder.pieces(), places, list(builder.joins()))
    mounts = []
    for mount in graph.mounts:
        face_path = str(mount.face)
        face = builder.names[builder.owner[face_path]]
        mounts.append(replace(mount, pose=compose(atom_poses[face_path], mount.pose), face=face))
    axles = (replace(axle, center_mm=apply(atom_poses[face_path], *axle.center_mm)) for face_path, axle in graph.axles)
    return Assembly(tuple(distinct), tuple(placed), tuple(joins), tuple(mounts), tuple(axles))


def _seams(graph: Graph, fused: dict[str, Fused], owner: dict[str, str]) -> Iterator[Seam]:
    """Yield one seam for each pair of edges of fused faces that links connect.

    ``owner`` is the fused face of each atom. Several links between atoms can lie on the same pair of fused edges.
    Raises ComponentError if the two edges of a seam differ in length.
    """
    yielded = set()
    for link in (link for link in graph.links if link.kind != "rigid"):
        a, b = ((owner[path], fused[owner[path]].edges[path, index]) for path, index in (link.a, link.b))
        if (a, b) not in yielded:
            length_a, length_b = (math.dist(*side(fused[path].face.outline_mm, index)) for path, index in (a, b))
            # A tab's edge is shorter than the edge that it is glued to, by the inset at each end.
            if abs(length_a - length_b - 2 * link.inset_mm) > 1e-4:
                message = f"meets {link.b[0]} in edges of {length_a:g} and {length_b:g} mm once they are fused"
                raise ComponentError(link.a[0], message)
            yielded.add((a, b))
            yield Seam(link, a, b, length_b)


class _Pieces:
    """The pieces of a graph. A fused face is known by the path of its first atom.

    ``sheets`` has the fused faces of each piece, parents before children, with their poses in the frame of the first
    face. ``piece_of`` is the index of the piece of a fused face. ``tabs`` are the seams with a tab: the tab grows
    from edge b, and is glued to the face of edge a, in the plane of that face.
    """

    def __init__(self, graph: Graph) -> None:
        self.graph, self.fused = graph, fuse(graph)
        # The path of the fused face that each atom belongs to.
        self.owner = {path: first for first, face in self.fused.items() for path in face.poses}
        self.seams = list(_seams(graph, self.fused, self.owner))
        self.folds = [seam for seam in self.seams if seam.link.kind in FOLDED]
        # For each fused face, its neighbours over folds with their poses in its frame. An edge is a face and an index.
        steps: dict[str, list[tuple[str, Pose]]] = defaultdict(list)
        for seam in self.folds:
            for edge, opposite in ((seam.a, seam.b), (seam.b, seam.a)):
                step = across_crease(self._ends(edge), self._ends(opposite), seam.link.angle_rad)
                steps[edge[0]].append((opposite[0], step))
        self.sheets: list[dict[str, Pose]] = []
        self.piece_of: dict[str, int] = {}
        for first in (first for first in self.fused if first not in self.piece_of):
            self.sheets.append(propagate_poses(first, IDENTITY, steps))
            self.piece_of |= dict.fromkeys(self.sheets[-1], len(self.sheets) - 1)
            fold_count = sum(seam.a[0] in self.sheets[-1] for seam in self.folds)
            if fold_count >= len(self.sheets[-1]):
                # A tree of folds has one fold fewer than faces.
                message = f"is in a loop of {fold_count} folds, which no flat sheet has; make one of them a tab"
                raise ComponentError(first, message)
        self.names: dict[str, str] = {}
        for sheet in self.sheets:
            # The last part of the path if it is unique within the piece, else the whole path.
            short = {first: first.rpartition(".")[2] for first in sheet}
            used = Counter(short.values())
            self.names |= {first: first if used[name] > 1 else name for first, name in short.items()}
        self.tabs: list[tuple[Face, Seam]] = []
        for index in range(len(self.sheets)):
            own_seams = [seam for seam in self.seams if seam.link.kind == "tab" and self.piece_of[seam.b[0]] == index]
            # Tabs of one piece that join the same two faces are numbered.
            titles = _titles([f"{self.names[seam.b[0]]} tab to {self.names[seam.a[0]]}" for seam in own_seams])
            self.tabs += [(_tab(title, seam), seam) for title, seam in zip(titles, own_seams, strict=True)]
        # Joins are numbered in the order of the seams, not of the pieces.
        self.tabs.sort(key=lambda tab: self.seams.index(tab[1]))

    def local(self, first: str) -> Pose:
        """Return the pose of a fused face in its piece."""
        return self.sheets[self.piece_of[first]][first]

    def _ends(self, edge: Edge) -> tuple[Point, Point]:
        return side(self.fused[edge[0]].face.outline_mm, edge[1])

    def _ref(self, edge: Edge) -> EdgeRef:
        return EdgeRef(self.names[edge[0]], edge[1])

    def pieces(self) -> list[Piece]:
        """Return the pieces with their faces, creases and tabs."""
        return [self._piece(index, sheet) for index, sheet in enumerate(self.sheets)]

    def _piece(self, index: int, sheet: dict[str, Pose]) -> Piece:
        """Return a piece with its faces, its tabs and its creases, each child after its parent."""
        order = {first: i for i, first in enumerate(sheet)}
        # Each crease with the position of its child in the order of the faces.
        creases = []
        for link, a, b, _ in (seam for seam in self.folds if seam.a[0] in order):
            parent, child = (a, b) if order[a[0]] < order[b[0]] else (b, a)
            name = f"{self.names[parent[0]]} to {self.names[child[0]]}"
            crease = Crease(
                name, self._ref(parent), self._ref(child), link.angle_rad, flexure=link.kind == "hinge",
                min_rad=link.min_rad, max_rad=link.max_rad, bend=link.kind == "bend",
            )  # fmt: skip
            creases.append((order[child[0]], crease))
        creases.sort(key=lambda pair: pair[0])
        own_tabs = [(face, seam) for face, seam in self.tabs if self.piece_of[seam.b[0]] == index]
        tab_creases = (Crease(face.name, self._ref(s.b), EdgeRef(face.name, 0), s.link.angle_rad) for face, s in own_tabs)
        faces = [replace(self.fused[first].face, name=self.names[first]) for first in sheet]
        folds = (*(crease for _, crease in creases), *tab_creases)
        root = self.fused[next(iter(sheet))].first
        label = root.piece or self.names[root.path]
        return Piece(label, label, (*faces, *(face for face, _ in own_tabs)), folds, root.thickness_mm)

    def root_poses(self) -> list[Pose]:
        """Return the pose of the first face of each piece in the car.

        Placements and tabs give poses of pieces relative to each other. They are followed from the piece with the
        face ``graph.origin``, whose pose is known, to all others. Raises ComponentError for a piece that is not
        reached.
        """
        neighbours: dict[int, list[tuple[int, Pose]]] = defaultdict(list)

        def add(a: str, b: str, relative: Pose) -> None:
            """Record that the pieces of fused faces a and b are neighbours; ``relative`` is b's pose in a's frame."""
            # The pose of b's piece in the frame of a's piece.
            step = compose(self.local(a), relative, inverse(self.local(b)))
            neighbours[self.piece_of[a]].append((self.piece_of[b], step))
            neighbours[self.piece_of[b]].append((self.piece_of[a], inverse(step)))

        for placement in self.graph.placements:
            a, b = self.owner[placement.on], self.owner[placement.face]
            on_pose, face_pose = self.fused[a].poses[placement.on], self.fused[b].poses[placement.face]
            add(a, b, compose(on_pose, placement.pose, inverse(face_pose)))
        for link, edge_a, edge_b, _ in self.seams:
            if link.kind == "tab" and self.piece_of[edge_a[0]] != self.piece_of[edge_b[0]]:
                across = across_crease(self._ends(edge_a), self._ends(edge_b), link.angle_rad)
                # The tab lies this much above the face that it is glued to, and the child's edge with it.
                add(edge_a[0], edge_b[0], compose(translation(0, 0, link.inset_mm), across))
        path, pose = self.graph.origin or (next(iter(self.graph.atoms)), IDENTITY)
        first = self.owner[path]
        # From the atom's pose in the car back to the fused face, and from there to the root of its piece.
        start_pose = compose(pose, inverse(self.fused[first].poses[path]), inverse(self.local(first)))
        poses = propagate_poses(self.piece_of[first], start_pose, neighbours)
        for face, index in self.piece_of.items():
            if index not in poses:
                raise ComponentError(face, "is joined to nothing")
        return [poses[i] for i in range(len(self.sheets))]

    def joins(self) -> Iterator[IndexedJoin]:
        """Yield the joins of tabs, of laminated layers, and of contacts between faces whose poses are known already.

        Joins of one seam get the same number. For example, these are edges that tuck into the same edge, and all
        hooks of a strip in one disc.
        """
        for i, (face, (_, a, b, length)) in enumerate(self.tabs):
            kind: JoinKind = "lap" if self.piece_of[a[0]] == self.piece_of[b[0]] else "tab"
            ends = (self.piece_of[b[0]], EdgeRef(face.name, 0)), (self.piece_of[a[0]], self._ref(a))
            yield IndexedJoin(i, kind, *ends, length)
        for placement in (placement for placement in self.graph.placements if placement.laminated):
            faces = self.owner[placement.face], self.owner[placement.on]
            layer, on = ((self.piece_of[face], self._ref((face, 0))) for face in faces)
            yield IndexedJoin(None, "laminate", layer, on, 0.0)
        # Contacts of the same two edges of fused faces are one join.
        by_ends: dict[tuple[object, ...], IndexedJoin] = {}
        for contact in self.graph.contacts:
            first, second = (self.owner[path] for path, _ in (contact.a, contact.b))
            a, b = (
                (first, self.fused[first].edges.get(contact.a, 0)),
                (second, self.fused[second].edges.get(contact.b, 0)),
            )
            # Joins of equal seams share a number: by default each contact has its own.
            seam: object = ("tuck", first, b) if contact.kind == "tuck" else contact
            if self.fused[first].face.role == "rim":
                seam = (self.piece_of[first], self.piece_of[second])
            length = 0.0 if contact.kind == "laminate" else math.dist(*self.graph.ends_mm(contact.a))
            ends = (self.piece_of[first], self._ref(a)), (self.piece_of[second], self._ref(b))
            join = IndexedJoin(seam, contact.kind, *ends, length, contact.slot)
            by_ends.setdefault((contact.kind, a, b, contact.slot), join)
        yield from by_ends.values()


def _tab(name: str, seam: Seam) -> Face:
    """Return the face of a tab: a trapezoid on the seam, as deep as its link says."""
    length, depth = seam.length_mm, seam.link.depth_mm
    inset = min(depth, length / 4)
    return Face(name, ((0.0, 0.0), (length, 0.0), (length - inset, depth), (inset, depth)), (), "tab")


def _titles(labels: list[str]) -> list[str]:
    """Return the labels. To a label that occurs more than once, " 1", " 2", … are appended."""
    counts, seen = Counter(labels), Counter[str]()
    numbered = []
    for label in labels:
        seen[label] += 1
        numbered.append(f"{label} {seen[label]}" if counts[label] > 1 else label)
    return numbered


def _merge_equal_pieces(
    pieces: list[Piece], places: list[tuple[str, Pose]], indexed_joins: list[IndexedJoin]
) -> tuple[list[Piece], list[PlacedPiece], list[Join]]:
    """Merge equal pieces to one piece with a count; return the pieces, their placed copies, and the numbered joins.

    Pieces are merged only if all their joins are laminations onto others. ``places`` are the (body, pose) of the
    pieces. Joins are numbered from 1, and those of one seam share a number.
    """
    unmergeable = {join.b[0] for join in indexed_joins} | {join.a[0] for join in indexed_joins if join.kind != "laminate"}
    distinct: list[Piece] = []
    index_of: list[int] = []
    index_by_content: dict[Piece, int] = {}
    for i, piece in enumerate(pieces):
        anonymous = replace(piece, faces=tuple(_without_names(face) for face in piece.faces))
        index = len(distinct) if i in unmergeable else index_by_content.setdefault(anonymous, len(distinct))
        if index < len(distinct):
            distinct[index] = replace(distinct[index], count=distinct[index].count + 1)
        else:
            distinct.append(piece)
        index_of.append(index)
    names = _titles([piece.label for piece in distinct])
    distinct = [replace(piece, name=title, label=title) for piece, title in zip(distinct, names, strict=True)]
    placed_pieces, copies = [], Counter[int]()
    for index, (body, pose) in zip(index_of, places, strict=True):
        placed_pieces.append(PlacedPiece(distinct[index].name, copies[index], body, pose))
        copies[index] += 1

    def named_end(index: int, ref: EdgeRef) -> tuple[str, EdgeRef]:
        """Return one end of a join: the name of a piece, and an edge with the name of its face.

        For a piece that was merged with an equal one, these are the names of the piece that was kept.
        """
        face = [face.name for face in pieces[index].faces].index(ref.face)
        piece = distinct[index_of[index]]
        return piece.name, EdgeRef(piece.faces[face].name, ref.index)

    joins: list[Join] = []
    numbers: dict[object, int] = {}
    for join in indexed_joins:
        a, b = named_end(*join.a), named_end(*join.b)
        # Laminations of all copies of a piece share a number.
        seam = a[0] if join.kind == "laminate" else join.seam
        number = numbers.setdefault((join.kind, seam), len(numbers) + 1)
        joins.append(Join(number, join.kind, *a, *b, join.length_mm, join.slot))
    return distinct, placed_pieces, joins


def _without_names(face: Face) -> Face:
    return replace(face, name="", holes=tuple(replace(hole, name=re.sub(r".*\.", "", hole.name)) for hole in face.holes))
