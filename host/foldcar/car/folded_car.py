"""The folded car of a design: modules fused to segments, caps on their ends, hinges between them, wheels on servos.

Input: a design. Output: the immutable FoldedCar that every exporter and the simulator's body read.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

from foldcar.car.compiler.assemble import Assembly, assemble
from foldcar.car.compiler.component import Component, Sub, build
from foldcar.car.compiler.graph import Graph, PlacedAxle
from foldcar.car.compiler.shape import Shape
from foldcar.car.compiler.slot import ComponentError, Slot
from foldcar.car.components.box_beam import PANELS, wall_mm
from foldcar.car.components.brain_module import ElectronicsModule
from foldcar.car.components.end_cap import EndCap
from foldcar.car.components.hinge_module import HingeModule, stiffness_n_m_rad
from foldcar.car.components.switch_mount import SwitchMount
from foldcar.car.components.wheel import Wheel
from foldcar.car.design import Design, DesignError
from foldcar.car.folded.folding import edge, folded
from foldcar.car.folded.model import Axle, FoldedCar, HingeJoint, Join, Mount, Piece, PlacedPiece, Pose, Wire
from foldcar.car.folded.pose import apply, compose, rotation, translation
from foldcar.car.leads import with_leads
from foldcar.car.modules import HINGE, declared, modules
from foldcar.car.neighbours import around, switch_cap
from foldcar.car.parts.catalogue import Catalogue, chosen
from foldcar.car.parts.choices import PartChoices
from foldcar.car.user_modules import place_of


class Car(Component):
    """The component of a whole car but its wheels. Parameters: shared ones by name, those of modules as ``W.length``."""

    def __init__(self, design: Design) -> None:
        self.design = design
        self.names = [f"{letter}{i}" for i, letter in enumerate(design.modules)]
        super().__init__(parts=design.parts)

    def subcomponents(self) -> Sequence[Sub]:
        """Modules from front to back, then two caps for each segment."""
        subs = []
        electronics = self.design.modules.index("B")
        for i, letter in enumerate(self.design.modules):
            kind: type[Component] = ElectronicsModule if i == electronics else modules()[letter]
            shared = tuple(parameter.name for parameter in declared(kind) if parameter.shared)
            body = f"segment{self.design.segment_at(i)}"
            settings = {} if letter == HINGE else around(self.design, i)
            subs.append(Sub(self.names[i], kind, shared, letter, i == 0, settings, body))
        for index, segment in enumerate(self.design.segments):
            for end, module in (("front", segment.modules[0]), ("rear", segment.modules[-1])):
                outer = module == (0 if end == "front" else len(self.names) - 1)
                settings = {"slit": 0.0 if outer else self.parts.assembly.cable_slit_length_mm.value}
                name = f"{end} cap {index + 1}"
                subs.append(Sub(name, EndCap, ("width", "height"), settings=settings, body=f"segment{index}"))
        ends = {"front": 0, "rear": len(self.design.segments) - 1}
        subs.append(Sub("switch", SwitchMount, body=f"segment{ends[switch_cap(self.design).partition(' ')[0]]}"))
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
                EndCap.close(shape, f"{end} cap {index + 1}", end, self.names[module])
        cap = f"{switch_cap(self.design)}.cap"
        width, height = shape.face_size_mm(cap)
        SwitchMount.cut(shape, "switch", cap, (width / 2, height / 2))
        for i, name in enumerate(self.names):
            hinge = self.children[name]
            if isinstance(hinge, HingeModule):
                before = self.design.segment_at(i)
                caps = (f"rear cap {before + 1}", f"front cap {before + 2}")
                hinge.join(shape, name, (self.names[i - 1], self.names[i + 1]), caps)
        rear_of_first = self.design.length_mm / 2 - shape.face_size_mm(f"{self.names[0]}.beam.floor")[0]
        across, up = wall_mm(self["width"], self.parts), wall_mm(self["height"], self.parts)
        corner = translation(rear_of_first, -across / 2, -up / 2)
        shape.begin_at(f"{self.names[0]}.beam.floor", corner)

    def key_of(self, slot: Slot) -> str | None:
        """The design's key of the parameter that shares its value with ``slot``, or None."""
        return next((key for key, mine in self.slots.items() if mine.head is slot.head), None)


