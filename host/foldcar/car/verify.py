"""The verification of a design: its folded car against the volumes that the design implies.

Input: a design. Output: findings and measures (see folded/check.py). A segment should enclose the box between the
middle surfaces of its walls, a wheel the prism over the polygon of its discs.
"""

import math

from foldcar.car.components.box_beam import wall_mm
from foldcar.car.design import Design
from foldcar.car.folded.check import Verification, check_design
from foldcar.car.folded_car import folded_car


def verify(design: Design) -> Verification:
    """All checks of the design's folded car; DesignError if the design cannot be compiled."""
    car = folded_car(design)
    across = wall_mm(design.values["width"]) * wall_mm(design.values["height"])
    volumes = {f"segment{i}": segment.length_mm * across for i, segment in enumerate(design.segments)}
    corners = next(len(piece.faces[0].outline_mm) for piece in car.pieces if piece.name == "wheel inner disc")
    disc_mm2 = design.values["radius"] ** 2 * math.sin(2 * math.pi / corners) * corners / 2
    volumes["wheel0"] = disc_mm2 * design.values["W.tire_thickness"]
    return check_design(car, volumes)
