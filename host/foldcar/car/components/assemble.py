"""From a component to pieces: fuse its rigidly linked faces, join faces over folds to pieces, pose each in the car.

Input: a solved component. Output: pieces (trees of faces), each distinct one with its count, the poses of their copies,
joins, mounts and axles. A loop of folds, or a face without any join, is a ComponentError.
"""

import math
import re
from collections import Counter, defaultdict, deque
from collections.abc import Iterable
from dataclasses import dataclass, replace

from foldcar.car.components.component import Component, ComponentError
from foldcar.car.components.shape import Atom, Graph, Link, Shape
from foldcar.car.folded.model import (
    IDENTITY,
    Access,
    Axle,
    Crease,
    EdgeRef,
    Face,
    Hole,
    Join,
    JoinKind,
    Mark,
    Mount,
    Piece,
    PlacedPiece,
    Point,
    Pose,
)
from foldcar.car.folded.pose import across_crease, apply, compose, edge, folded, inverse, side, translation

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
    # Edges before the first corner go on the last one.
    edges = {one: (sum(corner <= i for corner in corners) - 1) % len(corners) for i, (one, _) in enumerate(ring)}
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


Seam = tuple[Link, Edge, Edge, float]
# A join with the indices of its two pieces.
Bound = tuple[Join, int, int]
# Links that make creases of one piece.
FOLDED = ("fold", "bend", "hinge")


def build(component: Component, graph: Graph | None = None) -> Graph:
    """The graph of faces and links that a solved component and all its subcomponents build."""
    graph = graph if graph is not None else Graph()
    for child in component.children.values():
        build(child, graph)
    component.build(Shape(component.path, component.body, graph, component.parts))
    return graph


@dataclass(frozen=True)
class Assembly:
    """A component's pieces and parts with their poses, in the component's frame."""

    pieces: tuple[Piece, ...]
    placed: tuple[PlacedPiece, ...]
    joins: tuple[Join, ...]
    mounts: tuple[Mount, ...]
    axles: tuple[Axle, ...]


def assemble(graph: Graph) -> Assembly:
    """The graph's assembly, posed from the face that ``graph.origin`` names, or else from the first face.

    ComponentError for a loop of folds or a face that is joined to nothing.
    """
    made = _Pieces(graph)
    roots = made.root_poses()
    world = {
        path: compose(roots[made.home[first]], made.local(first), pose)
        for first, one in made.fused.items()
        for path, pose in one.poses.items()
    }
    places = [(made.fused[sheet[0]].first.body, root) for sheet, root in zip(made.sheets, roots, strict=True)]
    kept, placed, joins = _counted(made.pieces, places, [*made.joins(), *made.contacts()])
    mounts = []
    for mount in graph.mounts:
        on = str(mount.face)
        mounts.append(replace(mount, pose=compose(world[on], mount.pose), face=made.names[made.owner[on]]))
    axles = (replace(axle, center_mm=apply(world[on], *axle.center_mm)) for on, axle in graph.axles)
    return Assembly(tuple(kept), tuple(placed), tuple(joins), tuple(mounts), tuple(axles))


@dataclass
class _Tab:
    """The tab that grows from edge ``b`` of a seam and is glued to the face of edge ``a``, in the plane of that."""

    face: Face
    a: Edge
    b: Edge
    length: float
    angle_rad: float


