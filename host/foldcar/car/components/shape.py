"""The interface that components build with: faces with named edges, holes, connections, parts, axles.

Paths are relative to the component: ``floor`` is a face, ``beam.floor.front`` an edge of a subcomponent's face. A
face's first point is its origin by convention; edge i runs from point i to i + 1, counter-clockwise; +z is the printed
side, which faces inwards. Lengths in millimetres, angles in radians. A wrong path is a ComponentError.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from foldcar.car.components.component import ComponentError
from foldcar.car.folded.model import (
    Axle,
    Hole,
    HoleKind,
    JoinKind,
    Mount,
    Point,
    Pose,
    PrintedOutline,
    Solid,
    ToolClearance,
    Wire,
)
from foldcar.car.folded.pose import side as ends_of
from foldcar.car.folded.pose import translation
from foldcar.car.folded.weight import area_mm2
from foldcar.car.parts.catalogue import Catalogue
from foldcar.car.parts.quantity import BoxPart

LinkKind = Literal["fold", "bend", "rigid", "hinge", "tab"]


@dataclass(frozen=True, slots=True)
class Edge:
    """An edge of a face: the path of the face, and the edge's index in the outline of that face."""

    face: str
    index: int


@dataclass
class ComponentFace:
    """A face as one component made it, before it is fused with its neighbours."""

    path: str
    outline_mm: tuple[Point, ...]
    edges: tuple[str, ...]
    role: Literal["panel", "tab", "rim"]
    piece: str
    thickness_mm: float
    body: str
    holes: list[Hole] = field(default_factory=list)
    marks: list[PrintedOutline] = field(default_factory=list)
    clearances: list[ToolClearance] = field(default_factory=list)


@dataclass(frozen=True)
class EdgeJoin:
    """Two edges that meet at ``angle_rad``. A tab grows from edge ``b`` and is glued at edge ``a``.

    ``depth_mm`` and ``inset_mm`` describe a tab (see Shape.connect), ``min_rad`` and ``max_rad`` a hinge.
    """

    kind: LinkKind
    a: Edge
    b: Edge
    angle_rad: float
    depth_mm: float = 0.0
    min_rad: float = 0.0
    max_rad: float = 0.0
    inset_mm: float = 0.0


@dataclass(frozen=True)
class FacePose:
    """The pose of a face in the frame of the face ``on``; the face may also be laminated onto it."""

    face: str
    on: str
    pose: Pose
    laminated: bool = False


@dataclass(frozen=True)
class Contact:
    """A join between faces whose poses are known from other links: of two edges, or of an edge and the face of b.

    ``slot`` is the hole in the face of b through which a tongue goes, whose tip is ``a``.
    """

    kind: JoinKind
    a: Edge
    b: Edge
    slot: str | None = None


@dataclass
class Graph:
    """Everything that the components of a car have built. ``origin`` is a face and its pose in the car.

    A mount is given in the frame of its ``face``, an axle in the frame of the face that is named with it. ``linked``
    has, for each edge that is linked, the path of the edge that it is linked to.
    """

    faces: dict[str, ComponentFace] = field(default_factory=dict)
    links: list[EdgeJoin] = field(default_factory=list)
    placements: list[FacePose] = field(default_factory=list)
    contacts: list[Contact] = field(default_factory=list)
    mounts: list[Mount] = field(default_factory=list)
    axles: list[tuple[str, Axle]] = field(default_factory=list)
    wires: list[Wire] = field(default_factory=list)
    origin: tuple[str, Pose] | None = None
    linked: dict[Edge, str] = field(default_factory=dict)

    def edge_path(self, edge: Edge) -> str:
        """Return the readable path of an edge: face path and edge name."""
        return f"{edge.face}.{self.faces[edge.face].edges[edge.index]}"

    def ends_mm(self, edge: Edge) -> tuple[Point, Point]:
        """Return the ends of an edge in its face's frame (mm)."""
        return ends_of(self.faces[edge.face].outline_mm, edge.index)


CIRCLE_POINTS = 48
# Tolerance on the equality of the lengths of two joined edges.
LENGTH_TOLERANCE_MM = 1e-6


