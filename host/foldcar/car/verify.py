"""The verification of a design: all checks of its folded car, the proof of its assembly, and a short report.

Input: a design or a FoldedCar. Output: findings (none, if it can be built) and measures.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from foldcar.car.components.box_beam import wall_mm
from foldcar.car.design import Design
from foldcar.car.fits import check_fits
from foldcar.car.folded.model import FoldedCar
from foldcar.car.folded.placed import Finding, place
from foldcar.car.folded_car import folded_car
from foldcar.car.leads import check_leads
from foldcar.car.proof.check_film import check_crossings, check_flat, check_hinges
from foldcar.car.proof.check_joins import CLOSURE_MM, check_joins, check_skin, skin_of, volume_mm3, worst_gap_mm
from foldcar.car.proof.check_parts import ROUND_MM, check_holes, check_turning, check_wheels, roundness_mm
from foldcar.car.proof.prove import prove


@dataclass(frozen=True)
class Verification:
    """Findings and measures: counts of faces, folds and joins, the widest gap (mm), enclosed volumes by segment (mm³).

    ``roundness_mm`` is the largest deviation of a wheel's circle from its radius.
    """

    findings: tuple[Finding, ...]
    faces: int
    folds: int
    joins: int
    worst_gap_mm: float
    volumes_mm3: Mapping[str, float]
    roundness_mm: float

    def lines(self) -> list[str]:
        """A short report: the measures, then the findings."""
        volumes = ", ".join(f"{body} {volume / 1000:.1f} cm³" for body, volume in self.volumes_mm3.items())
        return [
            f"{self.faces} faces, {self.folds} folds, {self.joins} joins; edges meet within {self.worst_gap_mm:.3f} mm "
            f"(limit {CLOSURE_MM:g})",
            f"enclosed: {volumes}; wheels are round within {self.roundness_mm:.2f} mm (limit {ROUND_MM:g})",
            *(list(map(str, self.findings)) or ["flat, folded, parts, wheels, fits, leads, assembly: nothing found"]),
        ]


def check_design(car: FoldedCar, volumes_mm3: Mapping[str, float] | None = None) -> Verification:
    """Verify a car; ``volumes_mm3`` maps bodies to the volumes they should enclose, where these are known."""
    bodies = place(car)
    assembly = car.parts.assembly
    findings = [finding for piece in car.pieces for finding in check_flat(piece, assembly.fold_distance_mm.value)]
    findings += check_joins(car, bodies)
    findings += check_skin(car, bodies, volumes_mm3 or {})
    for faces in bodies.values():
        findings += check_crossings(faces)
    findings += check_hinges(car, bodies, assembly.wheel_distance_mm.value)
    findings += check_wheels(car, bodies)
    findings += check_holes(car, bodies)
    findings += check_turning(car, bodies, assembly.wheel_distance_mm.value)
    return Verification(
        tuple(findings),
        sum(len(piece.faces) * piece.count for piece in car.pieces),
        sum(sum(not crease.bend for crease in piece.creases) * piece.count for piece in car.pieces),
        len({join.number for join in car.joins}),
        worst_gap_mm(car, bodies),
        {body: volume_mm3(skin_of(car, faces)) for body, faces in bodies.items() if not body.startswith("wheel")},
        roundness_mm(car, bodies),
    )


def verify(design: Design) -> Verification:
    """All checks of the design's folded car; DesignError if the design cannot be compiled.

    A segment should enclose the box between the middle surfaces of its walls.
    """
    car = folded_car(design)
    across = wall_mm(design.values["width"], design.parts) * wall_mm(design.values["height"], design.parts)
    volumes = {f"segment{i}": segment.length_mm * across for i, segment in enumerate(design.segments)}
    folded = check_design(car, volumes)
    return replace(folded, findings=(*folded.findings, *check_fits(car), *check_leads(car), *prove(car).findings))
