"""Assemble the faces and links of a component graph to pieces, and pose each piece in the car.

Input: a graph that components have built. Output: pieces (trees of faces), their poses, joins, mounts and axles with
their poses. A loop of folds, or a face without any join, is a ComponentError.
"""

import re
from collections import Counter, deque
from dataclasses import dataclass, replace
from typing import Literal

from foldcar.car.components.fuse import Edge, Fused, fuse, seams
from foldcar.car.components.parameter import ComponentError
from foldcar.car.components.shape import Graph, Link, PlacedAxle
from foldcar.car.folded.model import Crease, EdgeRef, Face, Join, Mount, Piece, PlacedPiece, Pose
from foldcar.car.folded.pose import IDENTITY, across_crease, apply, compose, edge, folded, inverse, translation

Seam = tuple[Link, Edge, Edge, float]
# Links that make creases of one piece.
FOLDED = ("fold", "bend", "hinge")


@dataclass(frozen=True)
class Assembly:
    """A component's pieces and parts with their poses.

    Each axle is (axle, body that carries it, (3,) centre in mm in the component's frame).
    """

    pieces: tuple[Piece, ...]
    placed: tuple[PlacedPiece, ...]
    joins: tuple[Join, ...]
    mounts: tuple[Mount, ...]
    axles: tuple[tuple[PlacedAxle, str, tuple[float, float, float]], ...]


def assemble(graph: Graph) -> Assembly:
    """The graph's assembly, posed from the face that ``graph.origin`` names, or else from the first face.

    ComponentError for a loop of folds or a face that is joined to nothing.
    """
    fused = fuse(graph)
    found = seams(graph.links, fused)
    owner = {path: first for first, one in fused.items() for path in one.poses}
    sheets = _sheets(fused, [seam for seam in found if seam[0].kind in FOLDED])
    home = {first: index for index, sheet in enumerate(sheets) for first in sheet}
    names = _names(sheets)
    tabs = {seam[2]: _Tab(seam, names, home) for seam in found if seam[0].kind == "tab"}
    for index in range(len(sheets)):
        _number_tabs([tab for edge_b, tab in tabs.items() if home[edge_b[0]] == index])
    pieces = [_piece(sheet, fused, found, tabs, names) for sheet in sheets]

    shapes = [folded(piece) for piece in pieces]
    roots = _root_poses(graph, fused, owner, found, home, shapes, names)
    world = {
        path: compose(roots[home[first]], shapes[home[first]][names[first]], one.poses[path])
        for first, one in fused.items()
        for path in one.poses
    }
    found_joins = _joins(graph, fused, owner, tabs, home, pieces, names)
    places = [(fused[sheet[0]].first.body, root) for sheet, root in zip(sheets, roots, strict=True)]
    kept, placed, joins = counted(pieces, places, found_joins)
    mounts = tuple(
        Mount(part.part, part.name, graph.atoms[part.on].body, compose(world[part.on], part.pose), part.size_mm,
              part.mass_kg, names[owner[part.on]], part.holes, part.solids, part.accesses)
        for part in graph.parts
    )  # fmt: skip
    axles = tuple((axle, graph.atoms[axle.on].body, apply(world[axle.on], *axle.center_mm)) for axle in graph.axles)
    return Assembly(tuple(kept), tuple(placed), tuple(joins), mounts, axles)


class _Tab:
    """The tab that grows from edge ``b`` of a seam and is glued to the face of edge ``a``."""

    def __init__(self, seam: Seam, names: dict[str, str], home: dict[str, int]) -> None:
        link, self.a, self.b, self.length = seam
        depth = link.depth_mm
        inset = min(depth * link.mitre, self.length / 4)
        outline = ((0.0, 0.0), (self.length, 0.0), (self.length - inset, depth), (inset, depth))
        if inset == 0:
            outline = ((0.0, 0.0), (self.length, 0.0), (self.length, depth), (0.0, depth))
        self.face = Face(f"{names[self.b[0]]} tab to {names[self.a[0]]}", outline, (), "tab")
        # The tab lies in the plane of face a.
        self.angle_rad = link.angle_rad
        self.own_piece = home[self.a[0]] == home[self.b[0]]


