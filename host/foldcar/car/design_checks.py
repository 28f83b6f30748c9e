"""Checks of a design beyond the limits of single parameters: alike modules, wheels that touch, a belly on the ground.

Input: a Design. Output: DesignError for the first value at fault.
"""

import cmath
import itertools
import math
from typing import TYPE_CHECKING, NamedTuple

from foldcar.car.components.component import ROUNDING, minimum_text
from foldcar.car.components.hinge_module import HingeModule
from foldcar.car.design_parameters import declared
from foldcar.errors import FoldcarError

if TYPE_CHECKING:
    from foldcar.car.design import Design, ModuleValues


class DesignError(FoldcarError):
    """A design that cannot be built. ``parameter`` is the key of the value at fault, or None for the type string."""

    def __init__(self, parameter: str | None, message: str) -> None:
        super().__init__(f"{parameter}: {message}" if parameter else message)
        self.parameter, self.message = parameter, message


def check_design(type_string: str, design: "Design") -> None:
    """Raise DesignError or ComponentError for a value outside its limits, or values that do not go together."""
    for key, value in design.values.items():
        limit_error = declared(key).limit_error(value, design.parts)
        if limit_error:
            raise DesignError(key, limit_error)
    tyre = design.parts.tyre
    for module in design.wheel_modules:
        # The parameter is the width of the wheel, on which a tyre of a width of its own must have room.
        name = "tire_thickness"
        wheel_width_mm, key_that_sets_it = design.of(module, name), design.of_modules[module].keys.get(name)
        if tyre.width_mm is not None and wheel_width_mm < tyre.width_mm.value:
            too_narrow = f"{wheel_width_mm:g} is below the {tyre.width_mm.value:g} of the {tyre.name}"
            raise DesignError(key_that_sets_it, too_narrow)
    if not design.driven_modules:
        raise DesignError(None, f'"{type_string}" has no driven axle: at least one W needs "driven": true')
    _check_alike(design)
    _check_wheels(design)


def _check_alike(design: "Design") -> None:
    """Raise DesignError if modules differ in uniform parameters: the beams' width and height, the track."""
    first_with: dict[str, ModuleValues] = {}
    for module in design.of_modules:
        for name in (parameter.name for parameter in module.kind.parameters if parameter.uniform):
            reference = first_with.setdefault(name, module)
            value, reference_value = module.values[name], reference.values[name]
            if value != reference_value:
                differs = f"{value:g} differs from the {reference_value:g} of {reference.keys.get(name, name)}"
                raise DesignError(module.keys.get(name), f"{differs}: all modules share one {name}")


class WheelAxle(NamedTuple):
    """An axle: the index of its module, the radius of its wheels (mm), and the design's key that sets the radius."""

    module: int
    radius_mm: float
    key: str | None


def _check_wheels(design: "Design") -> None:
    """Raise DesignError if neighbouring wheels would touch or the belly would touch the ground."""
    axles = []
    for module in design.wheel_modules:
        axles.append(WheelAxle(module, design.of(module, "radius"), design.of_modules[module].keys.get("radius")))
    height, belly = design.height_mm, design.parts.assembly.belly_clearance_mm
    # Axles are at half the body's height.
    min_radius = height / 2 + belly.value
    for axle in axles:
        if axle.radius_mm < min_radius - ROUNDING:
            reason = f"half of height {height:g} and {belly.value:g} under the belly"
            raise DesignError(axle.key, f"{axle.radius_mm:g} is below the minimum {minimum_text(min_radius)} ({reason})")
    for front, rear in itertools.pairwise(axles):
        min_distance = front.radius_mm + rear.radius_mm + design.parts.assembly.wheel_distance_mm.value
        distance = _axle_distance(design, front.module, rear.module)
        if distance.min_mm < min_distance:
            smaller, larger = sorted((front, rear), key=lambda axle: axle.radius_mm)
            message = _touching_message(design, smaller, larger, min_distance, distance)
            raise DesignError(larger.key or smaller.key, message)


def _touching_message(
    design: "Design", smaller: WheelAxle, larger: WheelAxle, min_distance_mm: float, distance: "AxleDistance"
) -> str:
    """Return the message for wheels of two axles that touch: how far apart the axles must be, and how far they are."""
    beside = "" if smaller.radius_mm == larger.radius_mm else f" beside {smaller.radius_mm:g}"
    requirement = f"{larger.radius_mm:g}{beside} needs axles at least {min_distance_mm:g} apart, or wheels touch"
    lengths = " and ".join(f"{key} {value:g}" for key, value in design.values.items() if key.endswith(".length"))
    folded = "" if distance.min_mm == distance.flat_mm else ", folded to the limits of H"
    return f"{requirement}, but {lengths} puts two of them {distance.min_mm:.4g} apart{folded}"


class AxleDistance(NamedTuple):
    """The distance of two axles (mm): the minimum over the limits of the hinges between them, and with flat hinges."""

    min_mm: float
    flat_mm: float


def _axle_distance(design: "Design", front: int, rear: int) -> AxleDistance:
    """Return the distance of the axles of two modules, which are given by their indices.

    The hinges between them are all flat, all at their lower limits or all at their upper limits.
    """
    centers, half_height = design.module_centers_mm, design.height_mm / 2
    hinges = [module for module in range(rear, front, -1) if design.modules[module] == HingeModule.letter]
    flat_mm = centers[front] - centers[rear]
    if not hinges:
        return AxleDistance(min_mm=flat_mm, flat_mm=flat_mm)
    # Seen from the side, points are complex numbers: x is real, z is imaginary. The chain leads from the rear axle over
    # the hinges, which are at the floor, half the body's height below the axles, to the front axle.
    on_floor = [complex(centers[hinge], -half_height) for hinge in hinges]
    chain = [complex(centers[rear], 0.0), *on_floor, complex(centers[front], 0.0)]
    first_step, *steps = (end - start for start, end in itertools.pairwise(chain))

    def distance_mm(direction: int, limit: str) -> float:
        """Return the distance if each hinge turns all steps after it, up (1), down (-1) or not at all (0)."""
        to_front, pitch_rad = first_step, 0.0
        for hinge, step in zip(hinges, steps, strict=True):
            pitch_rad += direction * math.radians(design.of(hinge, limit))
            to_front += step * cmath.rect(1.0, pitch_rad)
        return abs(to_front)

    flat_mm = distance_mm(0, "fold_down")
    return AxleDistance(min(flat_mm, distance_mm(-1, "fold_down"), distance_mm(1, "fold_up")), flat_mm)