class _Pieces:
    """The pieces of a graph. ``sheets`` are the fused faces of each, ``home`` the index of a fused face's piece."""

    def __init__(self, graph: Graph) -> None:
        self.graph, self.fused = graph, fuse(graph)
        self.seams = seams(graph.links, self.fused)
        self.owner = {path: first for first, one in self.fused.items() for path in one.poses}
        folds = [seam for seam in self.seams if seam[0].kind in FOLDED]
        self.sheets = _sheets(self.fused, folds)
        self.home = {first: index for index, sheet in enumerate(self.sheets) for first in sheet}
        count = Counter(self.home[seam[1][0]] for seam in folds)
        for index, sheet in enumerate(self.sheets):
            if count[index] >= len(sheet):
                told = f"is in a loop of {count[index]} folds, which no flat sheet has; make one of them a tab"
                raise ComponentError(sheet[0], told)
        self.names = _names(self.sheets)
        self.tabs = [self._tab(seam) for seam in self.seams if seam[0].kind == "tab"]
        for index in range(len(self.sheets)):
            # Tabs of one piece that join the same two faces are numbered.
            mine = [tab for tab in self.tabs if self.home[tab.b[0]] == index]
            for tab, title in zip(mine, _titles([tab.face.name for tab in mine]), strict=True):
                tab.face = replace(tab.face, name=title)
        self.pieces = [self._piece(sheet) for sheet in self.sheets]
        self.shapes = [folded(piece) for piece in self.pieces]

    def local(self, first: str) -> Pose:
        """The pose of a fused face in its piece."""
        return self.shapes[self.home[first]][self.names[first]]

    def _ref(self, edge_of: Edge) -> EdgeRef:
        return EdgeRef(self.names[edge_of[0]], edge_of[1])

    def _tab(self, seam: Seam) -> _Tab:
        link, a, b, length = seam
        depth = link.depth_mm
        inset = min(depth, length / 4)
        outline = ((0.0, 0.0), (length, 0.0), (length - inset, depth), (inset, depth))
        face = Face(f"{self.names[b[0]]} tab to {self.names[a[0]]}", outline, (), "tab")
        return _Tab(face, a, b, length, link.angle_rad)

    def _piece(self, sheet: list[str]) -> Piece:
        order = {first: i for i, first in enumerate(sheet)}
        creases = []
        for link, a, b, _ in self.seams:
            if link.kind in FOLDED and a[0] in order:
                parent, child = (a, b) if order[a[0]] < order[b[0]] else (b, a)
                bends, name = link.kind == "hinge", f"{self.names[parent[0]]} to {self.names[child[0]]}"
                least, most = (link.min_rad, link.max_rad) if bends else (None, None)
                ends = self._ref(parent), self._ref(child)
                found = Crease(name, *ends, link.angle_rad, bends, least, most, link.kind == "bend")
                creases.append((order[child[0]], found))
        creases.sort(key=lambda pair: pair[0])
        mine = [tab for tab in self.tabs if tab.b[0] in order]
        folds = [
            *(crease for _, crease in creases),
            *(Crease(tab.face.name, self._ref(tab.b), EdgeRef(tab.face.name, 0), tab.angle_rad) for tab in mine),
        ]
        faces = [replace(self.fused[first].face, name=self.names[first]) for first in sheet] + [tab.face for tab in mine]
        root = self.fused[sheet[0]].first
        label = root.piece or self.names[sheet[0]]
        return Piece(label, label, tuple(faces), tuple(folds), root.thickness_mm)

    def root_poses(self) -> list[Pose]:
        """The pose of each piece's first face in the car."""
        # From piece to neighbouring piece: the pose of the second one's first face in the frame of the first one's.
        steps: dict[int, list[tuple[int, Pose]]] = defaultdict(list)

        def add(a: str, b: str, relative: Pose) -> None:
            """Record a neighbour: ``relative`` is the pose of fused face b in the frame of a."""
            step = compose(self.local(a), relative, inverse(self.local(b)))
            steps[self.home[a]].append((self.home[b], step))
            steps[self.home[b]].append((self.home[a], inverse(step)))

        for one in self.graph.placements:
            a, b = self.owner[one.on], self.owner[one.face]
            add(a, b, compose(self.fused[a].poses[one.on], one.pose, inverse(self.fused[b].poses[one.face])))
        for link, edge_a, edge_b, _ in self.seams:
            if link.kind == "tab" and self.home[edge_a[0]] != self.home[edge_b[0]]:
                ends = [edge({e[0]: self.fused[e[0]].face}, EdgeRef(*e)) for e in (edge_a, edge_b)]
                over = translation(0, 0, link.inset_mm)
                add(edge_a[0], edge_b[0], compose(over, across_crease(ends[0], ends[1], link.angle_rad)))
        path, pose = self.graph.origin or (next(iter(self.graph.atoms)), IDENTITY)
        first = self.owner[path]
        poses = {self.home[first]: compose(pose, inverse(self.fused[first].poses[path]), inverse(self.local(first)))}
        queue = deque(poses)
        while queue:
            here = queue.popleft()
            for other, step in steps[here]:
                if other not in poses:
                    poses[other] = compose(poses[here], step)
                    queue.append(other)
        for first, sheet in self.home.items():
            if sheet not in poses:
                raise ComponentError(first, "is joined to nothing")
        return [poses[i] for i in range(len(self.sheets))]

    def _join(self, number: int, kind: JoinKind, ends: tuple[str, str], refs: tuple[EdgeRef, EdgeRef], length_mm: float,
              slot: str | None = None) -> Bound:  # fmt: skip
        """A join of two fused faces."""
        a, b = (self.home[first] for first in ends)
        return Join(number, kind, self.pieces[a].name, refs[0], self.pieces[b].name, refs[1], length_mm, slot), a, b

    def joins(self) -> list[Bound]:
        """The joins of tabs and of placed layers, numbered from 1."""
        joins: list[Bound] = []
        for tab in self.tabs:
            kind: JoinKind = "lap" if self.home[tab.a[0]] == self.home[tab.b[0]] else "tab"
            refs = EdgeRef(tab.face.name, 0), self._ref(tab.a)
            joins.append(self._join(len(joins) + 1, kind, (tab.b[0], tab.a[0]), refs, tab.length))
        for one in self.graph.placements:
            if one.laminated:
                first, on = self.owner[one.face], self.owner[one.on]
                refs = EdgeRef(self.names[first], 0), EdgeRef(self.names[on], 0)
                joins.append(self._join(len(joins) + 1, "laminate", (first, on), refs, 0.0))
        return joins

    def contacts(self) -> list[Bound]:
        """Joins of faces that are in their places already, numbered among themselves.

        Edges that tuck into the same one share a number, as do all hooks of one strip in one disc.
        """
        joins: dict[tuple[object, ...], Bound] = {}
        numbers: dict[object, int] = {}
        for contact in self.graph.contacts:
            first, second = (self.owner[path] for path, _ in (contact.a, contact.b))
            a = first, self.fused[first].edges.get(contact.a, 0)
            b = second, self.fused[second].edges.get(contact.b, 0)
            seam: object = ("tuck", first, b) if contact.kind == "tuck" else contact
            if self.fused[first].face.role == "rim":
                seam = (contact.kind, self.home[first], self.home[second])
            number = numbers.setdefault(seam, -1 - len(numbers))
            length = 0.0 if contact.kind == "laminate" else self.graph.edge_length_mm(contact.a)
            refs = self._ref(a), self._ref(b)
            join = self._join(number, contact.kind, (first, second), refs, length, contact.slot)
            joins.setdefault((contact.kind, a, b, contact.slot), join)
        return list(joins.values())


