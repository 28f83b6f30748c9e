"""Assembles a component: joins its fused faces over folds to pieces and poses each piece in the car.

Input: a solved component. Output: distinct pieces (trees of faces) with their counts, the poses of their copies, joins,
mounts and axles. A loop of folds, or a face without any join, is a ComponentError.
"""

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

from foldcar.car.components.component import Component, ComponentError
from foldcar.car.components.equal_pieces import IndexedJoin, PieceEdge, Place, merge_equal_pieces, numbered_titles
from foldcar.car.components.fuse import fuse, propagate_poses
from foldcar.car.components.seams import Seam, seams_of
from foldcar.car.components.shape import Contact, Edge, Graph, Shape
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
    """Return the pieces of a graph with their joins, mounts and axles, all in the frame of the component.

    A *piece* is a sheet of film that is folded from one cut. It consists of *fused faces*, each made of components'
    faces that are rigidly linked. ``graph.origin`` gives the pose of one face, by default that the first face lies at
    the origin. All other poses follow from it. Raises ComponentError if folds connect faces in a loop, or if a face is
    joined to nothing.
    """
    builder = _Pieces(graph)
    root_poses = builder.root_poses()
    places = [Place(body, pose) for body, pose in zip(builder.bodies(), root_poses, strict=True)]
    distinct, placed, joins = merge_equal_pieces(builder.pieces(), places, list(builder.joins()))
    # Mounts and axles are given in the frames of the components' faces that they are on.
    face_poses = builder.face_poses(root_poses)
    mounts = []
    for mount in graph.mounts:
        face_path = str(mount.face)
        pose = compose(face_poses[face_path], mount.pose)
        mounts.append(replace(mount, pose=pose, face=builder.name_of_fused_face(face_path)))
    axles = []
    for face_path, axle in graph.axles:
        axles.append(replace(axle, center_mm=apply(face_poses[face_path], *axle.center_mm)))
    return Assembly(tuple(distinct), tuple(placed), tuple(joins), tuple(mounts), tuple(axles))


