"""The verification of a design: all checks of its folded car and the proof of its assembly.

Input: a design or a FoldedCar. Output: findings; a car without findings can be built.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from foldcar.car.design import Design
from foldcar.car.fits import check_fits
from foldcar.car.folded.model import FoldedCar
from foldcar.car.folded.placed import Finding, placed_faces
from foldcar.car.folded_car import folded_car
from foldcar.car.proof.check_film import check_film_apart, check_flat, check_joins
from foldcar.car.proof.prove import prove
from foldcar.car.supply import check_supply
from foldcar.errors import FoldcarError


@dataclass(frozen=True)
class Verification:
    """The findings, and a sentence on what was checked."""

    findings: tuple[Finding, ...]
    checked: str


def check_folded_car(car: FoldedCar) -> list[Finding]:
    """Return all findings about a folded car, except those of its assembly."""
    distance_mm = car.parts.assembly.fold_distance_mm.value
    findings = [finding for piece in car.pieces for finding in check_flat(piece, distance_mm)]
    return [*findings, *check_joins(car, placed_faces(car)), *check_film_apart(car), *check_fits(car), *check_supply(car)]


def verify(design: Design) -> Verification:
    """Run all checks of the design's folded car. Raises DesignError if the design cannot be compiled."""
    car = folded_car(design)
    faces = sum(len(piece.faces) * piece.count for piece in car.pieces)
    folds = sum(sum(not crease.bend for crease in piece.creases) * piece.count for piece in car.pieces)
    joins = len({join.number for join in car.joins})
    result = (*check_folded_car(car), *prove(car).findings)
    return Verification(result, f"{faces} faces, {folds} folds and {joins} joins, fits and assembly checked")


class CheckError(FoldcarError):
    """A car that failed its checks; the message names the first finding."""


def raise_on_findings(title: str, findings: Sequence[str]) -> None:
    """Raise CheckError with the first of the findings; without findings return."""
    if findings:
        rest_text = f" (and {len(findings) - 1} more)" if len(findings) > 1 else ""
        raise CheckError(f"{title}: {findings[0]}{rest_text}")
