"""What a Webots car does: the controller's program, and the drive of one car for it.

Input: a body of docs/carsim.md and the firmware's pulses. Output: texts of files.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from foldcar.models.servo import drive_fraction
from foldcar.models.wheel_geometry import wheel_name
from foldcar.simulation.carsim import PulseTrain

# Webots starts controllers/NAME/NAME.py.
CONTROLLER = "foldcar_pulses"


def controller_program() -> str:
    """The controller's source, the same for every car."""
    return (Path(__file__).parent / f"{CONTROLLER}.py").read_text(encoding="utf-8")


def controller_drive(body: Mapping[str, Any], pulses: PulseTrain, settling_s: float) -> str:
    """The drive of a car that stands for ``settling_s`` first, as the controller reads it; fractions to 1e-6."""
    rows: list[list[float | None]] = []
    for t_s, widths in zip(pulses.times_s, pulses.widths_us, strict=True):
        fractions = [drive_fraction(wheel["servo"], widths[wheel["channel"]]) for wheel in body["wheels"]]
        row = [None if fraction is None else round(fraction, 6) for fraction in fractions]
        if not rows or rows[-1][1:] != row:
            rows.append([round(t_s, 6), *row])
    motors = [f"{wheel_name(wheel)} servo" for wheel in body["wheels"]]
    lines = ",\n  ".join(json.dumps(row) for row in rows)
    head = f'"settling_s": {json.dumps(settling_s)},\n "motors": {json.dumps(motors)}'
    return f'{{{head},\n "changes": [\n  {lines}]}}\n'
