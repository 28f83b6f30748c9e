"""The folded car of a design: modules fused to segments, caps on their ends, hinges between them, wheels on servos.

Input: a design. Output: the immutable FoldedCar that every exporter and the simulator's body read.
"""

import math
from collections.abc import Sequence
from functools import lru_cache

from foldcar.car.compiler.assemble import Assembly, assemble
from foldcar.car.compiler.component import Component, Sub, build
from foldcar.car.compiler.graph import Graph, PlacedAxle
from foldcar.car.compiler.shape import Shape
from foldcar.car.compiler.slot import ComponentError, Slot
from foldcar.car.components.box_beam import PANELS, EndCap, wall_mm
from foldcar.car.components.brain_module import ElectronicsModule
from foldcar.car.components.hinge_module import HingeModule, stiffness_n_m_rad
from foldcar.car.components.wheel import Wheel
from foldcar.car.design import Design, DesignError
from foldcar.car.folded.folding import edge, folded
from foldcar.car.folded.model import Axle, FoldedCar, HingeJoint, Join, Mount, Piece, PlacedPiece, Pose, Wire
from foldcar.car.folded.pose import apply, compose, rotation, translation
from foldcar.car.modules import HINGE, declared, modules
from foldcar.car.parts.catalogue import catalogue
from foldcar.car.user_modules import place_of

# Edge of a front cap, seen from inside, at each wall; on a rear cap left and right are exchanged.
CAP_EDGES = {"floor": "near", "right": "front", "lid": "far", "left": "rear"}
OPPOSITE = {"left": "right", "right": "left", "floor": "floor", "lid": "lid"}


class Car(Component):
    """The component of a whole car but its wheels. Parameters: shared ones by name, those of modules as ``W.length``."""

    def __init__(self, design: Design) -> None:
        self.design = design
        self.names = [f"{letter}{i}" for i, letter in enumerate(design.modules)]
        super().__init__()

    def subcomponents(self) -> Sequence[Sub]:
        """Modules from front to back, then two caps for each segment."""
        subs = []
        electronics = self.design.modules.index("B")
        for i, letter in enumerate(self.design.modules):
            kind: type[Component] = ElectronicsModule if i == electronics else modules()[letter]
            shared = tuple(parameter.name for parameter in declared(kind) if parameter.shared)
            from_segment = {"towards_middle": self._towards_middle(i), "tab_there": self._tab_there(i)}
            settings = {p.name: from_segment[p.name] for p in kind.parameters if p.name in from_segment}
            body = f"segment{self.design.segment_at(i)}"
            subs.append(Sub(self.names[i], kind, shared, letter, i == 0, settings, body))
        for index, segment in enumerate(self.design.segments):
            for end, module in (("front", segment.modules[0]), ("rear", segment.modules[-1])):
                outer = module == (0 if end == "front" else len(self.names) - 1)
                settings = {"slit": 0.0 if outer else catalogue().assembly.cable_slit_length_mm.value}
                name = f"{end} cap {index + 1}"
                subs.append(Sub(name, EndCap, ("width", "height"), settings=settings, body=f"segment{index}"))
        return subs

    def build(self, shape: Shape) -> None:
        """Fuse neighbouring beams, close the segments' ends with caps, glue on the hinges."""
        letters = self.design.modules
        for i, (one, following) in enumerate(zip(self.names, self.names[1:], strict=False)):
            if HINGE not in letters[i : i + 2]:
                for panel in PANELS:
                    shape.connect(f"{one}.beam.{panel}.rear", f"{following}.beam.{panel}.front", "rigid")
        for index, segment in enumerate(self.design.segments):
            for end, module in (("front", segment.modules[0]), ("rear", segment.modules[-1])):
                self._close(shape, f"{end} cap {index + 1}", end, self.names[module])
        for i, name in enumerate(self.names):
            hinge = self.children[name]
            if isinstance(hinge, HingeModule):
                before = self.design.segment_at(i)
                caps = (f"rear cap {before + 1}", f"front cap {before + 2}")
                hinge.join(shape, name, (self.names[i - 1], self.names[i + 1]), caps)
        rear_of_first = self.design.length_mm / 2 - shape.face_size_mm(f"{self.names[0]}.beam.floor")[0]
        corner = translation(rear_of_first, -wall_mm(self["width"]) / 2, -wall_mm(self["height"]) / 2)
        shape.begin_at(f"{self.names[0]}.beam.floor", corner)

    def key_of(self, slot: Slot) -> str | None:
        """The design's key of the parameter that shares its value with ``slot``, or None."""
        return next((key for key, mine in self.slots.items() if mine.head is slot.head), None)

    def _towards_middle(self, module: int) -> float:
        middle = self.design.segments[self.design.segment_at(module)].center_mm
        return -1.0 if self.design.module_centers_mm[module] > middle else 1.0

    def _tab_there(self, module: int) -> float:
        """The depth of the caps' tabs (mm) if the module is a segment of its own, else 0: no cap is at its inner end."""
        alone = len(self.design.segments[self.design.segment_at(module)].modules) == 1
        return catalogue().assembly.cap_tab_mm.value if alone else 0.0

    def _close(self, shape: Shape, cap: str, end: str, module: str) -> None:
        depth = catalogue().assembly.cap_tab_mm.value
        for panel, cap_edge in CAP_EDGES.items():
            wall = panel if end == "front" else OPPOSITE[panel]
            shape.connect(f"{module}.beam.{wall}.{end}", f"{cap}.cap.{cap_edge}", "tab", 90, depth_mm=depth)


