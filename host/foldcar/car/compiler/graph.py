"""What the components of a tree have made: faces before they are fused, links between their edges, parts and axles.

Lengths in millimetres, angles in radians; a pose is that of a thing in the frame of the face it lies on.
"""

import math
from dataclasses import dataclass, field
from typing import Literal

from foldcar.car.compiler.slot import ComponentError
from foldcar.car.folded.model import Hole, Point, Pose, Wire

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
