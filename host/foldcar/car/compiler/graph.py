"""The graph that a tree of components builds: faces before they are fused, links between their edges, parts, axles.

Lengths in millimetres, angles in radians; a pose is given in the frame of the face ``on``.
"""

import math
from dataclasses import dataclass, field
from typing import Literal

from foldcar.car.compiler.slot import ComponentError
from foldcar.car.folded.model import Access, Hole, JoinKind, Mark, Point, Pose, Solid, Wire

LinkKind = Literal["fold", "bend", "rigid", "hinge", "tab"]


@dataclass
class Atom:
    """A face as one component made it, before it is fused with its neighbours."""

    path: str
    outline_mm: tuple[Point, ...]
    edges: tuple[str, ...]
    role: Literal["panel", "tab", "rim"]
    piece: str
    thickness_mm: float
    body: str
    holes: list[Hole] = field(default_factory=list)
    marks: list[Mark] = field(default_factory=list)
    accesses: list[Access] = field(default_factory=list)


@dataclass(frozen=True)
class Link:
    """Two edges (face path, index) that meet at ``angle_rad``. A tab grows from edge ``b`` and is glued at edge ``a``.

    ``depth_mm``, ``mitre`` and ``inset_mm`` describe a tab (see Shape.connect), ``min_rad`` and ``max_rad`` a hinge.
    """

    kind: LinkKind
    a: tuple[str, int]
    b: tuple[str, int]
    angle_rad: float
    depth_mm: float = 0.0
    mitre: float = 1.0
    min_rad: float = 0.0
    max_rad: float = 0.0
    inset_mm: float = 0.0


@dataclass(frozen=True)
class Placement:
    """A face's pose in the frame of the face ``on``, onto which it may be laminated."""

    face: str
    on: str
    pose: Pose
    laminated: bool = False


@dataclass(frozen=True)
class Contact:
    """A join between faces that other links and placements have put in their places: edges, or the face of ``b``.

    ``slot`` is the hole of b's face that the tongue with tip ``a`` goes through.
    """

    kind: JoinKind
    a: tuple[str, int]
    b: tuple[str, int]
    slot: str | None = None


@dataclass(frozen=True)
class PlacedPart:
    """A bought part: the pose of its box's centre in the frame of the face ``on``; ``holes`` are its screw holes."""

    part: str
    name: str
    on: str
    pose: Pose
    size_mm: tuple[float, float, float]
    mass_kg: float
    holes: tuple[str, ...]
    solids: tuple[Solid, ...] = ()
    accesses: tuple[Access, ...] = ()


@dataclass(frozen=True)
class PlacedAxle:
    """A wheel's joint: the tyre's centre in the frame of the face ``on``, and the name of the servo that turns it."""

    on: str
    servo: str
    side: Literal["left", "right"]
    center_mm: tuple[float, float, float]
    radius_mm: float
    tyre_width_mm: float


@dataclass
class Graph:
    """Everything that the components of a tree have built; ``origin`` is a face and its pose in the car."""

    atoms: dict[str, Atom] = field(default_factory=dict)
    links: list[Link] = field(default_factory=list)
    placements: list[Placement] = field(default_factory=list)
    contacts: list[Contact] = field(default_factory=list)
    parts: list[PlacedPart] = field(default_factory=list)
    axles: list[PlacedAxle] = field(default_factory=list)
    wires: list[Wire] = field(default_factory=list)
    origin: tuple[str, Pose] | None = None
    _linked: dict[tuple[str, int], str] = field(default_factory=dict)

    def add(self, link: Link) -> None:
        """Add a link; ComponentError if one of its edges is linked already."""
        for edge, other in ((link.a, link.b), (link.b, link.a)):
            if edge in self._linked:
                raise ComponentError(
                    self.edge_path(edge), f"is connected to {self.edge_path(other)} and {self._linked[edge]}"
                )
            self._linked[edge] = self.edge_path(other)
        self.links.append(link)

    def edge_path(self, edge: tuple[str, int]) -> str:
        """The readable path of an edge: face path and edge name."""
        return f"{edge[0]}.{self.atoms[edge[0]].edges[edge[1]]}"

    def edge_length_mm(self, edge: tuple[str, int]) -> float:
        """Length of an edge (mm)."""
        outline = self.atoms[edge[0]].outline_mm
        return math.dist(outline[edge[1]], outline[(edge[1] + 1) % len(outline)])