class _Pieces:
    """The pieces of a graph. A fused face is known by its path, that of the first component's face in it.

    ``fused_path`` has the path of the fused face that each component's face is part of. ``sheets`` has the fused faces
    of each piece, parents before children, with their poses in the frame of the first face, the piece's root.
    ``piece_of`` is the index of the piece of each fused face, and ``names`` its name within the piece.
    """

    def __init__(self, graph: Graph) -> None:
        """Fuse the faces of a graph, and find out which fused faces, folds and tabs make up each piece."""
        self.graph = graph
        self.fused = fuse(graph)
        self.fused_path: dict[str, str] = {}
        for fused_path, fused in self.fused.items():
            for face_path in fused.poses:
                self.fused_path[face_path] = fused_path
        self.seams = list(seams_of(graph, self.fused, self.fused_path))
        self.folds = [seam for seam in self.seams if seam.link.kind in FOLDED]
        self.sheets = self._sheets()
        self.piece_of: dict[str, int] = {}
        self.names: dict[str, str] = {}
        for index, sheet in enumerate(self.sheets):
            self.piece_of |= dict.fromkeys(sheet, index)
            self.names |= _short_names(sheet)
        self.tabs = self._tabs()

    def _sheets(self) -> list[dict[str, Pose]]:
        """Return the faces of each piece by their paths, with their poses in the frame of the piece's first face.

        The faces that folds connect are one piece, which can be cut from a flat sheet. Raises ComponentError if folds
        connect faces in a loop, which a flat sheet cannot have.
        """
        # For each face: the faces beyond its folds, with their poses in its frame.
        neighbours: dict[str, list[tuple[str, Pose]]] = defaultdict(list)
        for fold in self.folds:
            for edge, opposite in ((fold.a, fold.b), (fold.b, fold.a)):
                pose = across_crease(self._ends(edge), self._ends(opposite), fold.link.angle_rad)
                neighbours[edge.face].append((opposite.face, pose))
        sheets: list[dict[str, Pose]] = []
        reached: set[str] = set()
        for path in self.fused:
            if path in reached:
                continue
            sheet = propagate_poses(path, IDENTITY, neighbours)
            fold_count = sum(fold.a.face in sheet for fold in self.folds)
            # Without a loop, there is one fold fewer than faces.
            if fold_count >= len(sheet):
                message = f"is in a loop of {fold_count} folds, which no flat sheet has; make one of them a tab"
                raise ComponentError(path, message)
            sheets.append(sheet)
            reached.update(sheet)
        return sheets

    def _tabs(self) -> list[Tab]:
        """Return the tabs of all pieces. A *tab* is a face that is glued along an edge of another face.

        The two edges that a tab joins are its seam. The tabs are in the order of ``self.seams``.
        """
        # By the index of the piece from which their tabs grow.
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
        """Return the piece with this index, which consists of the fused faces in ``sheet`` and of its tabs."""
        faces = [replace(self.fused[path].face, name=self.names[path]) for path in sheet]
        creases = self._creases(sheet)
        # A tab grows from an edge of a fused face, edge b of its seam. The tab's own edge 0 lies on it.
        for tab in self.tabs:
            parent_edge = tab.seam.b
            if self.piece_of[parent_edge.face] == index:
                faces.append(tab.face)
                tab_edge = EdgeRef(tab.face.name, 0)
                creases.append(Crease(tab.face.name, self._ref(parent_edge), tab_edge, tab.seam.link.angle_rad))
        # The piece has the name that the component gave to its root face, else the name of this face.
        root_path = next(iter(sheet))
        root = self.fused[root_path].first
        name = root.piece or self.names[root_path]
        return Piece(name, label=name, faces=tuple(faces), creases=tuple(creases), thickness_mm=root.thickness_mm)

    def _creases(self, sheet: dict[str, Pose]) -> list[Crease]:
        """Return the creases between the faces of one piece of film, ordered as their child faces are in ``sheet``.

        ``sheet`` has the poses of the faces by their paths. Faces form a tree: a parent precedes its children, so each
        crease leads from an earlier face, its parent, to a later one.
        """
        position = {path: number for number, path in enumerate(sheet)}
        crease_by_child: dict[str, Crease] = {}
        for seam in self.folds:
            if seam.a.face not in position:
                continue
            parent, child = seam.a, seam.b
            if position[child.face] < position[parent.face]:
                parent, child = child, parent
            link = seam.link
            crease_by_child[child.face] = Crease(
                name=f"{self.names[parent.face]} to {self.names[child.face]}",
                parent=self._ref(parent),
                child=self._ref(child),
                angle_rad=link.angle_rad,
                flexure=link.kind == "hinge",
                min_rad=link.min_rad,
                max_rad=link.max_rad,
                bend=link.kind == "bend",
            )
        return [crease_by_child[path] for path in sheet if path in crease_by_child]

    def bodies(self) -> list[str]:
        """Return the rigid body to which each piece belongs, which is that of its root face."""
        root_paths = [next(iter(sheet)) for sheet in self.sheets]
        return [self.fused[root_path].first.body for root_path in root_paths]

    def name_of_fused_face(self, face_path: str) -> str:
        """Return the name of the fused face that contains a component's face."""
        return self.names[self.fused_path[face_path]]

    def face_poses(self, root_poses: Iterable[Pose]) -> dict[str, Pose]:
        """Return the pose of each component's face in the component's frame, from those of the pieces' root faces."""
        face_poses: dict[str, Pose] = {}
        for sheet, root_pose in zip(self.sheets, root_poses, strict=True):
            for fused_path, pose_in_piece in sheet.items():
                fused_face_pose = compose(root_pose, pose_in_piece)
                for face_path, pose_in_fused in self.fused[fused_path].poses.items():
                    face_poses[face_path] = compose(fused_face_pose, pose_in_fused)
        return face_poses

    def root_poses(self) -> list[Pose]:
        """Return the pose of the root face of each piece in the component's frame.

        The pose of the face ``graph.origin`` is given, and with it that of its piece. The poses of all other pieces
        follow from those of their neighbours. Raises ComponentError for a piece that has no connection to the first one.
        """
        origin_path, origin_pose = self.graph.origin or (next(iter(self.graph.faces)), IDENTITY)
        # From the pose of the origin face follows that of its fused face, and from this that of the root of its piece.
        fused_path = self.fused_path[origin_path]
        origin_in_fused = self.fused[fused_path].poses[origin_path]
        root_pose = compose(origin_pose, inverse(origin_in_fused), inverse(self.local(fused_path)))
        poses = propagate_poses(self.piece_of[fused_path], root_pose, self._neighbours_of_pieces())
        for path, index in self.piece_of.items():
            if index not in poses:
                raise ComponentError(path, "is joined to nothing")
        return [poses[index] for index in range(len(self.sheets))]

    def _neighbours_of_pieces(self) -> dict[int, list[tuple[int, Pose]]]:
        """Return the neighbours of each piece with their poses in its frame. Pieces are known by their indices.

        Two pieces are neighbours if a placement or a tab says how they lie relative to each other. A *placement* is a
        given pose of a face on another one. A *tab* is a flap of one piece that is glued to the other piece.

        A piece consists of fused faces, and a fused face of the faces of one or several components. Each of them has a
        pose in what it is a part of. The poses are combined to the pose of a piece in the frame of the other.
        """
        neighbours: dict[int, list[tuple[int, Pose]]] = defaultdict(list)

        def add_neighbours(face_a: str, face_b: str, b_in_a: Pose) -> None:
            """Add the pieces of two fused faces as neighbours. ``b_in_a`` is the pose of face b in the frame of a."""
            piece_a, piece_b = self.piece_of[face_a], self.piece_of[face_b]
            piece_b_in_piece_a = compose(self.local(face_a), b_in_a, inverse(self.local(face_b)))
            neighbours[piece_a].append((piece_b, piece_b_in_piece_a))
            neighbours[piece_b].append((piece_a, inverse(piece_b_in_piece_a)))

        for placement in self.graph.placements:
            fused_host, fused_face = self.fused_path[placement.on], self.fused_path[placement.face]
            # A placement is between two components' faces. Each of them has a pose in its fused face.
            host_in_fused = self.fused[fused_host].poses[placement.on]
            face_in_fused = self.fused[fused_face].poses[placement.face]
            add_neighbours(fused_host, fused_face, compose(host_in_fused, placement.pose, inverse(face_in_fused)))
        # A seam is where edge a of a face and edge b of another one meet.
        for seam in self.seams:
            connects_pieces = self.piece_of[seam.a.face] != self.piece_of[seam.b.face]
            if seam.link.kind == "tab" and connects_pieces:
                b_if_edges_meet = across_crease(self._ends(seam.a), self._ends(seam.b), seam.link.angle_rad)
                # But the tab, which grows from edge b, lies this much above the face of edge a. So face b does too.
                above = translation(0, 0, seam.link.inset_mm)
                add_neighbours(seam.a.face, seam.b.face, compose(above, b_if_edges_meet))
        return neighbours

    def joins(self) -> Iterator[IndexedJoin]:
        """Yield the joins that are made by hand: tabs, laminated layers, and the contacts of the graph.

        A *contact* is a join of faces that other links hold in their places, such as a tongue in its slot. Joins with
        the same ``seam`` get the same number in print. Each tab has its own seam. A layer has none yet: it gets its
        number when equal pieces are merged.
        """
        for tab_number, tab in enumerate(self.tabs):
            glued_at = self._piece_edge(tab.seam.a)
            tab_edge = PieceEdge(self.piece_of[tab.seam.b.face], EdgeRef(tab.face.name, 0))
            # A tab that is glued within its own piece is a lap.
            kind: JoinKind = "lap" if tab_edge.piece == glued_at.piece else "tab"
            yield IndexedJoin(seam=tab_number, kind=kind, a=tab_edge, b=glued_at, length_mm=tab.seam.length_mm)
        for placement in self.graph.placements:
            if placement.laminated:
                # Edge 0 stands for the whole face.
                layer = self._piece_edge(Edge(self.fused_path[placement.face], 0))
                host = self._piece_edge(Edge(self.fused_path[placement.on], 0))
                yield IndexedJoin(seam=None, kind="laminate", a=layer, b=host, length_mm=0.0)
        yield from self._contact_joins()

    def _contact_joins(self) -> Iterator[IndexedJoin]:
        """Yield the joins of the graph's contacts: of two edges, or of an edge and a face.

        Several contacts may lie on the same edges of fused faces. They give one join.
        """
        yielded: set[Contact] = set()
        for contact in self.graph.contacts:
            fused_contact = replace(contact, a=self._fused_edge(contact.a), b=self._fused_edge(contact.b))
            if fused_contact in yielded:
                continue
            yielded.add(fused_contact)
            yield IndexedJoin(
                seam=self._seam_of_contact(fused_contact),
                kind=contact.kind,
                a=self._piece_edge(fused_contact.a),
                b=self._piece_edge(fused_contact.b),
                length_mm=0.0 if contact.kind == "laminate" else math.dist(*self.graph.ends_mm(contact.a)),
                slot=contact.slot,
            )

    def _seam_of_contact(self, contact: Contact) -> object:
        """Return a value that identifies the seam of a contact between two faces.

        A *seam* consists of one or more contacts that have the same number on the printed pieces. Contacts with equal
        results are one seam, and get the same number in print.
        """
        if self.fused[contact.a.face].face.role == "rim":
            # All hooks between a strip of the rim and a disc are one seam.
            return (self.piece_of[contact.a.face], self.piece_of[contact.b.face])
        if contact.kind == "tuck":
            # All edges of a face that tuck into the same edge are one seam.
            return ("tuck", contact.a.face, contact.b)
        return contact

    def _fused_edge(self, edge: Edge) -> Edge:
        """Return the edge of a fused face in which an end of a contact lies.

        If the edge lies inside the fused face, the contact is one of whole faces, which edge 0 stands for.
        """
        path = self.fused_path[edge.face]
        return Edge(path, self.fused[path].edges.get(edge, 0))


def _short_names(paths: Iterable[str]) -> dict[str, str]:
    """Return the name of each face of a piece, by its path.

    It is the last part of the path. Faces with the same last part keep their whole paths as names.
    """
    last_parts = {path: path.rpartition(".")[2] for path in paths}
    counts = Counter(last_parts.values())
    return {path: last_part if counts[last_part] == 1 else path for path, last_part in last_parts.items()}


def _tab(name: str, seam: Seam) -> Face:
    """Return the face of a tab: a trapezoid on the seam, as deep as its link says."""
    length, depth = seam.length_mm, seam.link.depth_mm
    inset = min(depth, length / 4)
    return Face(name, ((0.0, 0.0), (length, 0.0), (length - inset, depth), (inset, depth)), role="tab")
