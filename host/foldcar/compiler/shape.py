"""What components build with: faces with named edges, holes, connections, mounts, axles.

Paths are relative to the component: ``floor`` is a face, ``beam.floor.front`` an edge of a subcomponent's face. A
face's first point is its origin by habit; edge i runs from point i to i + 1, counter-clockwise; +z is the printed side,
which looks inwards. Lengths in millimetres, angles in radians.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from foldcar.compiler.component import Component, ComponentError
from foldcar.parts import BoxPart, catalogue
from foldcar.sheet.model import Hole, HoleKind, Point, Pose, Wire
from foldcar.sheet.pose import translation

RECTANGLE_EDGES = ("near", "front", "far", "rear")
CIRCLE_POINTS = 48
_CIRCLE = [
    (math.cos(2 * math.pi * i / CIRCLE_POINTS), math.sin(2 * math.pi * i / CIRCLE_POINTS)) for i in range(CIRCLE_POINTS)
]
# Edges that are to be joined may differ by this.
LENGTH_TOLERANCE_MM = 1e-6

LinkKind = Literal["fold", "rigid", "hinge", "tab"]


@dataclass
class Atom:
    """A face as one component made it, before it is fused with its neighbours."""

    path: str
    outline_mm: tuple[Point, ...]
    edges: tuple[str, ...]
    role: Literal["panel", "rim"]
    piece: str
    thickness_mm: float
    body: str
    holes: list[Hole] = field(default_factory=list)


@dataclass(frozen=True)
class Link:
    """Two edges that meet. Of a tab, ``a`` is what it is glued to and ``b`` the edge it grows from."""

    kind: LinkKind
    a: tuple[str, int]
    b: tuple[str, int]
    angle_rad: float
    depth_mm: float = 0.0
    mitre: float = 1.0
    min_rad: float = 0.0
    max_rad: float = 0.0


@dataclass(frozen=True)
class Placement:
    """A face laid on or put through another one: its pose in the other's frame."""

    face: str
    on: str
    pose: Pose
    join: Literal["laminate", "tab_slot"] | None
    slots: tuple[tuple[str, int, str, str], ...] = ()


@dataclass(frozen=True)
class PlacedPart:
    """A bought part: the pose of its middle in a face's frame."""

    part: str
    name: str
    on: str
    pose: Pose
    size_mm: tuple[float, float, float]
    mass_kg: float
    holes: tuple[str, ...]


@dataclass(frozen=True)
class PlacedAxle:
    """A wheel's joint: its middle in a face's frame."""

    on: str
    servo: str
    side: Literal["left", "right"]
    center_mm: tuple[float, float, float]
    radius_mm: float
    tyre_width_mm: float


@dataclass
class Graph:
    """All that the components of a tree have made."""

    atoms: dict[str, Atom] = field(default_factory=dict)
    links: list[Link] = field(default_factory=list)
    placements: list[Placement] = field(default_factory=list)
    parts: list[PlacedPart] = field(default_factory=list)
    axles: list[PlacedAxle] = field(default_factory=list)
    wires: list[Wire] = field(default_factory=list)
    origin: tuple[str, Pose] | None = None
    _linked: dict[tuple[str, int], str] = field(default_factory=dict)

    def add(self, link: Link) -> None:
        """ComponentError if an edge is connected twice."""
        for edge, other in ((link.a, link.b), (link.b, link.a)):
            if edge in self._linked:
                raise ComponentError(
                    self.edge_path(edge), f"is connected to {self.edge_path(other)} and {self._linked[edge]}"
                )
            self._linked[edge] = self.edge_path(other)
        self.links.append(link)

    def edge_path(self, edge: tuple[str, int]) -> str:
        """The name of an edge for people."""
        return f"{edge[0]}.{self.atoms[edge[0]].edges[edge[1]]}"

    def edge_length_mm(self, edge: tuple[str, int]) -> float:
        """Its length."""
        outline = self.atoms[edge[0]].outline_mm
        return math.dist(outline[edge[1]], outline[(edge[1] + 1) % len(outline)])


def build(component: Component) -> Graph:
    """The faces and connections of a solved component and everything under it."""
    graph = Graph()
    _build(component, graph)
    return graph


def _build(component: Component, graph: Graph) -> None:
    for child in component.children.values():
        _build(child, graph)
    component.build(Shape(component, graph))


