"""The verification of a design: its folded car against the volumes that the design implies, fits, leads, assembly.

Input: a design. Output: findings and measures (see folded/check.py, fits.py, leads.py, assembly/prove.py). A segment
should enclose the box between the middle surfaces of its walls.
"""

from dataclasses import replace

from foldcar.car.assembly_order.prove import prove
from foldcar.car.components.box_beam import wall_mm
from foldcar.car.design import Design
from foldcar.car.fits import check_fits
from foldcar.car.folded.check import Verification, check_design
from foldcar.car.folded_car import folded_car
from foldcar.car.leads import check_leads


def verify(design: Design) -> Verification:
    """All checks of the design's folded car; DesignError if the design cannot be compiled."""
    car = folded_car(design)
    across = wall_mm(design.values["width"], design.parts) * wall_mm(design.values["height"], design.parts)
    volumes = {f"segment{i}": segment.length_mm * across for i, segment in enumerate(design.segments)}
    folded = check_design(car, volumes)
    findings = (*folded.findings, *check_fits(car), *check_leads(car), *prove(car).findings)
    return replace(folded, findings=findings, checked=(*folded.checked, "fits", "leads", "assembly"))
