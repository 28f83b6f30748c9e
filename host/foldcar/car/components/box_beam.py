"""The box beam, one strip folded from right wall, floor, left wall, lid and flap; nothing in it is glued.

Faces: ``right``, ``floor``, ``left``, ``lid``, ``flap``, each with x forward; neighbouring beams are fused along their
``front`` and ``rear`` edges. The lid turns about the left wall's upper edge. Its flap hangs inside the right wall, and
locks on the flap's lower edge go through slots of that wall: pressed in from outside, they let the lid open.
``width`` and ``height`` are outer dimensions; faces are the film's middle surface.
"""

from collections.abc import Mapping

from foldcar.car.compiler.component import Component
from foldcar.car.compiler.parameter import Parameter
from foldcar.car.compiler.shape import Shape
from foldcar.car.components.dimensions import HEIGHT, WIDTH
from foldcar.car.parts.catalogue import Catalogue

PANELS = ("floor", "right", "left", "lid", "flap")
LENGTH = Parameter("length", 80, 1, 1000, "length of a box beam", "a strip that can be folded")
# Set by the car. A flap ends before the tabs of an end cap; a lock's place is counted from the rear, 0 is none.
FLAP_FRONT = Parameter("flap_front", 0, 0, 100, "from the front end to the flap", "none", internal=True)
FLAP_REAR = Parameter("flap_rear", 0, 0, 100, "from the rear end to the flap", "none", internal=True)
LOCKS = tuple(
    Parameter(f"lock_{i}", 0, 0, 1000, f"middle of lock {i} from the rear end", "none", internal=True) for i in (1, 2)
)
FROM_CAR = tuple(parameter.name for parameter in (FLAP_FRONT, FLAP_REAR, *LOCKS))


def wall_mm(outer_mm: float, parts: Catalogue) -> float:
    """Distance between the middle surfaces of two opposite walls (mm): the outer dimension less one film thickness."""
    return outer_mm - parts.film.thickness_mm.value


def flap_end_mm(parts: Catalogue) -> float:
    """Distance of a flap from the middle of an end cap (mm): the cap's tab and a clearance."""
    return parts.assembly.cap_tab_mm.value + 2 * parts.assembly.slot_clearance_mm.value


class Panel(Component):
    """A rectangle of film: ``length`` along x, ``width`` along y; face ``panel``."""

    parameters = (
        Parameter("length", 10, 0.5, 2000, "along x", "what can be cut"),
        Parameter("width", 10, 0.5, 2000, "along y", "what can be cut"),
    )

    def build(self, shape: Shape) -> None:
        """One face with edges near, front, far and rear."""
        shape.rectangle("panel", self["length"], self["width"])


class BoxBeam(Component):
    """Three walls, a lid and its flap with up to two locks, ``tongue 1`` and ``tongue 2``."""

    parameters = (LENGTH, WIDTH, HEIGHT, FLAP_FRONT, FLAP_REAR, *LOCKS)

    def build(self, shape: Shape) -> None:
        """The floor, the two walls folded up from it, the lid folded from the left one."""
        length = self["length"]
        across, up = wall_mm(self["width"], self.parts), wall_mm(self["height"], self.parts)
        for name, size in (("floor", across), ("right", up), ("left", up)):
            shape.rectangle(name, length, size, piece="beam")
        self._lid(shape)
        for one, following in (("right", "floor"), ("floor", "left"), ("left", "lid"), ("lid", "flap")):
            shape.connect(f"{one}.far", f"{following}.near", "fold", 90)
        for edge in ("far", "far front", "far rear"):
            if edge in shape.edges("lid"):
                shape.tuck(f"lid.{edge}", "right.near")

    def _lid(self, shape: Shape) -> None:
        """The lid, narrower than the floor by the film of wall and flap and their clearance, the flap and its locks."""
        assembly, film = self.parts.assembly, self.parts.film.thickness_mm.value
        length, front, rear = self["length"], self["flap_front"], self["flap_rear"]
        width = wall_mm(self["width"], self.parts) - film - assembly.flap_gap_mm.value
        corners = {
            "near": (0.0, 0.0), "front": (length, 0.0), "far front": (length, width), "far": (length - front, width),
            "far rear": (rear, width), "rear": (0.0, width),
        }  # fmt: skip
        if front == 0:
            del corners["far front"]
        if rear == 0:
            del corners["far rear"]
        shape.face("lid", tuple(corners.values()), tuple(corners))
        depth, half = assembly.flap_mm.value, assembly.lock_mm.value / 2
        long = length - front - rear
        edges: dict[str, tuple[float, float]] = {"near": (0.0, 0.0), "front": (long, 0.0)}
        locks = {i: self[f"lock_{i}"] for i in (1, 2) if self[f"lock_{i}"] > 0}
        start = long
        for i, x in sorted(locks.items(), key=lambda lock: -lock[1]):
            edges[f"before {i}"] = (start, depth)
            edges[f"lock {i}"] = (x - rear + half, depth)
            start = x - rear - half
        edges["far"], edges["rear"] = (start, depth), (0.0, depth)
        shape.face("flap", tuple(edges.values()), tuple(edges))
        self._locks(shape, locks)

    def _locks(self, shape: Shape, locks: Mapping[int, float]) -> None:
        """Tongues at the flap's lower edge, folded outwards through slots of the right wall."""
        assembly, film = self.parts.assembly, self.parts.film.thickness_mm.value
        width, play = assembly.lock_mm.value, assembly.slot_clearance_mm.value
        reach = 1.5 * film + assembly.flap_gap_mm.value + assembly.lock_reach_mm.value
        corner = min(1.0, reach / 2)
        for i, x in locks.items():
            outline = ((0.0, 0.0), (width, 0.0), (width - corner, reach), (corner, reach))
            shape.face(f"tongue {i}", outline, ("near", "1", "tip", "3"), role="tab")
            shape.connect(f"flap.lock {i}", f"tongue {i}.near", "fold", -90)
            at = (x, assembly.flap_mm.value)
            shape.rectangular_hole("right", f"lock slot {i}", "slot", at, width + 2 * play, film + play)
            shape.lock(f"tongue {i}.tip", "right", f"lock slot {i}")