class Shape:
    """Writes one component's faces, parts and axles into the graph; all paths are relative to that component."""

    def __init__(self, name: str, body: str, graph: Graph, parts: Catalogue) -> None:
        """``name`` is the component's path, ``body`` the rigid body that its faces belong to."""
        self.name, self._body, self.graph, self.parts = name, body, graph, parts

    def face(
        self, name: str, outline_mm: Sequence[Point] | Mapping[str, Point], *, piece: str = "",
        role: Literal["panel", "tab", "rim"] = "panel", thickness_mm: float | None = None, body: str = "",
    ) -> None:  # fmt: skip
        """Add a face: a polygon of film whose outline runs counter-clockwise.

        ``outline_mm`` maps the name of each edge to the point at which the edge begins. If it is a sequence of points,
        the edges are called "0", "1", …

        The faces of a piece are folded from one of them, its root. If this face is the root, ``piece`` is the name of
        the piece. ``body`` is the rigid body of the face, by default that of the component. Raises ComponentError for a
        second face of that name, and for an outline that runs clockwise.
        """
        path = self.path(name)
        if path in self.graph.faces:
            raise ComponentError(path, "there is a face of that name already")
        if not isinstance(outline_mm, Mapping):
            outline_mm = {str(i): point for i, point in enumerate(outline_mm)}
        points = tuple(outline_mm.values())
        if area_mm2(points) <= 0:
            raise ComponentError(path, "its outline does not run counter-clockwise around an area")
        thickness = self.parts.film_mm if thickness_mm is None else thickness_mm
        self.graph.faces[path] = ComponentFace(
            path, points, edges=tuple(outline_mm), role=role, piece=piece, thickness_mm=thickness, body=body or self._body
        )

    def rectangle(
        self, name: str, length_mm: float, width_mm: float, *, piece: str = "", thickness_mm: float | None = None,
        body: str = "",
    ) -> None:  # fmt: skip
        """Add a rectangle, x from 0 to length and y from 0 to width.

        Its edges are near (y = 0), front (x = length), far, rear.
        """
        corners = ((0.0, 0.0), (length_mm, 0.0), (length_mm, width_mm), (0.0, width_mm))
        outline = dict(zip(("near", "front", "far", "rear"), corners, strict=True))
        self.face(name, outline, piece=piece, thickness_mm=thickness_mm, body=body)

    def rectangular_hole(
        self, face: str, name: str, kind: HoleKind, center_mm: Point, length_mm: float, width_mm: float
    ) -> str:
        """Cut a rectangle with sides along x and y of the face, and return its full name."""
        outline = rectangle_around(center_mm, length_mm, width_mm)
        return self._hole(face, Hole(self.path(name), kind, outline, None, center_mm))

    def round_hole(self, face: str, name: str, kind: HoleKind, center_mm: Point, diameter_mm: float) -> str:
        """Cut a circle and return its full name."""
        turns = [2 * math.pi * i / CIRCLE_POINTS for i in range(CIRCLE_POINTS)]
        outline = tuple(on_circle(diameter_mm / 2, turns, center_mm))
        return self._hole(face, Hole(self.path(name), kind, outline, diameter_mm, center_mm))

    def slotted_hole(self, face: str, name: str, kind: HoleKind, start_mm: Point, end_mm: Point, width_mm: float) -> str:
        """Cut a slot with round ends about two points, and return its full name.

        If the points coincide, it is a circle.
        """
        if start_mm == end_mm:
            return self.round_hole(face, name, kind, start_mm, width_mm)
        (start_x, start_y), (end_x, end_y) = start_mm, end_mm
        # Half a circle around the end, and then half a circle around the start. Both run counter-clockwise. The first
        # begins at the right of the slot's direction.
        first_angle = math.atan2(end_y - start_y, end_x - start_x) - math.pi / 2
        angles = [first_angle + 2 * math.pi * i / CIRCLE_POINTS for i in range(CIRCLE_POINTS + 1)]
        half = CIRCLE_POINTS // 2
        around_end = on_circle(width_mm / 2, angles[: half + 1], end_mm)
        around_start = on_circle(width_mm / 2, angles[half:], start_mm)
        middle = ((start_x + end_x) / 2, (start_y + end_y) / 2)
        return self._hole(face, Hole(self.path(name), kind, (*around_end, *around_start), None, middle))

    def polygon_hole(self, face: str, name: str, kind: HoleKind, outline_mm: Sequence[Point]) -> str:
        """Cut a polygon, counter-clockwise, and return its full name."""
        return self._hole(face, Hole(self.path(name), kind, tuple(outline_mm)))

    def connect(
        self, a: str, b: str, kind: LinkKind, angle_deg: float = 0.0, *, depth_mm: float = 0.0, inset_mm: float = 0.0,
        limits_rad: tuple[float, float] = (0.0, 0.0),
    ) -> None:  # fmt: skip
        """Join the edges ``a`` and ``b`` of two faces: by a fold, a bend, a hinge or a tab, or rigidly.

        ``angle_deg`` is the angle between the two faces in the assembled car, and ``limits_rad`` the range of a hinge.
        The edges must be equally long, except for a tab. A tab is a flap that grows from edge ``b`` and is glued to the
        inside of the face with edge ``a``. It is ``depth_mm`` deep. With ``inset_mm``, edge ``b`` lies this much above
        that face, and is shorter than edge ``a`` by this much at each end. Raises ComponentError if the lengths do not
        match, or if an edge is joined already.
        """
        first, second = self._edge(a), self._edge(b)
        first_mm, second_mm = (math.dist(*self.graph.ends_mm(edge)) for edge in (first, second))
        if abs(first_mm - second_mm - 2 * inset_mm) > LENGTH_TOLERANCE_MM:
            first_path, second_path = self.graph.edge_path(first), self.graph.edge_path(second)
            sizes = f"is {first_mm:g} mm long, {second_path} is {second_mm:g} mm"
            raise ComponentError(first_path, f"{sizes}: a {kind} joins edges of equal length")
        for edge, other in ((first, second), (second, first)):
            other_path = self.graph.edge_path(other)
            if edge in self.graph.linked:
                message = f"is connected to {other_path} and {self.graph.linked[edge]}"
                raise ComponentError(self.graph.edge_path(edge), message)
            self.graph.linked[edge] = other_path
        min_rad, max_rad = limits_rad
        join = EdgeJoin(
            kind, a=first, b=second, angle_rad=math.radians(angle_deg), depth_mm=depth_mm,
            min_rad=min_rad, max_rad=max_rad, inset_mm=inset_mm,
        )  # fmt: skip
        self.graph.links.append(join)

    def place(self, face: str, on: str, pose: Pose, laminated: bool = False) -> None:
        """Set a face's pose in the frame of the face ``on``; if ``laminated``, it is also glued onto that face."""
        self.graph.placements.append(FacePose(self._face(face), self._face(on), pose, laminated))

    def layer(self, name: str, on: str, outline_mm: Sequence[Point], at_mm: Point, piece: str, level: int = 1) -> None:
        """Add a layer of film, glued onto ``on`` with its origin at ``at_mm`` there.

        It is a new face; levels count from 1.
        """
        self.face(name, outline_mm, piece=piece, body=self.body_of(on))
        self.place(name, on, translation(*at_mm, level * self.parts.film_mm), laminated=True)

    def touch(self, kind: JoinKind, a: str, b: str, slot: str | None = None) -> None:
        """Say that two edges, an edge and a face, or two faces are joined. Their poses do not depend on this join.

        A ``tuck`` says that edge ``a`` lies loosely inside edge ``b``. In a ``rim``, the neck behind edge ``a`` lies in
        the notch whose bottom is edge ``b``. In a ``laminate``, face ``a`` is glued onto face ``b``. In a ``tab_slot``,
        a tongue with the tip ``a`` goes through the hole ``slot`` of face ``b``. A ``lock`` is a tab_slot that can be
        opened again.
        """
        first = self._whole_face(a) if kind == "laminate" else self._edge(a)
        second = self._edge(b) if kind in ("tuck", "rim") else self._whole_face(b)
        slot_path = self.path(slot) if slot else None
        self.graph.contacts.append(Contact(kind, first, second, slot_path))

    def require_clearance(self, face: str, clearance: ToolClearance) -> None:
        """Require free space at a face that is gripped or pressed; the clearance is given in the face's frame."""
        self.graph.faces[self._face(face)].clearances.append(clearance)

    def part(self, part: BoxPart, on: str, center_mm: tuple[float, float, float], *, turned: bool = False,
             marked: bool = False) -> None:  # fmt: skip
        """Add a bought part of the catalogue, its height along z of the face. ``turned`` puts its length along y.

        If it is ``marked``, its outline is printed on the face, to show where to lay it.
        """
        length, width, height = part.size_mm
        size = (width, length, height) if turned else part.size_mm
        if marked:
            self.mark(on, part.name, rectangle_around(center_mm[:2], size[0], size[1]))
        self.box(part.name, part.name, on, translation(*center_mm), size, part.mass_kg.value)

    def mark(self, face: str, name: str, outline_mm: Sequence[Point]) -> None:
        """Print an outline, counter-clockwise, with a name in it on a face."""
        self.graph.faces[self._face(face)].marks.append(PrintedOutline(name, tuple(outline_mm)))

    def box(self, part: str, name: str, on: str, pose: Pose, size_mm: tuple[float, float, float],
            mass_kg: float, holes: Sequence[str] = (), solids: Sequence[Solid] = (),
            clearances: Sequence[ToolClearance] = ()) -> None:  # fmt: skip
        """Add a part that is bought, not cut from film, and fix it to the face ``on``. A part has a box around it.

        ``part`` is the name of its entry in the parts catalogue. ``name`` is its name in the car, such as "left servo"
        for one of several servos. ``pose`` is the pose of its centre in the frame of the face, ``size_mm`` its size along
        its own x, y and z. ``holes`` are the names of the holes of the film that it is put into. ``solids`` are its exact
        shape, and ``clearances`` the spaces that a tool needs at it; both are given in the frame of its centre.
        """
        face_path = self._face(on)
        mount = Mount(
            part, name, self.graph.faces[face_path].body, pose, size_mm, mass_kg, face_path,
            holes=tuple(holes), solids=tuple(solids), clearances=tuple(clearances),
        )  # fmt: skip
        self.graph.mounts.append(mount)

    def axle(self, on: str, servo: str, side: Literal["left", "right"], center_mm: tuple[float, float, float],
             radius_mm: float, tyre_width_mm: float) -> None:  # fmt: skip
        """Add a wheel to the face ``on``, in whose frame ``center_mm`` is the wheel's centre.

        ``servo`` is the name of the servo that drives it. A wheel with the name "" turns freely.
        """
        face_path = self._face(on)
        # A pulse that is longer than the neutral one turns the shaft counter-clockwise, as seen on its end. That drives a
        # wheel on the left forward, and a wheel on the right backward.
        direction = 1 if side == "left" else -1
        # A component does not know the other wheels: the car sets the wheel's name and its channel when it is complete.
        axle = Axle(
            wheel="", body=self.graph.faces[face_path].body, servo=servo, channel=-1, side=side,
            direction=direction, center_mm=center_mm, radius_mm=radius_mm, tyre_width_mm=tyre_width_mm,
        )  # fmt: skip
        self.graph.axles.append((face_path, axle))

    def begin_at(self, face: str, pose: Pose) -> None:
        """Set the pose of one face in the car. The poses of all other faces follow from the joins."""
        self.graph.origin = (self._face(face), pose)

    def body_of(self, face: str) -> str:
        """Return the rigid body of a face."""
        return self.graph.faces[self._face(face)].body

    def face_size_mm(self, face: str) -> Point:
        """Return the extent of a face's outline along x and y (mm)."""
        outline = self.graph.faces[self._face(face)].outline_mm
        xs, ys = zip(*outline, strict=True)
        return (max(xs) - min(xs), max(ys) - min(ys))

    def edges(self, face: str) -> tuple[str, ...]:
        """Return the names of a face's edges."""
        return self.graph.faces[self._face(face)].edges

    def _hole(self, face: str, hole: Hole) -> str:
        self.graph.faces[self._face(face)].holes.append(hole)
        return hole.name

    def path(self, name: str) -> str:
        """Return the full path of a face, hole or part of this component."""
        return f"{self.name}.{name}" if self.name else name

    def _face(self, name: str) -> str:
        path = self.path(name)
        if path not in self.graph.faces:
            raise ComponentError(self.name, f'has no face "{name}"')
        return path

    def _edge(self, name: str) -> Edge:
        face, _, edge = name.rpartition(".")
        path = self._face(face)
        edges = self.graph.faces[path].edges
        if edge not in edges:
            raise ComponentError(path, f'has no edge "{edge}"; it has {", ".join(edges)}')
        return Edge(path, edges.index(edge))

    def _whole_face(self, name: str) -> Edge:
        """Return the end of a contact that is a whole face; its edge 0 stands for the face."""
        return Edge(self._face(name), 0)


def rectangle_around(center_mm: Point, length_mm: float, width_mm: float) -> tuple[Point, ...]:
    """Return the corners of a rectangle around a point, its length along x, counter-clockwise."""
    (x, y), a, b = center_mm, length_mm / 2, width_mm / 2
    return ((x - a, y - b), (x + a, y - b), (x + a, y + b), (x - a, y + b))


def on_circle(radius_mm: float, angles_rad: Iterable[float], center_mm: Point = (0.0, 0.0)) -> list[Point]:
    """Return the points of a circle in these directions."""
    return [(center_mm[0] + radius_mm * math.cos(at), center_mm[1] + radius_mm * math.sin(at)) for at in angles_rad]
