"""The immutable data model of a folded car, its film and everything fixed to it; every exporter reads it.

Lengths in millimetres, angles in radians. Each face has a frame: its outline lies in the plane z = 0, its printed
side faces +z. Folding turns a child face about the edge it shares with its parent; a positive angle lifts the child
towards the parent's +z (a valley fold seen from the printed side), a negative one is a mountain fold.
The faces are the film's middle surface. The car's frame: x forward, y left, z up, from the middle of its length at axle
height, hinges flat. Poses are 4x4 row-major homogeneous matrices as nested tuples.
"""

from dataclasses import dataclass, field
from typing import Literal

from foldcar.car.parts.catalogue import Catalogue

Point = tuple[float, float]
Pose = tuple[tuple[float, float, float, float], ...]
IDENTITY: Pose = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))

HoleKind = Literal["opening", "screw", "slot", "slit", "axle", "mark"]
JoinKind = Literal["lap", "tab", "tab_slot", "lock", "tuck", "laminate", "rim"]


@dataclass(frozen=True, slots=True)
class Hole:
    """A closed cut inside a face, counter-clockwise in the face's frame; ``diameter_mm`` if it is a circle."""

    name: str
    kind: HoleKind
    outline_mm: tuple[Point, ...]
    diameter_mm: float | None = None
    center_mm: Point | None = None


@dataclass(frozen=True, slots=True)
class PrintedOutline:
    """An outline on the printed side, counter-clockwise in the face's frame: the place of ``name``, or an arrow."""

    name: str
    outline_mm: tuple[Point, ...]


@dataclass(frozen=True, slots=True)
class Face:
    """One flat polygon of film. ``role`` is panel, tab or rim; edge i runs from outline point i to i + 1.

    ``clearances`` are the spaces, in the face's frame, that must be free where it is gripped or pressed.
    """

    name: str
    outline_mm: tuple[Point, ...]
    holes: tuple[Hole, ...] = ()
    role: Literal["panel", "tab", "rim"] = "panel"
    marks: tuple[PrintedOutline, ...] = ()
    clearances: tuple["ToolClearance", ...] = ()


@dataclass(frozen=True, slots=True)
class EdgeRef:
    """Edge ``index`` of the face of that name."""

    face: str
    index: int


@dataclass(frozen=True, slots=True)
class Crease:
    """Two faces of a piece that share an edge; the two faces' outlines run along it in opposite directions.

    ``angle_rad`` is the assembled angle. A flexure bends in use, between ``min_rad`` and ``max_rad``. A ``bend`` is part
    of a smooth elastic curve, which stays neither cut nor scored.
    """

    name: str
    parent: EdgeRef
    child: EdgeRef
    angle_rad: float
    flexure: bool = False
    min_rad: float = 0.0
    max_rad: float = 0.0
    bend: bool = False


@dataclass(frozen=True, slots=True)
class Piece:
    """A connected part cut from one sheet, ``count`` times; ``faces[0]`` is the root of the tree of creases."""

    name: str
    label: str
    faces: tuple[Face, ...]
    creases: tuple[Crease, ...]
    thickness_mm: float
    count: int = 1


@dataclass(frozen=True, slots=True)
class PlacedPiece:
    """One copy of a piece: the pose of its root face in the car. ``body`` is ``segment0`` … or ``wheel0`` …"""

    piece: str
    copy: int
    body: str
    pose: Pose


@dataclass(frozen=True, slots=True)
class Join:
    """A join made by hand; ``number`` is printed on both sides, joins with the same number are one seam.

    tab, lap, rim: edge 0 of tab ``a`` and the edge ``b`` meet, the tab is glued to the inside of b's face; lap within
    one piece, rim around a wheel. laminate: face ``a`` lies on face ``b``. tab_slot: edge ``a`` is a tongue's tip, put
    through hole ``slot`` of b's face; a lock is one that opens again without harm. tuck: edge ``a`` lies inside edge
    ``b``, closer than a film and its clearance, and is not glued.
    """

    number: int
    kind: JoinKind
    piece_a: str
    a: EdgeRef
    piece_b: str
    b: EdgeRef
    length_mm: float
    slot: str | None = None


