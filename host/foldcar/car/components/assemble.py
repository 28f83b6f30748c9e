"""Assembles a component: joins its fused faces over folds to pieces and poses each piece in the car.

Input: a solved component. Output: distinct pieces (trees of faces) with their counts, the poses of their copies, joins,
mounts and axles. A loop of folds, or a face without any join, is a ComponentError.
"""

import math
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

from foldcar.car.components.component import Component, ComponentError
from foldcar.car.components.equal_pieces import IndexedJoin, PieceEdge, Place, merge_equal_pieces, numbered_titles
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
# Tolerance (mm) on the equality of the lengths of two joined edges, after their faces were fused.
LENGTH_TOLERANCE_MM = 1e-4


@dataclass(frozen=True)
class Assembly:
    """A component's pieces and parts with their poses, in the component's frame."""

    pieces: tuple[Piece, ...]
    placed: tuple[PlacedPiece, ...]
    joins: tuple[Join, ...]
    mounts: tuple[Mount, ...]
    axles: tuple[Axle, ...]


class Seam(NamedTuple):
    """Two edges of fused faces that meet, the link that joins them, and the length of edge ``b``.

    An edge names its fused face by the path of the first component's face in it.
    """

    link: EdgeJoin
    a: Edge
    b: Edge
    length_mm: float


class Tab(NamedTuple):
    """The face of a tab, and the seam that it joins: it grows from edge b, and is glued to the face of edge a."""

    face: Face
    seam: Seam


def build(component: Component, graph: Graph | None = None) -> Graph:
    """Build a solved component and its subcomponents; return the graph of their faces and links."""
    graph = graph if graph is not None else Graph()
    for child in component.children.values():
        build(child, graph)
    component.build(Shape(component.path, component.body, graph, component.parts))
    return graph


def assemble(graph: Graph) -> Assembly:
    """Return the pieces of a graph, with everything that is fixed to them, in the frame of the component.

    The pose of the face that ``graph.origin`` names is known, by default that of the first face; all others follow
    from it. Raises ComponentError for a loop of folds, or for a face that is joined to nothing.
    """
    builder = _Pieces(graph)
    root_poses = builder.root_poses()
    places = []
    # Mounts and axles are given in the frames of components' faces.
    face_poses: dict[str, Pose] = {}
    for sheet, root_pose in zip(builder.sheets, root_poses, strict=True):
        root_path = next(iter(sheet))
        # A piece belongs to the body of its root face.
        places.append(Place(builder.fused[root_path].first.body, root_pose))
        for fused_path, pose_in_piece in sheet.items():
            for face_path, pose_in_fused in builder.fused[fused_path].poses.items():
                face_poses[face_path] = compose(root_pose, pose_in_piece, pose_in_fused)
    distinct, placed, joins = merge_equal_pieces(builder.pieces(), places, list(builder.joins()))
    mounts = []
    for mount in graph.mounts:
        face_path = str(mount.face)
        name = builder.names[builder.fused_path[face_path]]
        mounts.append(replace(mount, pose=compose(face_poses[face_path], mount.pose), face=name))
    axles = []
    for face_path, axle in graph.axles:
        axles.append(replace(axle, center_mm=apply(face_poses[face_path], *axle.center_mm)))
    return Assembly(tuple(distinct), tuple(placed), tuple(joins), tuple(mounts), tuple(axles))


def _seams(graph: Graph, fused: dict[str, Fused], fused_path: dict[str, str]) -> Iterator[Seam]:
    """Yield one seam for each pair of edges of fused faces that links connect.

    ``fused`` has the fused faces by path, and ``fused_path`` the path of the fused face that each component's face is
    part of. Several links can lie on the same pair of fused edges. Raises ComponentError if the two edges of a seam
    differ in length.
    """

    def fused_edge(edge: Edge) -> Edge:
        """Return the edge of a fused face in which the edge of a component's face lies."""
        path = fused_path[edge.face]
        return Edge(path, fused[path].edges[edge])

    def length_mm(edge: Edge) -> float:
        return math.dist(*side(fused[edge.face].face.outline_mm, edge.index))

    yielded = set()
    for link in graph.links:
        if link.kind == "rigid":
            continue
        a, b = fused_edge(link.a), fused_edge(link.b)
        if (a, b) in yielded:
            continue
        yielded.add((a, b))
        # A tab's edge is shorter than the edge that it is glued to, by the inset at each end.
        if abs(length_mm(a) - length_mm(b) - 2 * link.inset_mm) > LENGTH_TOLERANCE_MM:
            message = f"meets {link.b.face} in edges of {length_mm(a):g} and {length_mm(b):g} mm once they are fused"
            raise ComponentError(link.a.face, message)
        yield Seam(link, a, b, length_mm(b))


