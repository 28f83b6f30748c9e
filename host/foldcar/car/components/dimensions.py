"""The parameters that the whole car shares, and the minimums that follow from a servo in a wall."""

from foldcar.car.compiler.parameter import Parameter
from foldcar.car.parts.catalogue import Catalogue


def servo_reach_mm(parts: Catalogue) -> float:
    """Distance along the wall from the axis to the far edge of the screw hole on the servo's long side (mm)."""
    servo = parts.servo
    middle = servo.length_mm.value / 2 - servo.axis_from_end_mm.value
    return middle + (servo.screw_spacing_mm.value + parts.assembly.screw_hole_mm.value) / 2


def _least_height(parts: Catalogue) -> float:
    edge = parts.assembly.opening_clearance_mm.value + parts.assembly.fold_distance_mm.value
    return parts.servo.width_mm.value + 2 * edge + parts.film.thickness_mm.value


def _least_wheel_module(parts: Catalogue) -> float:
    return 2 * (servo_reach_mm(parts) + parts.assembly.fold_distance_mm.value)


WIDTH = Parameter(
    "width", 95, lambda parts: 2 * (parts.servo.ear_underside_mm.value + parts.film.thickness_mm.value), 500,
    "outer width of the body", "two servos tail to tail between its walls", shared=True,
)  # fmt: skip
HEIGHT = Parameter(
    "height", 50, _least_height, 200, "outer height of the body; axles stand at half of it",
    "the opening of one servo and film to the folds", shared=True,
)  # fmt: skip
RADIUS = Parameter("radius", 60, 13, 150, "wheel radius", "the servo's horn and a rim", shared=True)
WHEEL_MODULE_LENGTH = Parameter(
    "length", 60, _least_wheel_module, 400, "length of a wheel module, its axle in the middle",
    "the opening and screws of one servo",
)  # fmt: skip