def folded_car(design: Design) -> FoldedCar:
    """The folded car of a design; DesignError if its parts do not fit."""
    return _folded_car(design.modules, tuple(design.values.items()), design.choices)


@lru_cache(maxsize=64)
def _folded_car(letters: tuple[str, ...], values: tuple[tuple[str, float], ...], choices: PartChoices) -> FoldedCar:
    design = Design(letters, dict(values), choices)
    graph, frame = _frame(design)
    wheel = _wheel(design.values["radius"], design.values["W.tire_thickness"], choices)
    count = len(frame.axles)
    titles = {axle.servo: _servo_title(channel, count, axle.side) for channel, (axle, _, _) in enumerate(frame.axles)}
    axles = [_axle(channel, titles[axle[0].servo], *axle) for channel, axle in enumerate(frame.axles)]
    mounts = [replace(m, name=_titled(m.name, titles)) for m in frame.mounts]
    first = max((join.number for join in frame.joins), default=0)
    wheel_joins = (
        Join(first + j.number, j.kind, j.piece_a, j.a, j.piece_b, j.b, j.length_mm, j.slot) for j in wheel.joins
    )
    wheels = _wheels(wheel, axles) if count else ((), ())
    car = FoldedCar(
        pieces=(*frame.pieces, *(_times(piece, count) for piece in wheel.pieces if count)),
        placed=(*frame.placed, *wheels[0]),
        joins=(*frame.joins, *(wheel_joins if count else ())),
        mounts=(*mounts, *wheels[1]),
        axles=tuple(axles),
        hinges=tuple(_hinges(frame, design.parts)),
        wires=(*graph.wires, *_servo_wires(axles, design.parts)),
        parts=design.parts,
    )
    return with_leads(car)


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
def _wheel(radius_mm: float, tyre_width_mm: float, choices: PartChoices) -> Assembly:
    wheel = Wheel(body="wheel", parts=chosen(choices))
    wheel.solve({"radius": radius_mm, "tire_thickness": tyre_width_mm})
    return assemble(build(wheel))


def _titled(name: str, titles: Mapping[str, str]) -> str:
    """The name of a servo, or of one of its screws, by its place in the car."""
    servo = next((servo for servo in titles if name.startswith(servo)), "")
    return titles.get(servo, "") + name.removeprefix(servo)


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
    """The wheel's pieces and parts once for every axle, turned by half a turn about z on the right side."""
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
            mounts.append(replace(m, name=f"{m.name} of {axle.wheel}", body=axle.wheel, pose=compose(pose, m.pose)))
    return tuple(placed), tuple(mounts)


def _hinges(frame: Assembly, parts: Catalogue) -> list[HingeJoint]:
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
            length = 2 * (max(p[0] for p in faces[crease.parent.face].outline_mm) - parts.assembly.hinge_glue_mm.value)
            width = abs(a[1] - b[1]) + parts.film.thickness_mm.value
            stiffness = stiffness_n_m_rad(width, piece.thickness_mm, length, parts.film)
            limits = (crease.min_rad or 0.0, crease.max_rad or 0.0)
            hinges.append(HingeJoint(f"segment{number}", f"segment{number + 1}", (x, y, z), stiffness, *limits))
    return sorted(hinges, key=lambda hinge: -hinge.center_mm[0])


def _servo_wires(axles: list[Axle], parts: Catalogue) -> list[Wire]:
    wing = parts.featherwing.name
    return [
        Wire(f"{wing} channel {axle.channel}", axle.servo, "signal",
             "turns forward above neutral" if axle.direction > 0 else "mirrored: turns forward below neutral")
        for axle in axles
    ]  # fmt: skip
