"""The verification of a design: all checks of its folded car and the proof of its assembly.

Input: a design or a FoldedCar. Output: findings (none, if it can be built).
"""

from dataclasses import dataclass

from foldcar.car.design import Design
from foldcar.car.fits import check_fits
from foldcar.car.folded.model import FoldedCar
from foldcar.car.folded.placed import Finding, place
from foldcar.car.folded_car import folded_car
from foldcar.car.proof.check_clear import check_film_apart, check_turning
from foldcar.car.proof.check_film import check_flat, check_joins
from foldcar.car.proof.prove import prove


@dataclass(frozen=True)
class Verification:
    """Findings, and how much was checked."""

    findings: tuple[Finding, ...]
    checked: str

    def lines(self) -> list[str]:
        """A short report."""
        found = list(map(str, self.findings)) or ["film, joins, wheels, fits, assembly: nothing found"]
        return [self.checked, *found]


def check_design(car: FoldedCar) -> list[Finding]:
    """All findings about a folded car but those of its assembly."""
    bodies = place(car)
    findings = [found for piece in car.pieces for found in check_flat(piece, car.parts.assembly.fold_distance_mm.value)]
    findings += [*check_joins(car, bodies), *check_film_apart(car), *check_turning(car, bodies)]
    return [*findings, *check_fits(car)]


def verify(design: Design) -> Verification:
    """All checks of the design's folded car; DesignError if the design cannot be compiled."""
    car = folded_car(design)
    faces = sum(len(piece.faces) * piece.count for piece in car.pieces)
    folds = sum(sum(not crease.bend for crease in piece.creases) * piece.count for piece in car.pieces)
    joins = len({join.number for join in car.joins})
    found = (*check_design(car), *prove(car).findings)
    return Verification(found, f"{faces} faces, {folds} folds, {joins} joins")
