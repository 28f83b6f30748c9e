"""The folded car of a design: modules fused to segments, caps on their ends, hinges between them, wheels on servos.

Input: a design. Output: the immutable FoldedCar that every exporter and the simulator's body read. The car tells a module
what it must know of the others: its segment's ends, the floor beside it, the tyres next to it.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

from foldcar.car.components.assemble import Assembly, assemble, build
from foldcar.car.components.box_beam import PANELS, flap_end_mm, latch_mm, put_cap, wall_mm
from foldcar.car.components.bridge import plug_room_mm, usb_height_mm
from foldcar.car.components.component import ROUNDING, Component, ComponentError, Sub, at_least
from foldcar.car.components.hinge_module import HingeModule, stiffness_n_m_rad
from foldcar.car.components.module import BrainModule, ElectronicsModule, WheelModule
from foldcar.car.components.mounts import depth_mm, inside_mm, put_switch
from foldcar.car.components.shape import Graph, Shape
from foldcar.car.components.wheel import Wheel
from foldcar.car.design import HINGE, MODULES, Design, DesignError, parameters
from foldcar.car.folded.model import FoldedCar, HingeJoint, PlacedPiece, Wire
from foldcar.car.folded.pose import apply, compose, edge, folded, rotation, translation
from foldcar.car.leads import with_leads
from foldcar.car.parts.catalogue import Catalogue, PartChoices, chosen
from foldcar.car.user_modules import building, place_of


class Car(Component):
    """The component of a whole car but its wheels. Parameters: shared ones by name, those of modules as ``W.length``."""

    def __init__(self, design: Design) -> None:
        self.design = design
        self.names = [f"{letter}{i}" for i, letter in enumerate(design.modules)]
        self.parameters = tuple(replace(parameters()[key].declared, name=key) for key in design.values)
        super().__init__(design.values, parts=design.parts)

    def subcomponents(self) -> Sequence[Sub]:
        """Modules from front to back."""
        subs = []
        for i, letter in enumerate(self.design.modules):
            kind: type[Component] = ElectronicsModule if i == electronics(self.design) else MODULES[letter]
            keys = {one.name: one.name if one.shared else f"{letter}.{one.name}" for one in kind.parameters}
            values = {name: self[key] for name, key in keys.items()}
            known = {} if letter == HINGE else around(self.design, i)
            subs.append(Sub(self.names[i], kind, values | known, keys, f"segment{self.design.segment_at(i)}"))
        return subs

    def build(self, shape: Shape) -> None:
        """Fuse neighbouring beams, close the segments' ends with caps, glue on the hinges."""
        letters = self.design.modules
        for i, (one, following) in enumerate(zip(self.names, self.names[1:], strict=False)):
            if HINGE not in letters[i : i + 2]:
                for panel in PANELS:
                    shape.connect(f"{one}.beam.{panel}.rear", f"{following}.beam.{panel}.front", "rigid")
        outer_mm = self["width"], self["height"]
        for number, segment in enumerate(self.design.segments, 1):
            for end, module in (("front", segment.modules[0]), ("rear", segment.modules[-1])):
                outer = module == (0 if end == "front" else len(self.names) - 1)
                slit = 0.0 if outer else self.parts.assembly.cable_slit_length_mm.value
                put_cap(shape, f"{end} cap {number}", end, self.names[module], outer_mm, slit)
        cap = f"{switch_cap(self.design)}.cap"
        width, height = shape.face_size_mm(cap)
        put_switch(shape, cap, (width / 2, height / 2))
        for i, name in enumerate(self.names):
            hinge = self.children[name]
            if isinstance(hinge, HingeModule):
                before = self.design.segment_at(i)
                caps = (f"rear cap {before + 1}", f"front cap {before + 2}")
                hinge.join(shape, name, (self.names[i - 1], self.names[i + 1]), caps)
        across, up = (wall_mm(outer, self.parts) for outer in outer_mm)
        rear_of_first = self.design.length_mm / 2 - self.design.length_of(0)
        shape.begin_at(f"{self.names[0]}.beam.floor", translation(rear_of_first, -across / 2, -up / 2))


def folded_car(design: Design) -> FoldedCar:
    """The folded car of a design; DesignError if its parts do not fit."""
    return _folded_car(design.modules, tuple(design.values.items()), design.choices)


