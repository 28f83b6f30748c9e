"""A car's design: modules in a row from front to back and a value for every parameter.

Input: a type string (``W_B_W``) and parameter values in millimetres by key (``width``, ``W.length``).
Output: an immutable Design; its geometry in millimetres, x forward from the middle of the body box.
"""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

from foldcar.errors import FoldcarError
from foldcar.modules import MODULES, UNSUPPORTED_MODULES, parameters
from foldcar.parts import catalogue

# Wheels are driven one by one by the eight outputs of the servo driver.
MAX_AXLES = 4


class DesignError(FoldcarError):
    """A value that no car can have. ``parameter`` is its key, or None where the type string is at fault."""

    def __init__(self, parameter: str | None, message: str) -> None:
        super().__init__(f"{parameter}: {message}" if parameter else message)
        self.parameter = parameter
        self.message = message


@dataclass(frozen=True, slots=True)
class Design:
    """A car that can be built. ``values`` holds every parameter of its modules, in millimetres."""

    modules: tuple[str, ...]
    values: Mapping[str, float]

    @property
    def type(self) -> str:
        """The type string, front to back."""
        return "_".join(self.modules)

    @property
    def columns(self) -> dict[str, float]:
        """The parameters by their names in results, units in the names."""
        return {parameters()[key].column: value for key, value in self.values.items()}

    @property
    def length_mm(self) -> float:
        """Length of the body box."""
        return sum(self.values[f"{letter}.length"] for letter in self.modules)

    @property
    def module_centers_mm(self) -> tuple[float, ...]:
        """x of each module's middle, front to back."""
        centers = []
        front = self.length_mm / 2
        for letter in self.modules:
            length = self.values[f"{letter}.length"]
            centers.append(front - length / 2)
            front -= length
        return tuple(centers)

    @property
    def axles_mm(self) -> tuple[float, ...]:
        """x of each axle, front to back."""
        return tuple(
            x for letter, x in zip(self.modules, self.module_centers_mm, strict=True) if letter == "W"
        )

    @property
    def track_mm(self) -> float:
        """Distance between the middles of the left and the right tyres."""
        gap = catalogue().assembly.tyre_gap_mm.value
        return self.values["width"] + self.values["W.tire_thickness"] + 2 * gap


def modules_of(type_string: str) -> tuple[str, ...]:
    """The module letters of a type string; DesignError if it is no car."""
    letters = tuple(type_string.split("_"))
    for letter in letters:
        if letter in UNSUPPORTED_MODULES:
            raise DesignError(None, f'"{type_string}" has module {letter}, a {UNSUPPORTED_MODULES[letter]}')
        if letter not in MODULES:
            known = ", ".join(f"{known} ({text})" for known, text in MODULES.items())
            raise DesignError(None, f'"{type_string}" has unknown module "{letter}"; known: {known}')
    for letter in MODULES:
        if letter not in letters:
            raise DesignError(None, f'"{type_string}" has no module {letter} ({MODULES[letter]})')
    if letters.count("W") > MAX_AXLES:
        raise DesignError(
            None, f'"{type_string}" has {letters.count("W")} axles, the servo driver serves {MAX_AXLES}'
        )
    return letters


def compose(type_string: str, values: Mapping[str, float]) -> Design:
    """The design with these values and the defaults of all others; DesignError if it cannot be built."""
    letters = modules_of(type_string)
    complete = {
        key: float(values.get(key, parameter.default))
        for key, parameter in parameters().items()
        if any(letter in letters for letter in parameter.modules)
    }
    for key in values:
        if key not in complete:
            raise DesignError(key, f"{type_string} has no such parameter; it has {', '.join(complete)}")
    design = Design(letters, complete)
    _check_limits(design)
    _check_wheels(design)
    return design


def _check_limits(design: Design) -> None:
    for key, value in design.values.items():
        limits = parameters()[key]
        if not value >= limits.minimum:
            raise DesignError(
                key, f"{value:g} is below the minimum {limits.minimum:g} ({limits.minimum_reason})"
            )
        if not value <= limits.maximum:
            raise DesignError(key, f"{value:g} is above the maximum {limits.maximum:g}")


def _check_wheels(design: Design) -> None:
    """Wheels must not meet their neighbours, and the belly must clear the ground."""
    assembly = catalogue().assembly
    radius = design.values["radius"]
    # Axles stand at mid-height of the body.
    least_radius = design.values["height"] / 2 + assembly.belly_clearance_mm.value
    if radius < least_radius:
        raise DesignError(
            "radius",
            f"{radius:g} is below the minimum {least_radius:g} (half of height {design.values['height']:g} "
            f"and {assembly.belly_clearance_mm.value:g} under the belly)",
        )
    least_distance = 2 * radius + assembly.wheel_distance_mm.value
    axles = design.axles_mm
    for front, rear in itertools.pairwise(axles):
        if front - rear < least_distance:
            raise DesignError(
                "radius",
                f"{radius:g} needs axles at least {least_distance:g} apart, or wheels touch, but "
                f"{_lengths(design)} puts two of them {front - rear:g} apart",
            )


def _lengths(design: Design) -> str:
    return " and ".join(f"{key} {value:g}" for key, value in design.values.items() if key.endswith(".length"))
