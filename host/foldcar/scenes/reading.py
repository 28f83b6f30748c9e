"""Reads numbers and poses from the objects of a sampled Scenic scene.

Input: Scenic objects. Output: finite, rounded numbers in m and rad. Scenic's headings (0 along +y) are converted to the
simulator's (0 along +x) here and nowhere else.
"""

import math
from collections.abc import Mapping
from typing import Any

# Scenes are hashed and compared as text; rounding removes the last bits, in which machines may differ.
DECIMALS = 9
# The interval at which Scenic looks at a simulation.
OUTER_STEP_S = 0.25
OUTER_STEP_LIMITS_S = (1 / 240, 60.0)


class UnusableError(Exception):
    """A scene that the simulator cannot represent; ``thing`` is the Scenic object at fault, or None."""

    def __init__(self, message: str, thing: Any = None) -> None:
        super().__init__(message if thing is None else f"{_name(thing)}: {message}")
        self.thing = thing


def is_a(thing: Any, kind: str) -> bool:
    """Whether an object is an instance of model.scenic's class ``kind``."""
    return any(ancestor.__name__ == kind for ancestor in type(thing).__mro__)


def finite(name: str, value: Any, thing: Any = None) -> float:
    """Return ``value`` as a rounded float. Raises UnusableError if it is not a finite number.

    The error names the value by ``name``. ``thing`` is the object of the Scenic program that has the value; the error
    then also names its line.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise UnusableError(f"{name}: {value} is not a number", thing) from None
    if not math.isfinite(number):
        raise UnusableError(f"{name}: {number} is not finite", thing)
    return rounded(number)


def rounded(value: float) -> float:
    """Round the value to DECIMALS digits; never -0.0."""
    return round(value, DECIMALS) + 0.0


def pose(thing: Any) -> dict[str, float]:
    """Return position (``x_m``, ``y_m``) and heading (rad, from +x counter-clockwise, ±π) in the simulator's frame."""
    # Scenic's heading counts from +y.
    heading_rad = math.remainder(finite("heading", thing.heading, thing) + math.pi / 2, 2 * math.pi)
    return {
        "x_m": finite("x", thing.position.x, thing),
        "y_m": finite("y", thing.position.y, thing),
        "heading_rad": rounded(heading_rad),
    }


def param(scene: Any, name: str) -> float:
    """Return a parameter that model.scenic declares. Raises UnusableError if it is missing or not a finite number."""
    if name not in scene.params:
        raise UnusableError(f"param {name} is missing: the program must begin with `model model`")
    return finite(f"param {name}", scene.params[name])


def _name(thing: Any) -> str:
    """Return what messages call an object: its class and position, such as "Ramp at (1.2, 0)"."""
    coordinates = []
    for coordinate in (thing.position.x, thing.position.y):
        # An object that is not sampled yet may have a random position.
        is_number = isinstance(coordinate, int | float)
        coordinates.append(f"{coordinate:.4g}" if is_number else str(coordinate))
    x, y = coordinates
    return f"{type(thing).__name__} at ({x}, {y})"


def outer_step_s(params: Mapping[str, Any], override_s: float | None = None) -> float:
    """Return the interval (s) at which Scenic is called during a simulation, for its behaviors and monitors.

    If ``override_s`` is None, it is the program's ``param timestep`` (Scenic's name for it) or, without such a parameter,
    ``param outer_step_s``. Raises UnusableError if it is not a number or beyond the limits.
    """
    name = "timestep" if "timestep" in params else "outer_step_s"
    value = params.get(name, OUTER_STEP_S) if override_s is None else override_s
    low, high = OUTER_STEP_LIMITS_S
    try:
        step_s = float(value)
    except (TypeError, ValueError):
        raise UnusableError(f"param {name}: {value} is not a number") from None
    # A nanosecond of tolerance, because 1/240 s is no finite decimal number.
    if not low - 1e-9 <= step_s <= high:
        raise UnusableError(f"param {name}: {value} is not within {low:.4g} to {high:g} s")
    return step_s