def _number_tabs(tabs: list[_Tab]) -> None:
    """Append numbers to the names of tabs of one piece that join the same two faces."""
    for tab, title in zip(tabs, titles([tab.face.name for tab in tabs]), strict=True):
        tab.face = replace(tab.face, name=title)


def _sheets(fused: dict[str, Fused], folds: list[Seam]) -> list[list[str]]:
    """The fused faces of each piece in breadth-first order: the root first, parents before children."""
    neighbours: dict[str, list[str]] = {}
    for _, a, b, _ in folds:
        neighbours.setdefault(a[0], []).append(b[0])
        neighbours.setdefault(b[0], []).append(a[0])
    sheets, done = [], set[str]()
    for first in fused:
        if first in done:
            continue
        sheet, queue = [first], deque([first])
        done.add(first)
        while queue:
            for other in neighbours.get(queue.popleft(), ()):
                if other not in done:
                    done.add(other)
                    sheet.append(other)
                    queue.append(other)
        sheets.append(sheet)
    in_sheet = {first: i for i, sheet in enumerate(sheets) for first in sheet}
    for i, sheet in enumerate(sheets):
        mine = [seam for seam in folds if in_sheet[seam[1][0]] == i]
        if len(mine) >= len(sheet) > 0 and mine:
            raise ComponentError(
                sheet[0], f"is in a loop of {len(mine)} folds, which no flat sheet has; make one of them a tab"
            )
    return sheets


def _names(sheets: list[list[str]]) -> dict[str, str]:
    """Face names: the last part of the path if it is unique within the piece, else the whole path."""
    names = {}
    for sheet in sheets:
        short = {first: first.rpartition(".")[2] for first in sheet}
        for first in sheet:
            twice = sum(other == short[first] for other in short.values()) > 1
            names[first] = first if twice else short[first]
    return names


def _piece(
    sheet: list[str], fused: dict[str, Fused], found: list[Seam], tabs: dict[Edge, _Tab], names: dict[str, str]
) -> Piece:
    members = set(sheet)
    order = {first: i for i, first in enumerate(sheet)}
    creases = []
    for link, a, b, _ in found:
        if link.kind not in FOLDED or a[0] not in members:
            continue
        parent, child = (a, b) if order[a[0]] < order[b[0]] else (b, a)
        bends = link.kind == "hinge"
        creases.append((
            order[child[0]],
            Crease(
                f"{names[parent[0]]} to {names[child[0]]}", _ref(parent, names), _ref(child, names), link.angle_rad,
                bends, link.min_rad if bends else None, link.max_rad if bends else None, link.kind == "bend",
            ),
        ))  # fmt: skip
    creases.sort(key=lambda pair: pair[0])
    mine = [tab for edge_b, tab in tabs.items() if edge_b[0] in members]
    folds = [
        *(crease for _, crease in creases),
        *(Crease(tab.face.name, _ref(tab.b, names), EdgeRef(tab.face.name, 0), tab.angle_rad) for tab in mine),
    ]
    faces = [replace(fused[first].face, name=names[first]) for first in sheet] + [tab.face for tab in mine]
    first = fused[sheet[0]].first
    label = first.piece or names[sheet[0]]
    return Piece(label, label, tuple(faces), tuple(folds), first.thickness_mm)


def _ref(edge_of: Edge, names: dict[str, str]) -> EdgeRef:
    return EdgeRef(names[edge_of[0]], edge_of[1])