class _Pieces:
    """The pieces of a graph. A fused face is known by its path, that of the first component's face in it.

    ``fused_path`` has the path of the fused face that each component's face is part of. ``sheets`` has the fused faces
    of each piece, parents before children, with their poses in the frame of the first face, the piece's root.
    ``piece_of`` is the index of the piece of each fused face, and ``names`` its name within the piece.
    """

    def __init__(self, graph: Graph) -> None:
        self.graph, self.fused = graph, fuse(graph)
        self.fused_path = {path: fused_path for fused_path, fused in self.fused.items() for path in fused.poses}
        self.seams = list(_seams(graph, self.fused, self.fused_path))
        self.folds = [seam for seam in self.seams if seam.link.kind in FOLDED]
        self.sheets = self._sheets()
        self.piece_of = {path: index for index, sheet in enumerate(self.sheets) for path in sheet}
        self.names: dict[str, str] = {}
        for sheet in self.sheets:
            # The last part of the path if it is unique within the piece, else the whole path.
            last_parts = {path: path.rpartition(".")[2] for path in sheet}
            counts = Counter(last_parts.values())
            self.names |= {path: path if counts[name] > 1 else name for path, name in last_parts.items()}
        self.tabs = self._tabs()

    def _sheets(self) -> list[dict[str, Pose]]:
        """Return the fused faces of each piece, with their poses in the frame of the first one.

        Raises ComponentError for a loop of folds.
        """
        # The neighbours of each fused face over folds, with their poses in its frame.
        neighbours: dict[str, list[tuple[str, Pose]]] = defaultdict(list)
        for seam in self.folds:
            for edge, opposite in ((seam.a, seam.b), (seam.b, seam.a)):
                pose = across_crease(self._ends(edge), self._ends(opposite), seam.link.angle_rad)
                neighbours[edge.face].append((opposite.face, pose))
        sheets: list[dict[str, Pose]] = []
        reached: set[str] = set()
        for path in self.fused:
            if path in reached:
                continue
            sheet = propagate_poses(path, IDENTITY, neighbours)
            fold_count = sum(seam.a.face in sheet for seam in self.folds)
            # A tree of folds has one fold fewer than faces.
            if fold_count >= len(sheet):
                message = f"is in a loop of {fold_count} folds, which no flat sheet has; make one of them a tab"
                raise ComponentError(path, message)
            sheets.append(sheet)
            reached.update(sheet)
        return sheets

    def _tabs(self) -> list[Tab]:
        """Return the tabs in the order of their seams."""
        seams_of_piece: dict[int, list[Seam]] = defaultdict(list)
        for seam in self.seams:
            if seam.link.kind == "tab":
                seams_of_piece[self.piece_of[seam.b.face]].append(seam)
        tabs = []
        for seams in seams_of_piece.values():
            # Tabs of one piece that join the same two faces are numbered.
            titles = numbered_titles([f"{self.names[seam.b.face]} tab to {self.names[seam.a.face]}" for seam in seams])
            tabs += [Tab(_tab(title, seam), seam) for title, seam in zip(titles, seams, strict=True)]
        # Joins are numbered in the order of the seams, not of the pieces.
        return sorted(tabs, key=lambda tab: self.seams.index(tab.seam))

    def local(self, path: str) -> Pose:
        """Return the pose of a fused face in its piece."""
        return self.sheets[self.piece_of[path]][path]

    def _ends(self, edge: Edge) -> tuple[Point, Point]:
        return side(self.fused[edge.face].face.outline_mm, edge.index)

    def _ref(self, edge: Edge) -> EdgeRef:
        return EdgeRef(self.names[edge.face], edge.index)

    def _piece_edge(self, edge: Edge) -> PieceEdge:
        return PieceEdge(self.piece_of[edge.face], self._ref(edge))

    def pieces(self) -> list[Piece]:
        """Return the pieces with their faces, creases and tabs."""
        return [self._piece(index, sheet) for index, sheet in enumerate(self.sheets)]

    def _piece(self, index: int, sheet: dict[str, Pose]) -> Piece:
        """Return a piece with its faces and creases, each child after its parent, and with its tabs."""
        position = {path: number for number, path in enumerate(sheet)}
        # Each crease with the position of its child among the faces.
        creases: list[tuple[int, Crease]] = []
        for seam in self.folds:
            if seam.a.face not in position:
                continue
            parent, child = sorted((seam.a, seam.b), key=lambda edge: position[edge.face])
            link = seam.link
            crease = Crease(
                f"{self.names[parent.face]} to {self.names[child.face]}", self._ref(parent), self._ref(child),
                link.angle_rad, flexure=link.kind == "hinge", min_rad=link.min_rad, max_rad=link.max_rad,
                bend=link.kind == "bend",
            )  # fmt: skip
            creases.append((position[child.face], crease))
        creases.sort(key=lambda position_and_crease: position_and_crease[0])
        faces = [replace(self.fused[path].face, name=self.names[path]) for path in sheet]
        folds = [crease for _, crease in creases]
        for tab in self.tabs:
            if self.piece_of[tab.seam.b.face] == index:
                faces.append(tab.face)
                tab_edge = EdgeRef(tab.face.name, 0)
                folds.append(Crease(tab.face.name, self._ref(tab.seam.b), tab_edge, tab.seam.link.angle_rad))
        root_path = next(iter(sheet))
        root = self.fused[root_path].first
        label = root.piece or self.names[root_path]
        return Piece(label, label, tuple(faces), tuple(folds), root.thickness_mm)

    def root_poses(self) -> list[Pose]:
        """Return the pose of the root face of each piece in the component's frame.

        Placements and tabs give poses of pieces relative to each other. They are followed from the piece with the
        face ``graph.origin``, whose pose is known, to all others. Raises ComponentError for a piece that is not
        reached.
        """
        neighbours: dict[int, list[tuple[int, Pose]]] = defaultdict(list)

        def add(a: str, b: str, b_in_a: Pose) -> None:
            """Record that the pieces of the fused faces a and b are neighbours; ``b_in_a`` is b's pose in a's frame."""
            piece_b_in_piece_a = compose(self.local(a), b_in_a, inverse(self.local(b)))
            neighbours[self.piece_of[a]].append((self.piece_of[b], piece_b_in_piece_a))
            neighbours[self.piece_of[b]].append((self.piece_of[a], inverse(piece_b_in_piece_a)))

        # A placement names components' faces, so both poses in their fused faces count.
        for placement in self.graph.placements:
            on, face = self.fused_path[placement.on], self.fused_path[placement.face]
            pose_on = self.fused[on].poses[placement.on]
            pose_in_fused = self.fused[face].poses[placement.face]
            add(on, face, compose(pose_on, placement.pose, inverse(pose_in_fused)))
        for seam in self.seams:
            if seam.link.kind == "tab" and self.piece_of[seam.a.face] != self.piece_of[seam.b.face]:
                across = across_crease(self._ends(seam.a), self._ends(seam.b), seam.link.angle_rad)
                # The tab lies this much above the face of edge a. So edge b, from which the tab grows, does too.
                above = translation(0, 0, seam.link.inset_mm)
                add(seam.a.face, seam.b.face, compose(above, across))
        origin_path, origin_pose = self.graph.origin or (next(iter(self.graph.faces)), IDENTITY)
        fused_path = self.fused_path[origin_path]
        # From the component's frame to the origin face, back to its fused face, and from there to the root of its piece.
        to_fused = inverse(self.fused[fused_path].poses[origin_path])
        start_pose = compose(origin_pose, to_fused, inverse(self.local(fused_path)))
        poses = propagate_poses(self.piece_of[fused_path], start_pose, neighbours)
        for path, index in self.piece_of.items():
            if index not in poses:
                raise ComponentError(path, "is joined to nothing")
        return [poses[index] for index in range(len(self.sheets))]

    def joins(self) -> Iterator[IndexedJoin]:
        """Yield the joins of tabs, of laminated layers, and of contacts between faces whose poses are known already.

        Joins of one seam get the same number. For example, these are edges that tuck into the same edge, and all
        hooks of a strip in one disc.
        """
        for number, tab in enumerate(self.tabs):
            glued_at = self._piece_edge(tab.seam.a)
            tab_edge = PieceEdge(self.piece_of[tab.seam.b.face], EdgeRef(tab.face.name, 0))
            # A tab that is glued within its own piece is a lap.
            kind: JoinKind = "lap" if tab_edge.piece == glued_at.piece else "tab"
            yield IndexedJoin(number, kind, tab_edge, glued_at, tab.seam.length_mm)
        for placement in self.graph.placements:
            if placement.laminated:
                # A join with a whole face names its edge 0.
                layer = self._piece_edge(Edge(self.fused_path[placement.face], 0))
                on = self._piece_edge(Edge(self.fused_path[placement.on], 0))
                yield IndexedJoin(None, "laminate", layer, on, 0.0)
        yield from self._contact_joins()

    def _contact_joins(self) -> Iterator[IndexedJoin]:
        """Yield one join for each pair of edges that contacts connect; several contacts may lie on the same edges."""
        yielded = set()
        for contact in self.graph.contacts:
            a, b = self._fused_edge(contact.a), self._fused_edge(contact.b)
            if (contact.kind, a, b, contact.slot) in yielded:
                continue
            yielded.add((contact.kind, a, b, contact.slot))
            # Joins of equal seams share a number; by default each contact has a number of its own.
            seam: object = contact
            if self.fused[a.face].face.role == "rim":
                seam = (self.piece_of[a.face], self.piece_of[b.face])
            elif contact.kind == "tuck":
                seam = ("tuck", a.face, b)
            length_mm = 0.0 if contact.kind == "laminate" else math.dist(*self.graph.ends_mm(contact.a))
            yield IndexedJoin(seam, contact.kind, self._piece_edge(a), self._piece_edge(b), length_mm, contact.slot)

    def _fused_edge(self, edge: Edge) -> Edge:
        """Return the edge of a fused face in which an end of a contact lies.

        If the edge lies inside the fused face, the contact is one of whole faces, which edge 0 stands for.
        """
        path = self.fused_path[edge.face]
        return Edge(path, self.fused[path].edges.get(edge, 0))


def _tab(name: str, seam: Seam) -> Face:
    """Return the face of a tab: a trapezoid on the seam, as deep as its link says."""
    length, depth = seam.length_mm, seam.link.depth_mm
    inset = min(depth, length / 4)
    return Face(name, ((0.0, 0.0), (length, 0.0), (length - inset, depth), (inset, depth)), role="tab")