def folded_car(design: Design) -> FoldedCar:
    """The folded car of a design; DesignError if its parts do not fit."""
    return _folded_car(design.modules, tuple(design.values.items()))


@lru_cache(maxsize=64)
def _folded_car(letters: tuple[str, ...], values: tuple[tuple[str, float], ...]) -> FoldedCar:
    design = Design(letters, dict(values))
    graph, frame = _frame(design)
    wheel = _wheel(design.values["radius"], design.values["W.tire_thickness"])
    count = len(frame.axles)
    titles = {axle.servo: _servo_title(channel, count, axle.side) for channel, (axle, _, _) in enumerate(frame.axles)}
    axles = [_axle(channel, titles[axle[0].servo], *axle) for channel, axle in enumerate(frame.axles)]
    mounts = [
        Mount(m.part, titles.get(m.name, m.name), m.body, m.pose, m.size_mm, m.mass_kg, m.face, m.holes)
        for m in frame.mounts
    ]
    first = max((join.number for join in frame.joins), default=0)
    wheel_joins = (
        Join(first + j.number, j.kind, j.piece_a, j.a, j.piece_b, j.b, j.length_mm, j.slot) for j in wheel.joins
    )
    wheels = _wheels(wheel, axles) if count else ((), ())
    return FoldedCar(
        pieces=(*frame.pieces, *(_times(piece, count) for piece in wheel.pieces if count)),
        placed=(*frame.placed, *wheels[0]),
        joins=(*frame.joins, *(wheel_joins if count else ())),
        mounts=(*mounts, *wheels[1]),
        axles=tuple(axles),
        hinges=tuple(_hinges(frame)),
        wires=(*graph.wires, *_servo_wires(axles)),
    )


def _frame(design: Design) -> tuple[Graph, Assembly]:
    """The car without its wheels; the error of a user's component names its file and line."""
    car = None
    try:
        car = Car(design)
        car.solve(design.values)
        graph = build(car)
        return graph, assemble(graph)
    except ComponentError as error:
        key = car.key_of(error.slot) if car is not None and error.slot is not None else None
        place = place_of(error)
        message = error.message if key else str(error)
        raise DesignError(key, f"{message} [{place}]" if place else message) from error
    except Exception as error:
        place = place_of(error)
        if place is None:
            raise
        raise DesignError(None, f"{place}: {type(error).__name__}: {error}") from error


