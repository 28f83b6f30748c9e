"""What a pulse asks of a servo (docs/carsim.md, ``servo``)."""

import math
from collections.abc import Mapping


def drive_fraction(servo: Mapping[str, float], pulse_us: float) -> float | None:
    """The fraction of full speed, positive forward; None without a pulse, when the motor gives no torque."""
    if pulse_us <= 0:
        return None
    offset_us = servo["direction"] * (pulse_us - servo["neutral_us"])
    excess_us = abs(offset_us) - servo["deadband_us"]
    if excess_us <= 0:
        return 0.0
    return math.copysign(min(1.0, excess_us / (servo["saturation_us"] - servo["deadband_us"])), offset_us)
