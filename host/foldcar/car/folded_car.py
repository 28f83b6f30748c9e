"""The folded car of a design: modules fused to segments, caps on their ends, hinges between them, wheels on servos.

Input: a design. Output: the immutable FoldedCar that every exporter and the simulator's body read. The car gives each
module the settings that depend on other modules: its segment's ends, the floor beside it, the tyres next to it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

from foldcar.car.components.assemble import Assembly, assemble, build
from foldcar.car.components.box_beam import PANELS, flap_end_mm, latch_mm, put_cap, wall_mm
from foldcar.car.components.bridge import plug_room_mm, usb_height_mm
from foldcar.car.components.component import ROUNDING, Component, Sub, minimum_text
from foldcar.car.components.electronics import ElectronicsModule
from foldcar.car.components.hinge_module import HingeModule, stiffness_n_m_rad
from foldcar.car.components.module import BrainModule
from foldcar.car.components.mounts import (
    ROD_LAYER_MM,
    button_depth_mm,
    put_button,
    put_switches,
    servo_reach_mm,
    switch_depth_mm,
)
from foldcar.car.components.shape import Shape
from foldcar.car.components.wheel import Wheel
from foldcar.car.design import HINGE, Design, DesignError, compose_columns
from foldcar.car.design_parameters import places_of
from foldcar.car.folded.model import FoldedCar, HingeJoint, PlacedPiece, Wire
from foldcar.car.folded.pose import apply, compose, edge, folded, rotation, translation
from foldcar.car.folded.stance import center_mm, standing
from foldcar.car.leads import with_extensions
from foldcar.car.parts.catalogue import Catalogue, PartChoices, catalogue_of
from foldcar.car.user_modules import component_errors, forbid_new_files
from foldcar.errors import FoldcarError


class Car(Component):
    """The component of a whole car without its wheels. Its values are those of the design, by key."""

    def __init__(self, design: Design) -> None:
        self.design = design
        self.names = places_of(design.modules)
        super().__init__(design.values, parts=design.parts)

    def subcomponents(self) -> Sequence[Sub]:
        """Return the modules from front to back."""
        subs = []
        for index, module in enumerate(self.design.of_modules):
            kind: type[Component] = ElectronicsModule if index == self.design.electronics else module.kind
            values = dict(module.values)
            if kind is not HingeModule:
                values |= settings_from_car(self.design, index)
            body = f"segment{self.design.segment_at(index)}"
            subs.append(Sub(self.names[index], kind, values, module.keys, body))
        return subs

    def build(self, shape: Shape) -> None:
        """Fuse neighbouring beams, close the segments' ends with caps, glue on the hinges."""
        self._fuse_beams(shape)
        self._put_caps(shape)
        self._put_switches(shape)
        self._join_hinges(shape)
        outer_mm = self.design.width_mm, self.design.height_mm
        # The car's frame: x forwards from the middle of its length, y to the left from its plane of symmetry, z upwards
        # from the middle of its height, where the axles are. The floor's frame starts at the rear right corner of the
        # first (front) module's floor.
        across, up = (wall_mm(size, self.parts) for size in outer_mm)
        rear_of_first = self.design.length_mm / 2 - self.design.length_of(0)
        shape.begin_at(f"{self.names[0]}.beam.floor", translation(rear_of_first, -across / 2, -up / 2))

    def _fuse_beams(self, shape: Shape) -> None:
        """Connect the beams of neighbouring modules rigidly, except where a hinge lies between them."""
        letters = self.design.modules
        for index, (front_module, rear_module) in enumerate(pairwise(self.names)):
            if HINGE in letters[index : index + 2]:
                continue
            for panel in PANELS:
                shape.connect(f"{front_module}.beam.{panel}.rear", f"{rear_module}.beam.{panel}.front", "rigid")

    def _put_caps(self, shape: Shape) -> None:
        """Close both ends of each segment with a cap. The caps at a hinge have a slit for the cables."""
        outer_mm = self.design.width_mm, self.design.height_mm
        last_module = len(self.names) - 1
        for number, segment in enumerate(self.design.segments, 1):
            for end, module, outer_module in (
                ("front", segment.modules[0], 0),
                ("rear", segment.modules[-1], last_module),
            ):
                slit_mm = 0.0 if module == outer_module else self.parts.assembly.cable_slit_length_mm.value
                put_cap(shape, f"{end} cap {number}", end, self.names[module], outer_mm, slit_mm)

    def _put_switches(self, shape: Shape) -> None:
        """Mount the switches in the middle of their cap, and the button, if the car has one, in the other cap."""
        cap = f"{switch_cap(self.design)}.cap"
        width, height = shape.face_size_mm(cap)
        put_switches(shape, cap, (width / 2, height / 2))
        if self.parts.button == "fitted":
            cap = f"{button_cap(self.design)}.cap"
            width, height = shape.face_size_mm(cap)
            put_button(shape, cap, (width / 2, height / 2))

    def _join_hinges(self, shape: Shape) -> None:
        """Glue each hinge under the modules and onto the caps beside it."""
        for index, name in enumerate(self.names):
            hinge = self.children[name]
            if isinstance(hinge, HingeModule):
                # Segments count from 0, from the front; caps from 1.
                front_segment = self.design.segment_at(index)
                caps = (f"rear cap {front_segment + 1}", f"front cap {front_segment + 2}")
                hinge.join(shape, name, (self.names[index - 1], self.names[index + 1]), caps)