@lru_cache(maxsize=64)
def _folded_car(letters: tuple[str, ...], values: tuple[tuple[str, float], ...], choices: PartChoices) -> FoldedCar:
    design = Design(letters, dict(values), choices)
    with building():
        graph, frame = _frame(design)
    count, axles = len(frame.axles), []
    for channel, axle in enumerate(frame.axles):
        end = f"axle {channel // 2 + 1} "
        if count <= 4:
            end = "" if count <= 2 else ("front ", "rear ")[channel // 2]
        axles.append(replace(axle, wheel=f"wheel{channel}", servo=f"{end}{axle.side} servo", channel=channel))
    titles = {mine.servo: axle.servo for mine, axle in zip(frame.axles, axles, strict=True)}
    mounts = []
    for mount in frame.mounts:
        # Servos and their screws are named by their place in the car.
        servo = next((servo for servo in titles if mount.name.startswith(servo)), "")
        mounts.append(replace(mount, name=titles.get(servo, "") + mount.name.removeprefix(servo)))
    wheel = _wheel(design.values["radius"], design.values["W.tire_thickness"], choices)
    pieces = [*frame.pieces, *(replace(piece, count=piece.count * count) for piece in wheel.pieces)]
    first = max(join.number for join in frame.joins)
    joins = [*frame.joins, *(replace(join, number=first + join.number) for join in wheel.joins)]
    placed, counts = list(frame.placed), {piece.name: piece.count for piece in wheel.pieces}
    for n, axle in enumerate(axles):
        # The wheel is turned by half a turn about z on the right side.
        pose = compose(translation(*axle.center_mm), rotation("z", 0.0 if axle.side == "left" else math.pi))
        for one in wheel.placed:
            copy = n * counts[one.piece] + one.copy
            placed.append(PlacedPiece(one.piece, copy, axle.wheel, compose(pose, one.pose)))
        for m in wheel.mounts:
            name = f"{m.name} of {axle.wheel}"
            mounts.append(replace(m, name=name, body=axle.wheel, pose=compose(pose, m.pose)))
    wires = list(graph.wires)
    for axle in axles:
        turns = "turns forward above neutral" if axle.direction > 0 else "mirrored: turns forward below neutral"
        wires.append(Wire(f"{design.parts.featherwing.name} channel {axle.channel}", axle.servo, "signal", turns))
    solid = tuple(pieces), tuple(placed), tuple(joins), tuple(mounts)
    hinges = tuple(_hinges(frame, design.parts))
    return with_leads(FoldedCar(*solid, tuple(axles), hinges, tuple(wires), design.parts))


def _frame(design: Design) -> tuple[Graph, Assembly]:
    """The car without its wheels; the error of a user's component names its file and line."""
    try:
        graph = build(Car(design))
        return graph, assemble(graph)
    except ComponentError as error:
        place, message = place_of(error), error.message if error.key else str(error)
        raise DesignError(error.key, f"{message} [{place}]" if place else message) from error
    except Exception as error:
        place = place_of(error)
        if place is None:
            raise
        raise DesignError(None, f"{place}: {type(error).__name__}: {error}") from error


@lru_cache(maxsize=8)
def _wheel(radius_mm: float, tyre_width_mm: float, choices: PartChoices) -> Assembly:
    values = {"radius": radius_mm, "tire_thickness": tyre_width_mm}
    return assemble(build(Wheel(values, body="wheel", parts=chosen(choices))))


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
            pose = compose(placed.pose, folded(piece)[crease.parent.face])
            a, b = (apply(pose, *end) for end in edge(faces, crease.parent))
            x, y, z = ((p + q) / 2 for p, q in zip(a, b, strict=True))
            number = int(placed.body.removeprefix("segment"))
            length = 2 * (max(p[0] for p in faces[crease.parent.face].outline_mm) - parts.assembly.hinge_glue_mm.value)
            width = abs(a[1] - b[1]) + parts.film_mm
            stiffness = stiffness_n_m_rad(width, piece.thickness_mm, length, parts.film)
            bodies, limits = (f"segment{number}", f"segment{number + 1}"), (crease.min_rad, crease.max_rad)
            hinges.append(HingeJoint(*bodies, (x, y, z), stiffness, *limits))
    return sorted(hinges, key=lambda hinge: -hinge.center_mm[0])


# As far as a floor reaches where no tyre limits the place of USB.
FAR_MM = 2000.0
# The fold of a lid's flap beside its latch is at least so long.
LEAST_FOLD_MM = 1.0


def electronics(design: Design) -> int:
    """The index of the module that carries boards and batteries: the first B."""
    return design.modules.index(BrainModule.letter)


def switch_cap(design: Design) -> str:
    """The outer cap that carries the switch: the one nearer to the electronics, but not at their own end."""
    index, last = electronics(design), len(design.modules) - 1
    in_front = index > 0 and (index == last or index <= last - index)
    return "front cap 1" if in_front else f"rear cap {len(design.segments)}"


def around(design: Design, module: int) -> dict[str, float]:
    """What the car sets of a module that is no hinge."""
    known = _flap(design, module)
    if design.modules[module] == WheelModule.letter:
        # No cap is at the inner end of a module that is not a segment of its own.
        alone = len(design.segment_of(module).modules) == 1
        tab = design.parts.assembly.cap_tab_mm.value if alone else 0.0
        known |= {"towards_middle": _towards_middle(design, module), "tab_there": tab}
    if module == electronics(design):
        known |= {"floor_front": _floor(design, module, -1), "floor_rear": _floor(design, module, 1)}
        known |= dict(zip(("usb_low", "usb_high"), _between_tyres(design, module), strict=True))
    return known


def _towards_middle(design: Design, module: int) -> float:
    return -1.0 if design.module_centers_mm[module] > design.segment_of(module).center_mm else 1.0


def _flap(design: Design, module: int) -> dict[str, float]:
    """Where the lid's flap ends on a module; the latches, one at each end of a long segment, and at one the pull tab."""
    segment, length = design.segment_of(module), design.length_of(module)
    end, (notch, _) = flap_end_mm(design.parts), latch_mm(design.parts)
    ends = {"front": segment.modules[0], "rear": segment.modules[-1]}
    long = segment.length_mm - 2 * end > design.parts.assembly.lock_distance_mm.value
    latched = list(ends) if long else [max(ends, key=lambda at: design.length_of(ends[at]))]
    known: dict[str, float] = {}
    for at, outer in ends.items():
        latch = module == outer and at in latched
        known |= {f"flap_{at}": end * (module == outer), f"latch_{at}": float(latch)}
        known |= {f"pull_{at}": float(latch and at == latched[0])}
    least = notch + LEAST_FOLD_MM + end * [*ends.values()].count(module)
    if (known["latch_front"] or known["latch_rear"]) and length < least - ROUNDING:
        key = f"{design.modules[module]}.length"
        raise DesignError(key, f"{length:g} is below the minimum {at_least(least)} (the latch of a segment's lid)")
    return known


def _floor(design: Design, module: int, step: int) -> float:
    """Free floor (mm) before (``step`` -1) or behind (1) a module, up to a servo's layer, a cap's tab or the switch."""
    free, i = 0.0, module + step
    while i in design.segment_of(module).modules:
        if design.modules[i] == WheelModule.letter:
            long, short = inside_mm(design.parts)
            # The long side points forward if ``towards_middle`` is 1.
            return free + design.length_of(i) / 2 - (long if _towards_middle(design, i) == step else short)
        if design.modules[i] != BrainModule.letter:
            return free
        free += design.length_of(i)
        i += step
    cap = f"{'front' if step < 0 else 'rear'} cap {design.segment_at(module) + 1}"
    gap = design.parts.assembly.part_gap_mm.value
    depth = depth_mm(design.parts) + gap if cap == switch_cap(design) else 0.0
    return free - max(design.parts.assembly.cap_tab_mm.value, depth)


def _between_tyres(design: Design, module: int) -> tuple[float, float]:
    """Where a USB plug passes the tyres next to the module (mm from its rear)."""
    rear = design.module_centers_mm[module] - design.length_of(module) / 2
    gap = design.parts.assembly.part_gap_mm.value
    reach = design.values["radius"] + plug_room_mm(design.parts.plugs.usb) / 2 + gap
    off = usb_height_mm(design.parts) - wall_mm(design.values["height"], design.parts) / 2
    need = math.sqrt(max(reach**2 - off**2, 0.0))
    axles = design.axles_mm
    low = max((x + need - rear for x in axles if x < rear), default=-FAR_MM)
    return low, min((x - need - rear for x in axles if x > rear), default=FAR_MM)