@dataclass(frozen=True, slots=True)
class Solid:
    """A box, or a cylinder along z (diameter, diameter, length); ``pose`` is that of its middle in its part's frame.

    ``bores`` are round holes along z through it, (x, y, diameter), for screws only. A ``weightless`` solid, such as a
    lead, takes space, but no share of its part's mass.
    """

    kind: Literal["box", "cylinder"]
    size_mm: tuple[float, float, float]
    pose: Pose
    bores: tuple[tuple[float, float, float], ...] = ()
    weightless: bool = False


@dataclass(frozen=True, slots=True)
class ToolClearance:
    """A space that a tool needs: a cylinder along +z from ``pose`` in the frame of its part or face.

    ``tool`` is a screwdriver, a plug with the hand that holds it, a finger, or the film of a tongue that is drawn in.
    """

    tool: Literal["driver", "plug", "finger", "tongue"]
    pose: Pose
    diameter_mm: float
    length_mm: float


@dataclass(frozen=True, slots=True)
class Mount:
    """A bought part: the name of its catalogue entry, the pose of its box's centre in the car, size along its axes.

    ``solids`` are its shape; a part without them is a box.
    """

    part: str
    name: str
    body: str
    pose: Pose
    size_mm: tuple[float, float, float]
    mass_kg: float
    face: str | None = None
    holes: tuple[str, ...] = ()
    solids: tuple[Solid, ...] = ()
    clearances: tuple[ToolClearance, ...] = ()

    @property
    def shape(self) -> tuple[Solid, ...]:
        """Its solids, or else its box."""
        return self.solids or (Solid("box", self.size_mm, IDENTITY),)

    @property
    def center_mm(self) -> tuple[float, float, float]:
        """The centre of its box in the car's frame."""
        x_row, y_row, z_row, _ = self.pose
        return x_row[3], y_row[3], z_row[3]

    def half_mm(self, axis: int) -> float:
        """Return half of its box along an axis of the car (mm)."""
        return sum(abs(self.pose[axis][k]) * self.size_mm[k] for k in range(3)) / 2


@dataclass(frozen=True, slots=True)
class Axle:
    """A wheel's joint: the mount ``servo`` on ``channel`` turns the body ``wheel`` about +y at ``center_mm`` in the car.

    ``direction`` is 1 if the wheel turns forward for pulses above neutral, else -1. Wheels of one ``unit`` are alike.
    Without a servo (``servo`` is empty) it turns freely, and ``channel`` is a number after those of the servos' outputs.
    """

    wheel: str
    body: str
    servo: str
    channel: int
    side: Literal["left", "right"]
    direction: int
    center_mm: tuple[float, float, float]
    radius_mm: float
    tyre_width_mm: float
    unit: str = "wheel"

    @property
    def driven(self) -> bool:
        """Whether a servo turns it."""
        return bool(self.servo)


@dataclass(frozen=True, slots=True)
class HingeJoint:
    """A flexure between two segments: pitch about +y at ``center_mm`` in the car, positive with the front nose up."""

    front: str
    rear: str
    center_mm: tuple[float, float, float]
    stiffness_n_m_rad: float
    min_rad: float
    max_rad: float


@dataclass(frozen=True, slots=True)
class Wire:
    """An electrical connection of two terminals (``FeatherWing.3``, ``front left servo``) and what it carries."""

    a: str
    b: str
    carries: Literal["signal", "supply", "stack", "usb", "control"]
    note: str = ""


@dataclass(frozen=True, slots=True)
class FoldedCar:
    """One car: its cut pieces, bought parts, joins, axles, hinges and wires; ``parts`` is the data of its parts."""

    pieces: tuple[Piece, ...]
    placed: tuple[PlacedPiece, ...]
    joins: tuple[Join, ...]
    mounts: tuple[Mount, ...]
    axles: tuple[Axle, ...]
    hinges: tuple[HingeJoint, ...]
    wires: tuple[Wire, ...]
    parts: Catalogue = field(repr=False)