def _root_poses(
    graph: Graph, fused: dict[str, Fused], owner: dict[str, str], found: list[Seam], home: dict[str, int],
    shapes: list[dict[str, Pose]], names: dict[str, str],
) -> list[Pose]:  # fmt: skip
    """The pose of each piece's first face in the car."""
    # From piece to neighbouring piece: the pose of the second one's first face in the frame of the first one's.
    steps: dict[int, list[tuple[int, Pose]]] = {}

    def local(first: str) -> Pose:
        return shapes[home[first]][names[first]]

    def add(a: str, b: str, relative: Pose) -> None:
        """Record a neighbour: ``relative`` is the pose of fused face b in the frame of a."""
        step = compose(local(a), relative, inverse(local(b)))
        steps.setdefault(home[a], []).append((home[b], step))
        steps.setdefault(home[b], []).append((home[a], inverse(step)))

    for placement in graph.placements:
        a, b = owner[placement.on], owner[placement.face]
        add(a, b, compose(fused[a].poses[placement.on], placement.pose, inverse(fused[b].poses[placement.face])))
    for link, edge_a, edge_b, _ in found:
        if link.kind == "tab" and home[edge_a[0]] != home[edge_b[0]]:
            ends = [edge({e[0]: fused[e[0]].face}, EdgeRef(e[0], e[1])) for e in (edge_a, edge_b)]
            over = translation(0, 0, link.inset_mm)
            add(edge_a[0], edge_b[0], compose(over, across_crease(ends[0], ends[1], link.angle_rad)))
    path, pose = graph.origin or (next(iter(graph.atoms)), IDENTITY)
    first = owner[path]
    start = compose(pose, inverse(fused[first].poses[path]), inverse(local(first)))
    poses = {home[first]: start}
    queue = deque([home[first]])
    while queue:
        here = queue.popleft()
        for other, step in steps.get(here, ()):
            if other not in poses:
                poses[other] = compose(poses[here], step)
                queue.append(other)
    for first, sheet in home.items():
        if sheet not in poses:
            raise ComponentError(first, "is joined to nothing")
    return [poses[i] for i in range(len(shapes))]


def _joins(
    graph: Graph, fused: dict[str, Fused], owner: dict[str, str], tabs: dict[Edge, _Tab], home: dict[str, int],
    pieces: list[Piece], names: dict[str, str],
) -> list[tuple[Join, int, int]]:  # fmt: skip
    """Joins with the indices of their two pieces."""
    joins: list[tuple[Join, int, int]] = []
    number = 0
    for tab in tabs.values():
        pair = (home[tab.b[0]], home[tab.a[0]])
        number += 1
        kind: Literal["lap", "tab"] = "lap" if tab.own_piece else "tab"
        a, b = EdgeRef(tab.face.name, 0), _ref(tab.a, names)
        joins.append((Join(number, kind, pieces[pair[0]].name, a, pieces[pair[1]].name, b, tab.length), *pair))
    for placement in graph.placements:
        first, on = owner[placement.face], owner[placement.on]
        pair = (home[first], home[on])
        if placement.laminated:
            number += 1
            refs = EdgeRef(names[first], 0), EdgeRef(names[on], 0)
            join = Join(number, "laminate", pieces[pair[0]].name, refs[0], pieces[pair[1]].name, refs[1], 0.0)
            joins.append((join, *pair))
    return joins + _contacts(graph, fused, owner, home, pieces, names, number)


