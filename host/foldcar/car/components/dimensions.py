"""The parameters that the whole car shares, and the minimums that follow from a servo in a wall."""

from foldcar.car.components.bridge import mouth_mm, span_mm, stack_height_mm
from foldcar.car.components.mounts import least_doubler_mm, screw_end_mm
from foldcar.car.components.parameter import Parameter
from foldcar.car.components.wheel_size import least_radius_mm
from foldcar.car.parts.catalogue import Catalogue


def servo_reach_mm(parts: Catalogue) -> float:
    """Distance along the wall from the axis to the far edge of the screw hole on the servo's long side (mm)."""
    servo = parts.servo
    return servo.length_mm.value / 2 - servo.axis_from_end_mm.value + screw_end_mm(parts)


def _least_height(parts: Catalogue) -> float:
    film, assembly = parts.film.thickness_mm.value, parts.assembly
    boards = stack_height_mm(parts) + film / 2
    # A servo's layer in the middle of the right wall ends below the lid's flap.
    beside_flap = least_doubler_mm(parts) + 2 * (assembly.flap_mm.value + film + assembly.slot_clearance_mm.value)
    return max(boards, beside_flap) + film


def _least_width(parts: Catalogue) -> float:
    assembly, film = parts.assembly, parts.film.thickness_mm.value
    _, right = span_mm(parts)
    # The lid's flap goes down between the boards and the right wall.
    beside = max(assembly.bridge_gap_mm.value, assembly.flap_gap_mm.value + film)
    boards = assembly.usb_inside_mm.value + mouth_mm(parts) + right + beside
    return max(boards, 2 * parts.servo.ear_underside_mm.value) + 2 * film


def _least_wheel_module(parts: Catalogue) -> float:
    return 2 * (servo_reach_mm(parts) + parts.assembly.fold_distance_mm.value)


WIDTH = Parameter(
    "width", 95, _least_width, 500,
    "outer width of the body", "the boards across it", shared=True,
)  # fmt: skip
HEIGHT = Parameter(
    "height", 50, _least_height, 200, "outer height of the body; axles stand at half of it",
    "the boards and their plugs over the LiPo", shared=True,
)  # fmt: skip
RADIUS = Parameter(
    "radius", 60, least_radius_mm, 150, "rolling radius of the wheels, tyre included",
    "a hub between whose walls a driver reaches the horn's screws, and a rim", shared=True,
)  # fmt: skip
WHEEL_MODULE_LENGTH = Parameter(
    "length", 60, _least_wheel_module, 400, "length of a wheel module, its axle in the middle",
    "the opening and screws of one servo",
)  # fmt: skip
