"""The folded car of a design: modules fused to segments, caps on their ends, hinges between them, wheels on servos.

Input: a design. Output: the immutable FoldedCar that every exporter and the simulator's body read. The car gives each
module the settings that depend on other modules (module_settings.py).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

from foldcar.car.components.assemble import Assembly, assemble, build
from foldcar.car.components.box_beam import PANELS, put_cap, wall_distance_mm
from foldcar.car.components.component import ROUNDING, Component, Sub, minimum_text
from foldcar.car.components.electronics import ElectronicsModule
from foldcar.car.components.hinge_module import HingeModule, stiffness_n_m_rad
from foldcar.car.components.mounts import (
    put_button,
    put_switches,
)
from foldcar.car.components.shape import Shape
from foldcar.car.components.wheel import Wheel
from foldcar.car.design import HINGE, Design, DesignError, compose_columns
from foldcar.car.design_parameters import places_of
from foldcar.car.extensions import with_extensions
from foldcar.car.folded.model import Crease, FoldedCar, HingeJoint, Piece, PlacedPiece, Wire
from foldcar.car.folded.pose import apply, compose, edge, folded, rotation, translation
from foldcar.car.folded.stance import center_mm, standing
from foldcar.car.module_settings import button_cap, settings_from_car, switch_cap
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
        """Return the car's modules from front to back, each with its name, its kind and the values of its parameters.

        The module with the electronics is of a kind of its own. A hinge takes no settings from the car.
        """
        modules = []
        for index, module in enumerate(self.design.of_modules):
            kind: type[Component] = ElectronicsModule if index == self.design.electronics else module.kind
            values = dict(module.values)
            if kind is not HingeModule:
                values |= settings_from_car(self.design, index)
            # A *segment* is a rigid part of the car, between hinges.
            body = f"segment{self.design.segment_at(index)}"
            modules.append(Sub(name=self.names[index], kind=kind, values=values, keys=module.keys, body=body))
        return modules

    def build(self, shape: Shape) -> None:
        """Connect the modules to segments, close the ends of the segments with caps, and join the segments by hinges."""
        self._fuse_beams(shape)
        self._put_caps(shape)
        self._put_switches(shape)
        self._join_hinges(shape)
        # The origin of the car's frame is the middle of its length, width and height. x points forward, y to the left and
        # z up. The floor of the first module, at the front, has its own origin at its rear right corner. This is the pose
        # of that floor in the car's frame.
        right_to_left_wall = wall_distance_mm(self.design.width_mm, self.parts)
        floor_to_lid = wall_distance_mm(self.design.height_mm, self.parts)
        rear_of_first = self.design.length_mm / 2 - self.design.length_of(0)
        floor_pose = translation(rear_of_first, -right_to_left_wall / 2, -floor_to_lid / 2)
        shape.begin_at(f"{self.names[0]}.beam.floor", floor_pose)

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
        for number, segment in enumerate(self.design.segments, 1):
            self._put_cap(shape, "front", number, segment.modules[0], is_at_hinge=number > 1)
            self._put_cap(shape, "rear", number, segment.modules[-1], is_at_hinge=number < len(self.design.segments))

    def _put_cap(self, shape: Shape, end: str, segment_number: int, module: int, is_at_hinge: bool) -> None:
        """Close the ``front`` or the ``rear`` end of a segment, which is an end of the module with this index."""
        outer_mm = self.design.width_mm, self.design.height_mm
        slit_mm = self.parts.assembly.cable_slit_length_mm.value if is_at_hinge else 0.0
        put_cap(shape, f"{end} cap {segment_number}", end, self.names[module], outer_mm, slit_mm)

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
        """Glue each hinge under the modules in front of it and behind it, and its stop onto the cap in front of it."""
        # A hinge is never at an end of the car.
        for index in range(1, len(self.names) - 1):
            name = self.names[index]
            hinge = self.children[name]
            if isinstance(hinge, HingeModule):
                front_module, rear_module = self.names[index - 1], self.names[index + 1]
                # Segments count from 0, caps from 1.
                front_cap = f"rear cap {self.design.segment_at(index) + 1}"
                hinge.join(shape, name, front_module=front_module, rear_module=rear_module, front_cap=front_cap)


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
    """Raise DesignError if wheels of different radii tilt the body so far that it is too near to the ground."""
    smallest, largest = min(design.radii_mm), max(design.radii_mm)
    if smallest == largest:
        return
    center_x, _, center_z = center_mm(car)
    half, belly = design.height_mm / 2, design.parts.assembly.belly_clearance_mm.value
    ends = [segment.center_mm + side * segment.length_mm / 2 for segment in design.segments for side in (-1, 1)]

    def is_clear(min_radius_mm: float) -> bool:
        """Return whether the body clears the ground if all smaller wheels are replaced by wheels of this radius."""
        radii = [max(radius, min_radius_mm) for radius in design.radii_mm]
        wheels = list(zip(design.axles_mm, radii, strict=True))
        stance = standing(wheels, (center_x, center_z))
        return all(stance.height_mm(end, -half) >= belly - ROUNDING for end in ends)

    # A car that tips over its first or last axle touches the ground even on wheels that are all as large as the largest.
    # This is not an error of the radii.
    if is_clear(smallest) or not is_clear(largest):
        return
    min_radius_mm = _smallest_that_satisfies(is_clear, smallest, largest)
    module = min(design.wheel_modules, key=lambda i: design.of(i, "radius"))
    reason = f"beside {largest:g}: the tilted body is less than {belly:g} above the ground"
    message = f"{design.of(module, 'radius'):g} is below the minimum {minimum_text(min_radius_mm)} ({reason})"
    raise DesignError(design.of_modules[module].keys.get("radius"), message)


def _smallest_that_satisfies(condition: Callable[[float], bool], low: float, high: float) -> float:
    """Return the smallest radius (mm) that satisfies a condition, found by bisection to STANCE_TOLERANCE_MM.

    ``low`` does not satisfy the condition, and ``high`` does.
    """
    while high - low > STANCE_TOLERANCE_MM:
        middle = (low + high) / 2
        if condition(middle):
            high = middle
        else:
            low = middle
    return high


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
    """Return the joint of every hinge, front to back."""
    pieces = {piece.name: piece for piece in frame.pieces}
    hinges = []
    for placed in frame.placed:
        for crease in pieces[placed.piece].creases:
            if crease.flexure:
                hinges.append(_hinge(pieces[placed.piece], placed, crease, parts))
    return sorted(hinges, key=lambda hinge: -hinge.center_mm[0])


def _hinge(strip: Piece, placed: PlacedPiece, crease: Crease, parts: Catalogue) -> HingeJoint:
    """Return the joint that the strip of a hinge makes between the segments before and behind it.

    ``crease`` is the line across the car at which the strip's two halves meet, and the joint is at its middle. The joint
    is given in the car's frame.
    """
    faces = {face.name: face for face in strip.faces}
    front_half = crease.parent.face
    # The ends and the middle of the crease in the car.
    pose = compose(placed.pose, folded(strip)[front_half])
    start, end = (apply(pose, *point) for point in edge(faces, crease.parent))
    x, y, z = ((from_start + from_end) / 2 for from_start, from_end in zip(start, end, strict=True))
    # In the frame of a half, x runs along it from 0. The strip bends in both halves, from the crease to where it is
    # glued.
    half_length_mm = max(point_x for point_x, _ in faces[front_half].outline_mm)
    bending_length_mm = 2 * (half_length_mm - parts.assembly.hinge_glue_mm.value)
    # The crease runs along y. The strip is as wide as the floor from outside to outside, one film more than the face.
    crease_length_mm = abs(start[1] - end[1])
    width_mm = crease_length_mm + parts.film_mm
    number = int(placed.body.removeprefix("segment"))
    return HingeJoint(
        front=f"segment{number}",
        rear=f"segment{number + 1}",
        center_mm=(x, y, z),
        stiffness_n_m_rad=stiffness_n_m_rad(width_mm, strip.thickness_mm, bending_length_mm, parts.film),
        min_rad=crease.min_rad,
        max_rad=crease.max_rad,
    )


# Tolerance (mm) of the bisection for the minimum radius of a wheel beside larger ones.
STANCE_TOLERANCE_MM = 1e-3
