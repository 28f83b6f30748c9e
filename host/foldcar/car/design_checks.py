"""Checks of a design beyond the limits of single parameters: alike modules, wheels that touch, a belly on the ground.

Input: a Design. Output: DesignError for the first value at fault.
"""

import cmath
import itertools
import math
from typing import TYPE_CHECKING

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
        width_mm, setting = design.of(module, "tire_thickness"), design.of_modules[module].keys.get("tire_thickness")
        if tyre.width_mm is not None and width_mm < tyre.width_mm.value:
            raise DesignError(setting, f"{width_mm:g} is below the {tyre.width_mm.value:g} of the {tyre.name}")
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


def _check_wheels(design: "Design") -> None:
    """Raise DesignError if neighbouring wheels would touch or the belly would touch the ground."""
    height, belly = design.height_mm, design.parts.assembly.belly_clearance_mm
    # Axles are at half the body's height.
    min_radius = height / 2 + belly.value
    # The wheels' radius, the key that sets it, and the module's index.
    axles = [(design.of(i, "radius"), design.of_modules[i].keys.get("radius"), i) for i in design.wheel_modules]
    for radius, key, _ in axles:
        if radius < min_radius - ROUNDING:
            reason = f"half of height {height:g} and {belly.value:g} under the belly"
            raise DesignError(key, f"{radius:g} is below the minimum {minimum_text(min_radius)} ({reason})")
    for front, rear in itertools.pairwise(axles):
        (front_radius, _, front_module), (rear_radius, _, rear_module) = front, rear
        min_distance = front_radius + rear_radius + design.parts.assembly.wheel_distance_mm.value
        distance, flat = _folded_distance_mm(design, front_module, rear_module)
        if distance < min_distance:
            folded = "" if distance == flat else ", folded to the limits of H"
            lengths = " and ".join(f"{key} {value:g}" for key, value in design.values.items() if key.endswith(".length"))
            (smaller_radius, smaller_key, _), (radius, key, _) = sorted((front, rear), key=lambda axle: axle[0])
            beside = "" if smaller_radius == radius else f" beside {smaller_radius:g}"
            requirement = f"{radius:g}{beside} needs axles at least {min_distance:g} apart, or wheels touch"
            message = f"{requirement}, but {lengths} puts two of them {distance:.4g} apart{folded}"
            raise DesignError(key or smaller_key, message)


def _folded_distance_mm(design: "Design", front: int, rear: int) -> tuple[float, float]:
    """Return the minimum distance (mm) of two modules' axles over the limits of the hinges between, and that when flat.

    The chain from axle over hinges to axle is a sum of complex numbers: x is real, z imaginary, and each hinge turns all
    steps after it. All hinges are flat, at their lower or at their upper limits. They are at the floor, half the body's
    height below the axles.
    """
    centers, hinges = design.module_centers_mm, [i for i in range(front, rear) if design.modules[i] == HingeModule.letter]
    flat = centers[front] - centers[rear]
    if not hinges:
        return flat, flat
    # The chain begins at the rear axle.
    hinges.reverse()
    half_height, xs = design.height_mm / 2, [centers[i] for i in (rear, *hinges, front)]
    rises = [-half_height, *[0.0] * (len(hinges) - 1), half_height]
    steps = [complex(end - start, rise) for (start, end), rise in zip(itertools.pairwise(xs), rises, strict=True)]
    distances = []
    # Flat, folded down, folded up.
    for sign, name in ((0, "fold_down"), (-1, "fold_down"), (1, "fold_up")):
        pitches = itertools.accumulate((sign * math.radians(design.of(i, name)) for i in hinges), initial=0.0)
        distances.append(abs(sum(step * cmath.rect(1.0, pitch) for step, pitch in zip(steps, pitches, strict=True))))
    return min(distances), distances[0]