class Shape:
    """The graph as one component sees it: all paths are relative to it."""

    def __init__(self, component: Component, graph: Graph) -> None:
        self._component, self.graph = component, graph

    @property
    def name(self) -> str:
        """The component's path."""
        return self._component.path

    def face(
        self,
        name: str,
        outline_mm: Sequence[Point],
        edges: Sequence[str] | None = None,
        *,
        piece: str = "",
        role: Literal["panel", "rim"] = "panel",
        thickness_mm: float | None = None,
        body: str | None = None,
    ) -> None:
        """A polygon, counter-clockwise. ``piece`` names the part that is cut, if this is the face it begins with."""
        path = self._path(name)
        if path in self.graph.atoms:
            raise ComponentError(path, "there is a face of that name already")
        names = tuple(edges) if edges is not None else tuple(str(i) for i in range(len(outline_mm)))
        if len(names) != len(outline_mm):
            raise ComponentError(path, f"has {len(outline_mm)} edges and {len(names)} names for them")
        if _area(outline_mm) <= 0:
            raise ComponentError(path, "its outline does not run counter-clockwise around an area")
        thickness = catalogue().film.thickness_mm.value if thickness_mm is None else thickness_mm
        body = self._component.body if body is None else body
        self.graph.atoms[path] = Atom(path, tuple(outline_mm), names, role, piece, thickness, body)

    def rectangle(self, name: str, length_mm: float, width_mm: float, *, piece: str = "") -> None:
        """x from 0 to length, y from 0 to width; edges near (y = 0), front (x = length), far and rear."""
        outline = ((0.0, 0.0), (length_mm, 0.0), (length_mm, width_mm), (0.0, width_mm))
        self.face(name, outline, RECTANGLE_EDGES, piece=piece)

    def rectangular_hole(
        self, face: str, name: str, kind: HoleKind, center_mm: Point, length_mm: float, width_mm: float
    ) -> str:
        """A hole along x and y of the face; returns its full name."""
        (x, y), a, b = center_mm, length_mm / 2, width_mm / 2
        outline = ((x - a, y - b), (x + a, y - b), (x + a, y + b), (x - a, y + b))
        return self._hole(face, Hole(self._path(name), kind, outline, None, center_mm))

    def round_hole(self, face: str, name: str, kind: HoleKind, center_mm: Point, diameter_mm: float) -> str:
        """A circle; returns its full name."""
        x, y = center_mm
        r = diameter_mm / 2
        outline = tuple((x + r * c, y + r * s) for c, s in _CIRCLE)
        return self._hole(face, Hole(self._path(name), kind, outline, diameter_mm, center_mm))

    def connect(
        self,
        a: str,
        b: str,
        kind: LinkKind,
        angle_deg: float = 0.0,
        *,
        depth_mm: float = 0.0,
        mitre: float = 1.0,
        limits_rad: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Join two edges of equal length: folded by the angle, fused flat, hinged, or by a tab on ``b`` glued to ``a``.

        ``mitre`` is how far a tab's ends slant in for each millimetre of its depth.
        """
        first, second = self._edge(a), self._edge(b)
        lengths = [self.graph.edge_length_mm(edge) for edge in (first, second)]
        if abs(lengths[0] - lengths[1]) > LENGTH_TOLERANCE_MM:
            raise ComponentError(
                self.graph.edge_path(first),
                f"is {lengths[0]:g} mm long, {self.graph.edge_path(second)} is {lengths[1]:g} mm: "
                f"a {kind} joins edges of equal length",
            )
        angle = math.radians(angle_deg)
        self.graph.add(Link(kind, first, second, angle, depth_mm, mitre, *limits_rad))

    def laminate(self, face: str, on: str, pose: Pose) -> None:
        """Glue a face flat onto another one, at that pose in its frame."""
        self.graph.placements.append(Placement(self._face(face), self._face(on), pose, "laminate"))

    def put_through(self, face: str, on: str, pose: Pose, tongues: Mapping[str, tuple[str, str]]) -> None:
        """Place a face by its tongues: edge of ``face`` → (face, slot) it passes through."""
        slots = tuple(
            (*self._edge(f"{face}.{edge}"), self._face(other), self._path(slot))
            for edge, (other, slot) in tongues.items()
        )
        self.graph.placements.append(Placement(self._face(face), self._face(on), pose, "tab_slot", slots))

    def part(self, part: BoxPart, name: str, on: str, center_mm: tuple[float, float, float], *,
             turned: bool = False, holes: Sequence[str] = ()) -> None:  # fmt: skip
        """A bought box, its height along the face's z; ``turned`` puts its length along y."""
        sizes = (part.length_mm.value, part.width_mm.value, part.height_mm.value)
        size = (sizes[1], sizes[0], sizes[2]) if turned else sizes
        self.box(part.name, name, on, translation(*center_mm), size, part.mass_kg.value, holes)

    def box(self, part: str, name: str, on: str, pose: Pose, size_mm: tuple[float, float, float],
            mass_kg: float, holes: Sequence[str] = ()) -> None:  # fmt: skip
        """A bought part of that size, the pose of its middle in the frame of the face ``on``."""
        found = PlacedPart(part, name, self._face(on), pose, size_mm, mass_kg, tuple(holes))
        self.graph.parts.append(found)

    def axle(self, on: str, servo: str, side: Literal["left", "right"], center_mm: tuple[float, float, float],
             radius_mm: float, tyre_width_mm: float) -> None:  # fmt: skip
        """A wheel that the mount ``servo`` turns; the tyre's middle in the frame of the face ``on``."""
        found = PlacedAxle(self._face(on), servo, side, center_mm, radius_mm, tyre_width_mm)
        self.graph.axles.append(found)

    def begin_at(self, face: str, pose: Pose) -> None:
        """Put a face somewhere in the car; everything that is joined to it follows."""
        self.graph.origin = (self._face(face), pose)

    def face_size_mm(self, face: str) -> Point:
        """How far a face reaches along x and y."""
        outline = self.graph.atoms[self._face(face)].outline_mm
        xs, ys = zip(*outline, strict=True)
        return (max(xs) - min(xs), max(ys) - min(ys))

    def _hole(self, face: str, hole: Hole) -> str:
        self.graph.atoms[self._face(face)].holes.append(hole)
        return hole.name

    def _path(self, name: str) -> str:
        return f"{self._component.path}.{name}" if self._component.path else name

    def _face(self, name: str) -> str:
        path = self._path(name)
        if path not in self.graph.atoms:
            raise ComponentError(self._component.path, f'has no face "{name}"')
        return path

    def _edge(self, name: str) -> tuple[str, int]:
        face, _, edge = name.rpartition(".")
        path = self._face(face)
        edges = self.graph.atoms[path].edges
        if edge not in edges:
            raise ComponentError(path, f'has no edge "{edge}"; it has {", ".join(edges)}')
        return path, edges.index(edge)


def _area(outline: Sequence[Point]) -> float:
    following = (*outline[1:], outline[0])
    return sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(outline, following, strict=True)) / 2