def _sheets(fused: dict[str, Fused], folds: list[Seam]) -> list[list[str]]:
    """The fused faces of each piece in breadth-first order: the root first, parents before children."""
    neighbours: dict[str, list[str]] = defaultdict(list)
    for _, a, b, _ in folds:
        neighbours[a[0]].append(b[0])
        neighbours[b[0]].append(a[0])
    sheets, done = [], set[str]()
    for first in fused:
        if first not in done:
            done.add(first)
            sheet = [first]
            for here in sheet:
                new = [other for other in dict.fromkeys(neighbours[here]) if other not in done]
                done.update(new)
                sheet += new
            sheets.append(sheet)
    return sheets


def _names(sheets: list[list[str]]) -> dict[str, str]:
    """Face names: the last part of the path if it is unique within the piece, else the whole path."""
    names: dict[str, str] = {}
    for sheet in sheets:
        short = {first: first.rpartition(".")[2] for first in sheet}
        count = Counter(short.values())
        names |= {first: first if count[name] > 1 else name for first, name in short.items()}
    return names


def _titles(labels: list[str]) -> list[str]:
    """The labels; those that occur more than once get " 1", " 2", … appended."""
    counts, seen = Counter(labels), Counter[str]()
    numbered = []
    for label in labels:
        seen[label] += 1
        numbered.append(f"{label} {seen[label]}" if counts[label] > 1 else label)
    return numbered


def _counted(
    pieces: list[Piece], places: list[tuple[str, Pose]], joins: list[Bound]
) -> tuple[list[Piece], list[PlacedPiece], list[Join]]:
    """Distinct pieces with counts, their placed copies, and the joins with the names of pieces, numbered from 1.

    Only pieces that are laminated onto others and nothing else are merged; every other piece has its own name.
    """
    bound = {index for join, *pair in joins for index in pair if join.kind != "laminate"}
    bound |= {pair[1] for join, *pair in joins}
    kept: list[Piece] = []
    index_of: list[int] = []
    same: dict[Piece, int] = {}
    for i, piece in enumerate(pieces):
        anonymous = replace(piece, faces=tuple(_without_names(face) for face in piece.faces))
        if i not in bound and anonymous in same:
            index_of.append(same[anonymous])
            kept[same[anonymous]] = replace(kept[same[anonymous]], count=kept[same[anonymous]].count + 1)
            continue
        if i not in bound:
            same[anonymous] = len(kept)
        index_of.append(len(kept))
        kept.append(piece)
    names = _titles([piece.label for piece in kept])
    kept = [replace(piece, name=title, label=title) for piece, title in zip(kept, names, strict=True)]
    placed, copies = [], Counter[int]()
    for index, (body, pose) in zip(index_of, places, strict=True):
        placed.append(PlacedPiece(kept[index].name, copies[index], body, pose))
        copies[index] += 1
    numbered: list[Join] = []
    numbers: dict[tuple[object, ...], int] = {}
    for join, *pair in joins:
        ends = []
        for i, ref in zip(pair, (join.a, join.b), strict=True):
            # A merged piece has the names of the one that is kept.
            face = next(place for place, face in enumerate(pieces[i].faces) if face.name == ref.face)
            ends.append((kept[index_of[i]].name, EdgeRef(kept[index_of[i]].faces[face].name, ref.index)))
        (name_a, a), (name_b, b) = ends
        # Laminations of all copies of a piece share a number.
        key = ("laminate", name_a) if join.kind == "laminate" else (join.kind, join.number)
        number = numbers.setdefault(key, len(numbers) + 1)
        numbered.append(replace(join, number=number, piece_a=name_a, a=a, piece_b=name_b, b=b))
    return kept, placed, numbered


def _without_names(face: Face) -> Face:
    return replace(face, name="", holes=tuple(replace(hole, name=re.sub(r".*\.", "", hole.name)) for hole in face.holes))