def folded_car(design: Design) -> FoldedCar:
    """Return the folded car of a design. Raises DesignError if its parts do not fit."""
    return _folded_car(design.letters, tuple(design.values.items()), design.choices)


def folded_columns(vehicle_type: str, columns: Mapping[str, float | str]) -> FoldedCar | None:
    """Return the folded car whose parameters are given by the columns of results, such as ``{"width_mm": 95}``.

    The result is None if this foldcar cannot fold it, because the file of its components is missing or has changed.
    """
    try:
        return folded_car(compose_columns(vehicle_type, columns))
    except (FoldcarError, ValueError):
        return None


@lru_cache(maxsize=64)
def _folded_car(letters: tuple[str, ...], values: tuple[tuple[str, float], ...], choices: PartChoices) -> FoldedCar:
    design = Design(letters, dict(values), choices)
    with forbid_new_files(), component_errors(DesignError):
        graph = build(Car(design))
        frame = assemble(graph)
    count, axles = len(frame.axles), list(frame.axles)
    # The channels of wheels without servos follow those of the outputs.
    order = sorted(range(count), key=lambda n: not frame.axles[n].driven)
    for channel, n in enumerate(order):
        end, axle = f"axle {n // 2 + 1} ", frame.axles[n]
        if count <= 4:
            end = "" if count <= 2 else ("front ", "rear ")[n // 2]
        servo = f"{end}{axle.side} servo" if axle.driven else ""
        axles[n] = replace(axle, wheel=f"wheel{channel}", servo=servo, channel=channel)
    titles = {local.servo: axle.servo for local, axle in zip(frame.axles, axles, strict=True) if axle.driven}
    mounts = []
    for mount in frame.mounts:
        # Servos and their screws are named by their place in the car.
        servo = next((servo for servo in titles if mount.name.startswith(servo)), "")
        mounts.append(replace(mount, name=titles.get(servo, "") + mount.name.removeprefix(servo)))
    pieces, placed, joins = list(frame.pieces), list(frame.placed), list(frame.joins)
    for values, modules in wheel_units(design).items():
        unit = _unit_title(design, modules)
        wheel = _named(_wheel(values, choices), unit)
        places = [n for n in range(count) if design.wheel_modules[n // 2] in modules]
        pieces += (replace(piece, count=piece.count * len(places)) for piece in wheel.pieces)
        first = max(join.number for join in joins)
        joins += (replace(join, number=first + join.number) for join in wheel.joins)
        counts = {piece.name: piece.count for piece in wheel.pieces}
        for copies, n in enumerate(places):
            axle = axles[n] = replace(axles[n], unit=unit)
            # The wheel is turned by half a turn about z on the right side.
            pose = compose(translation(*axle.center_mm), rotation("z", 0.0 if axle.side == "left" else math.pi))
            for placed_copy in wheel.placed:
                copy = copies * counts[placed_copy.piece] + placed_copy.copy
                placed.append(PlacedPiece(placed_copy.piece, copy, axle.wheel, compose(pose, placed_copy.pose)))
            for m in wheel.mounts:
                name = f"{m.name} of {axle.wheel}"
                mounts.append(replace(m, name=name, body=axle.wheel, pose=compose(pose, m.pose)))
    wires = list(graph.wires)
    for axle in (axle for axle in axles if axle.driven):
        turns = "turns forward above neutral" if axle.direction > 0 else "mirrored: turns forward below neutral"
        wires.append(Wire(f"{design.parts.featherwing.name} channel {axle.channel}", axle.servo, "signal", turns))
    solid = tuple(pieces), tuple(placed), tuple(joins), tuple(mounts)
    hinges = tuple(_hinges(frame, design.parts))
    car = with_extensions(FoldedCar(*solid, tuple(axles), hinges, tuple(wires), design.parts))
    _check_stance(design, car)
    return car


def _check_stance(design: Design, car: FoldedCar) -> None:
    """Raise DesignError if wheels of different radii tilt the body so far that it would touch the ground."""
    if len(set(design.radii_mm)) == 1:
        return
    center_x, _, center_z = center_mm(car)
    half, belly = design.height_mm / 2, design.parts.assembly.belly_clearance_mm.value
    ends = [segment.center_mm + side * segment.length_mm / 2 for segment in design.segments for side in (-1, 1)]

    def is_clear(min_radius_mm: float) -> bool:
        """Return whether the body clears the ground if no wheel is smaller than ``min_radius_mm``."""
        radii = (max(radius, min_radius_mm) for radius in design.radii_mm)
        stance = standing(list(zip(design.axles_mm, radii, strict=True)), (center_x, center_z))
        return all(stance.height_mm(end, -half) >= belly - ROUNDING for end in ends)

    low, high = min(design.radii_mm), max(design.radii_mm)
    # If the body is not clear with equal wheels either, the radii are not the reason: the car tips over its first or last
    # axle.
    if is_clear(low) or not is_clear(high):
        return
    module = min(design.wheel_modules, key=lambda i: design.of(i, "radius"))
    # Bisection: ``high`` is the smallest minimum radius so far with which the body is clear.
    while high - low > STANCE_TOLERANCE_MM:
        middle = (low + high) / 2
        low, high = (low, middle) if is_clear(middle) else (middle, high)
    reason = f"beside {max(design.radii_mm):g}: the tilted body is less than {belly:g} above the ground"
    message = f"{design.of(module, 'radius'):g} is below the minimum {minimum_text(high)} ({reason})"
    raise DesignError(design.of_modules[module].keys.get("radius"), message)


# The values of a wheel by name, which distinguish it from others.
WheelValues = tuple[tuple[str, float], ...]


def wheel_units(design: Design) -> dict[WheelValues, list[int]]:
    """Group the indices of the wheel modules by the values of their wheels."""
    units: dict[WheelValues, list[int]] = {}
    for module in design.wheel_modules:
        values = tuple((parameter.name, design.of(module, parameter.name)) for parameter in Wheel.parameters)
        units.setdefault(values, []).append(module)
    return units


def _unit_title(design: Design, modules: Sequence[int]) -> str:
    """Return the name of the wheels of these modules: ``wheel`` if all are alike, else such as ``rear wheel``."""
    all_modules = design.wheel_modules
    if len(modules) == len(all_modules):
        return "wheel"
    numbers = [all_modules.index(module) + 1 for module in modules]
    if len(all_modules) == 2:
        return ("front wheel", "rear wheel")[numbers[0] - 1]
    return f"axle {' and '.join(map(str, numbers))} wheel"


def _named(wheel: Assembly, unit: str) -> Assembly:
    """Return the pieces and parts of a wheel, with the title of its unit in their names: ``rear wheel hub``."""
    names = {piece.name: unit + piece.name.removeprefix("wheel") for piece in wheel.pieces}
    pieces = (replace(piece, name=names[piece.name], label=names[piece.name]) for piece in wheel.pieces)
    placed = (replace(copy, piece=names[copy.piece]) for copy in wheel.placed)
    joins = (replace(join, piece_a=names[join.piece_a], piece_b=names[join.piece_b]) for join in wheel.joins)
    return replace(wheel, pieces=tuple(pieces), placed=tuple(placed), joins=tuple(joins))


@lru_cache(maxsize=8)
def _wheel(values: WheelValues, choices: PartChoices) -> Assembly:
    return assemble(build(Wheel(dict(values), body="wheel", parts=catalogue_of(choices))))


def _hinges(frame: Assembly, parts: Catalogue) -> list[HingeJoint]:
    """Return the joint of every hinge, front to back. It lies at the middle of the crease, in the car's frame."""
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
            # The strip bends in both halves, from the crease to the glue.
            half_length_mm = max(point[0] for point in faces[crease.parent.face].outline_mm)
            bending_length_mm = 2 * (half_length_mm - parts.assembly.hinge_glue_mm.value)
            width_mm = abs(a[1] - b[1]) + parts.film_mm
            hinges.append(
                HingeJoint(
                    front=f"segment{number}",
                    rear=f"segment{number + 1}",
                    center_mm=(x, y, z),
                    stiffness_n_m_rad=stiffness_n_m_rad(width_mm, piece.thickness_mm, bending_length_mm, parts.film),
                    min_rad=crease.min_rad,
                    max_rad=crease.max_rad,
                )
            )
    return sorted(hinges, key=lambda hinge: -hinge.center_mm[0])


# Tolerance (mm) of the bisection for the minimum radius of a wheel beside larger ones.
STANCE_TOLERANCE_MM = 1e-3
# Limit (mm) of the place of USB on a side without a tyre.
FAR_MM = 2000.0
# Minimum length (mm) of the fold of a lid's flap beside its latch.
MIN_FOLD_MM = 1.0


def switch_cap(design: Design) -> str:
    """Return the name of the cap at an end of the car that carries the switches.

    The cap that is nearer to the electronics gets them. If the electronics are in the first or the last module, there is
    no room at that end, and the cap at the other end gets the switches.
    """
    electronics, last = design.electronics, len(design.modules) - 1
    is_nearer_to_front = electronics <= last - electronics
    in_front = electronics > 0 and (electronics == last or is_nearer_to_front)
    return "front cap 1" if in_front else f"rear cap {len(design.segments)}"


def button_cap(design: Design) -> str:
    """Return the name of the outer cap that carries the button, if the car has one: the cap without switches."""
    return f"rear cap {len(design.segments)}" if switch_cap(design).startswith("front") else "front cap 1"


def _depth_behind_mm(design: Design, cap: str) -> float:
    """Return how far (mm) switches or the button reach into the car behind a cap; 0 if the cap has none of them."""
    if cap == switch_cap(design):
        return switch_depth_mm(design.parts)
    if cap == button_cap(design) and design.parts.button == "fitted":
        return button_depth_mm(design.parts)
    return 0.0


def settings_from_car(design: Design, module: int) -> dict[str, float]:
    """Return the values that a module gets from its place in the car, by name; the module is not a hinge."""
    settings = _flap_settings(design, module)
    if module in design.wheel_modules:
        # Only a module that is a segment of its own has a cap at its inner end.
        alone = len(design.segment_of(module).modules) == 1
        tab = design.parts.assembly.cap_tab_mm.value if alone else 0.0
        segment = design.segment_of(module).modules
        outer = {
            f"front cap {design.segment_at(module) + 1}": segment[0],
            f"rear cap {design.segment_at(module) + 1}": segment[-1],
        }
        depth = switch_depth_mm(design.parts) if outer.get(switch_cap(design)) == module else 0.0
        settings |= {"towards_middle": _towards_middle(design, module), "tab_depth": tab, "switch_depth": depth}
    if module == design.electronics:
        settings |= {"floor_front": _free_floor_mm(design, module, -1), "floor_rear": _free_floor_mm(design, module, 1)}
        settings |= dict(zip(("usb_low", "usb_high"), _between_tyres(design, module), strict=True))
    return settings


def _towards_middle(design: Design, module: int) -> float:
    """Return 1 if the middle of its segment lies in front of the module's middle, else -1."""
    return -1.0 if design.module_centers_mm[module] > design.segment_of(module).center_mm else 1.0


def _flap_settings(design: Design, module: int) -> dict[str, float]:
    """Return the settings of a module's flap: ``flap_END`` (mm), ``latch_END`` and ``pull_END`` (0 or 1) of both ends.

    If the segment ends with a cap at that end, the flap stops ``flap_END`` before it; elsewhere ``flap_END`` is 0. A
    long segment has a latch at each end, a short one has a latch at the end with the longer module. One latch has the
    pull tab.
    """
    segment, length = design.segment_of(module), design.length_of(module)
    flap_end, (notch, _) = flap_end_mm(design.parts), latch_mm(design.parts)
    ends = {"front": segment.modules[0], "rear": segment.modules[-1]}
    is_long = segment.length_mm - 2 * flap_end > design.parts.assembly.lock_distance_mm.value
    latched_ends = list(ends) if is_long else [max(ends, key=lambda end: design.length_of(ends[end]))]
    settings: dict[str, float] = {}
    for end, end_module in ends.items():
        is_at_end = module == end_module
        has_latch = is_at_end and end in latched_ends
        settings[f"flap_{end}"] = flap_end if is_at_end else 0.0
        settings[f"latch_{end}"] = float(has_latch)
        settings[f"pull_{end}"] = float(has_latch and end == latched_ends[0])
    # A segment of a single module has caps at both ends of this module.
    min_length = notch + MIN_FOLD_MM + settings["flap_front"] + settings["flap_rear"]
    if (settings["latch_front"] or settings["latch_rear"]) and length < min_length - ROUNDING:
        key = design.of_modules[module].keys.get("length")
        reason = "the latch of a segment's lid"
        raise DesignError(key, f"{length:g} is below the minimum {minimum_text(min_length)} ({reason})")
    return settings


def _free_floor_mm(design: Design, module: int, step: int) -> float:
    """Return how much floor (mm) is free before (``step`` -1) or behind (``step`` 1) a module.

    It ends at a servo, at the tab of a cap, or at a switch.
    """
    free_mm, i = 0.0, module + step
    while i in design.segment_of(module).modules:
        if i in design.wheel_modules:
            driven = design.of(i, "driven")
            long_reach, short_reach = servo_reach_mm(design.parts) if driven else (ROD_LAYER_MM, ROD_LAYER_MM)
            # A servo's long side points forward if `_towards_middle` is 1. If that is the direction to this module, the
            # long side reaches towards it.
            reach = long_reach if _towards_middle(design, i) == step else short_reach
            return free_mm + design.length_of(i) / 2 - reach
        if design.modules[i] != BrainModule.letter:
            return free_mm
        free_mm += design.length_of(i)
        i += step
    cap = f"{'front' if step < 0 else 'rear'} cap {design.segment_at(module) + 1}"
    gap = design.parts.assembly.part_gap_mm.value
    return free_mm - max(design.parts.assembly.cap_tab_mm.value, _depth_behind_mm(design, cap) + gap)


def _between_tyres(design: Design, module: int) -> tuple[float, float]:
    """Return the range of x (mm from the rear of the module) in which a USB plug does not touch the tyres beside it.

    Seen from the side, plug and tyre are circles, which must be a gap apart.
    """
    rear = design.module_centers_mm[module] - design.length_of(module) / 2
    gap = design.parts.assembly.part_gap_mm.value
    # Height of the plug over the axles.
    usb_offset_mm = usb_height_mm(design.parts) - wall_mm(design.height_mm, design.parts) / 2
    low, high = -FAR_MM, FAR_MM
    for x, radius in zip(design.axles_mm, design.radii_mm, strict=True):
        reach = radius + plug_room_mm(design.parts.plugs.usb) / 2 + gap
        min_offset = math.sqrt(max(reach**2 - usb_offset_mm**2, 0.0))
        if x < rear:
            low = max(low, x + min_offset - rear)
        elif x > rear:
            high = min(high, x - min_offset - rear)
    return low, high