@lru_cache(maxsize=8)
def _wheel(radius_mm: float, tyre_width_mm: float) -> Assembly:
    wheel = Wheel(body="wheel")
    wheel.solve({"radius": radius_mm, "tire_thickness": tyre_width_mm})
    return assemble(build(wheel))


def _times(piece: Piece, count: int) -> Piece:
    return Piece(piece.name, piece.label, piece.faces, piece.creases, piece.thickness_mm, piece.count * count)


def _servo_title(channel: int, count: int, side: str) -> str:
    if count <= 4:
        end = "" if count <= 2 else ("front ", "rear ")[channel // 2]
        return f"{end}{side} servo"
    return f"axle {channel // 2 + 1} {side} servo"


def _axle(channel: int, servo: str, axle: PlacedAxle, body: str, center_mm: tuple[float, float, float]) -> Axle:
    """The axle in the car. Servos turn counter-clockwise above neutral, so those on the right turn backwards."""
    direction = 1 if axle.side == "left" else -1
    return Axle(f"wheel{channel}", body, servo, channel, axle.side, direction, center_mm, axle.radius_mm,
                axle.tyre_width_mm)  # fmt: skip


def _wheels(wheel: Assembly, axles: list[Axle]) -> tuple[tuple[PlacedPiece, ...], tuple[Mount, ...]]:
    """The wheel's pieces and horn once for every axle, turned by half a turn about z on the right side."""
    counts = {piece.name: piece.count for piece in wheel.pieces}
    placed, mounts = [], []
    for n, axle in enumerate(axles):
        pose: Pose = translation(*axle.center_mm)
        if axle.side == "right":
            pose = compose(pose, rotation("z", math.pi))
        for one in wheel.placed:
            copy = n * counts[one.piece] + one.copy
            placed.append(PlacedPiece(one.piece, copy, axle.wheel, compose(pose, one.pose)))
        for m in wheel.mounts:
            name = f"horn of {axle.wheel}"
            mounts.append(Mount(m.part, name, axle.wheel, compose(pose, m.pose), m.size_mm, m.mass_kg, m.face, m.holes))
    return tuple(placed), tuple(mounts)


def _hinges(frame: Assembly) -> list[HingeJoint]:
    """One hinge at the crease of every flexure, front to back."""
    pieces = {piece.name: piece for piece in frame.pieces}
    hinges = []
    for placed in frame.placed:
        piece = pieces[placed.piece]
        faces = {face.name: face for face in piece.faces}
        for crease in piece.creases:
            if not crease.flexure:
                continue
            ends = edge(faces, crease.parent)
            pose = compose(placed.pose, folded(piece)[crease.parent.face])
            a, b = (apply(pose, *end) for end in ends)
            x, y, z = ((p + q) / 2 for p, q in zip(a, b, strict=True))
            number = int(placed.body.removeprefix("segment"))
            length = 2 * (max(p[0] for p in faces[crease.parent.face].outline_mm) - _glue_mm())
            width = abs(a[1] - b[1]) + catalogue().film.thickness_mm.value
            stiffness = stiffness_n_m_rad(width, piece.thickness_mm, length)
            limits = (crease.min_rad or 0.0, crease.max_rad or 0.0)
            hinges.append(HingeJoint(f"segment{number}", f"segment{number + 1}", (x, y, z), stiffness, *limits))
    return sorted(hinges, key=lambda hinge: -hinge.center_mm[0])


def _glue_mm() -> float:
    return catalogue().assembly.hinge_glue_mm.value


def _servo_wires(axles: list[Axle]) -> list[Wire]:
    wing = catalogue().featherwing.name
    return [
        Wire(f"{wing} channel {axle.channel}", axle.servo, "signal",
             "turns forward above neutral" if axle.direction > 0 else "mirrored: turns forward below neutral")
        for axle in axles
    ]  # fmt: skip