def _contacts(
    graph: Graph, fused: dict[str, Fused], owner: dict[str, str], home: dict[str, int], pieces: list[Piece],
    names: dict[str, str], last: int,
) -> list[tuple[Join, int, int]]:  # fmt: skip
    """Joins of faces that are in their places already.

    Edges that tuck into the same one share a number, as do all hooks of one strip in one disc.
    """
    joins: dict[tuple[object, ...], tuple[Join, int, int]] = {}
    numbers: dict[object, int] = {}
    for contact in graph.contacts:
        a, b = ((owner[path], fused[owner[path]].edges.get((path, index), 0)) for path, index in (contact.a, contact.b))
        seam: object = ("tuck", a[0], b) if contact.kind == "tuck" else contact
        if fused[a[0]].face.role == "rim":
            seam = (contact.kind, home[a[0]], home[b[0]])
        number = numbers.setdefault(seam, last + len(numbers) + 1)
        length = 0.0 if contact.kind == "laminate" else graph.edge_length_mm(contact.a)
        pair = (home[a[0]], home[b[0]])
        refs = _ref(a, names), _ref(b, names)
        ends = (pieces[pair[0]].name, refs[0], pieces[pair[1]].name, refs[1])
        join = Join(number, contact.kind, *ends, length, contact.slot)
        joins.setdefault((contact.kind, a, b, contact.slot), (join, *pair))
    return list(joins.values())


def counted(
    pieces: list[Piece], places: list[tuple[str, Pose]], joins: list[tuple[Join, int, int]]
) -> tuple[list[Piece], list[PlacedPiece], list[Join]]:
    """Distinct pieces with counts, their placed copies, and the joins.

    Only pieces that are laminated onto others and nothing else are merged; every other piece has its own name.
    """
    bound = {index for join, *pair in joins for index in pair if join.kind != "laminate"}
    bound |= {pair[1] for join, *pair in joins}
    kept: list[Piece] = []
    index_of: dict[int, int] = {}
    same: dict[Piece, int] = {}
    for i, piece in enumerate(pieces):
        anonymous = replace(piece, faces=tuple(_without_names(face) for face in piece.faces))
        if i not in bound and anonymous in same:
            index_of[i] = same[anonymous]
            kept[same[anonymous]] = replace(kept[same[anonymous]], count=kept[same[anonymous]].count + 1)
            continue
        if i not in bound:
            same[anonymous] = len(kept)
        index_of[i] = len(kept)
        kept.append(piece)
    names = titles([piece.label for piece in kept])
    kept = [replace(piece, name=title, label=title) for piece, title in zip(kept, names, strict=True)]
    placed, copies = [], dict[int, int]()
    for i, (body, pose) in enumerate(places):
        index = index_of[i]
        placed.append(PlacedPiece(kept[index].name, copies.get(index, 0), body, pose))
        copies[index] = copies.get(index, 0) + 1
    numbered: list[Join] = []
    numbers: dict[tuple[object, ...], int] = {}
    for join, a, b in joins:
        named = replace(
            join, piece_a=kept[index_of[a]].name, a=_same_face(join.a, pieces[a], kept[index_of[a]]),
            piece_b=kept[index_of[b]].name, b=_same_face(join.b, pieces[b], kept[index_of[b]]),
        )  # fmt: skip
        # Laminations of all copies of a piece share a number; numbers are consecutive from 1.
        key = ("laminate", named.piece_a) if join.kind == "laminate" else (join.kind, join.number)
        numbers.setdefault(key, len(numbers) + 1)
        numbered.append(replace(named, number=numbers[key]))
    return kept, placed, numbered


def _same_face(ref: EdgeRef, piece: Piece, copied: Piece) -> EdgeRef:
    """The edge of ``copied``, which equals ``piece``, that corresponds to the edge ``ref`` of ``piece``."""
    place = next(i for i, face in enumerate(piece.faces) if face.name == ref.face)
    return EdgeRef(copied.faces[place].name, ref.index)


def _without_names(face: Face) -> Face:
    return replace(face, name="", holes=tuple(replace(hole, name=re.sub(r".*\.", "", hole.name)) for hole in face.holes))


def titles(labels: list[str]) -> list[str]:
    """The labels; those that occur more than once get " 1", " 2", … appended."""
    counts = Counter(labels)
    seen: Counter[str] = Counter()
    numbered = []
    for label in labels:
        seen[label] += 1
        numbered.append(f"{label} {seen[label]}" if counts[label] > 1 else label)
    return numbered
