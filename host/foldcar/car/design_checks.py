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
        # In spite of its name, this parameter is the width of the wheel. A tyre that is sold in one width must fit on it.
        name = "tire_thickness"
        wheel_width_mm = design.of(module, name)
        if tyre.width_mm is not None and wheel_width_mm < tyre.width_mm.value:
            setting_key = design.of_modules[module].keys.get(name)
            raise DesignError(setting_key, f"{wheel_width_mm:g} is below the {tyre.width_mm.value:g} of the {tyre.name}")
    if not design.driven_modules:
        raise DesignError(None, f'"{type_string}" has no driven axle: at least one W needs "driven": true')
    _check_alike(design)
    _check_wheels(design)


def _check_alike(design: "Design") -> None:
    """Raise DesignError if modules differ in uniform parameters: the beams' width and height, the track."""
    # The first module that has a parameter, by the parameter's name. The others are compared with it.
    first_with: dict[str, ModuleValues] = {}
    for module in design.of_modules:
        for name in (parameter.name for parameter in module.kind.parameters if parameter.uniform):
            reference = first_with.setdefault(name, module)
            value, reference_value = module.values[name], reference.values[name]
            if value != reference_value:
                difference_text = f"{value:g} differs from the {reference_value:g} of {reference.keys.get(name, name)}"
                raise DesignError(module.keys.get(name), f"{difference_text}: all modules share one {name}")


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
    at_limits = "" if distance.min_mm == distance.flat_mm else " when hinge H is at its limit"
    return f"{requirement}; with {lengths} two axles are {distance.min_mm:.4g} apart{at_limits}"


class AxleDistance(NamedTuple):
    """The distance of two axles (mm): the minimum over the limits of the hinges between them, and with flat hinges."""

    min_mm: float
    flat_mm: float


def _axle_distance(design: "Design", front: int, rear: int) -> AxleDistance:
    """Return the distance of the axles of two modules, ``front`` and ``rear``, which are given by their indices.

    Three cases are compared: all hinges between them are flat, all are at their lower limits, or all are at their upper
    limits.
    """
    centers, half_height = design.module_centers_mm, design.height_mm / 2
    # Modules are counted from the front, so these are the hinges from the rear axle to the front axle.
    hinges = [module for module in reversed(range(front, rear)) if design.modules[module] == HingeModule.letter]
    if not hinges:
        distance = centers[front] - centers[rear]
        return AxleDistance(min_mm=distance, flat_mm=distance)
    # Seen from the side, a point (x, z) is the complex number x + i z. The hinges are at the floor, half of the body's
    # height below the axles.
    rear_axle, front_axle = complex(centers[rear], 0.0), complex(centers[front], 0.0)
    hinge_points = [complex(centers[hinge], -half_height) for hinge in hinges]

    def distance_mm(hinge_angles_rad: list[float]) -> float:
        """Return the distance of the axles if each hinge turns everything in front of it by its angle."""
        pitch_rad = 0.0
        rear_to_front = hinge_points[0] - rear_axle
        # From each hinge to the next one, and from the last hinge to the front axle.
        sections = itertools.pairwise((*hinge_points, front_axle))
        for angle_rad, (start, end) in zip(hinge_angles_rad, sections, strict=True):
            pitch_rad += angle_rad
            # The product with this number of length 1 turns a vector by the pitch.
            rear_to_front += (end - start) * cmath.rect(1.0, pitch_rad)
        return abs(rear_to_front)

    flat_mm = distance_mm([0.0 for _ in hinges])
    nose_down_mm = distance_mm([-math.radians(design.of(hinge, "fold_down")) for hinge in hinges])
    nose_up_mm = distance_mm([math.radians(design.of(hinge, "fold_up")) for hinge in hinges])
    return AxleDistance(min_mm=min(flat_mm, nose_down_mm, nose_up_mm), flat_mm=flat_mm)
