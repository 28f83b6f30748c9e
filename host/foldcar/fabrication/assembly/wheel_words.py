"""The instructions for a wheel: its hub's and rim's hooks, which end of a strip lies on top, its tyre.

Input: an AssemblyStep. Output: lines of text.
"""

import math
from collections.abc import Iterator

from foldcar.car.components.hooked_strip import turn_rad
from foldcar.car.components.wheel_size import WheelSize
from foldcar.car.folded.model import FoldedCar, Join
from foldcar.car.proof.step import AssemblyStep
from foldcar.fabrication.assembly.insertion_words import join_words, number_ranges
from foldcar.fabrication.assembly.operations import disc_turns, is_wound


def is_rim_lock(car: FoldedCar, join: Join) -> bool:
    """Return whether a join is a lock of a strip that is wound around a wheel."""
    return join.kind == "lock" and is_wound(next(piece for piece in car.pieces if piece.name == join.piece_a))


def wheel_join_lines(car: FoldedCar, step: AssemblyStep) -> Iterator[str]:
    """Yield the instructions for the joins of a wheel.

    A wheel has two discs on a hub, and a rim, which is a strip of film around the discs. The hooks of the hub go into
    slots of a disc, the hooks of the rim into notches of both discs, and the tongues at the ends of strips into slots.
    """
    joins = [join for join in car.joins if join.number in step.joins]
    labels = {piece.name: piece.label for piece in car.pieces}
    axle_of_piece = {placed.piece: axle for axle in car.axles for placed in car.placed if placed.body == axle.wheel}
    for join in disc_turns(car, step):
        # The second piece of such a join is the disc.
        axle = axle_of_piece[join.piece_b]
        angle_deg = math.degrees(turn_rad(WheelSize(axle.radius_mm, axle.tyre_width_mm, car.parts)))
        yield (
            f"Drop the hub's hooks into the slots of the {labels[join.piece_b]}. Turn the disc against the hub until "
            f"they hold: clockwise, as seen from its unprinted side, by about {angle_deg:.0f}°: join {join.number}."
        )
        yield "Several positions are possible: take the one in which the notches of both discs are in line when it holds."
    hooks = {join.number for join in joins if join.kind == "rim"}
    if hooks:
        yield (
            f"Drop the strip's hooks from outside into the notches of both discs: join {number_ranges(hooks)}. The "
            "notches of a disc are alike: begin at any of them, whatever its number."
        )
    tongues = sorted((join for join in joins if is_rim_lock(car, join)), key=lambda join: join.number)
    if tongues:
        yield (
            "Where two ends of strips meet, the end with the tongue lies outside, on top of the end with the slot: "
            f"{join_words([_ends(join, labels) for join in tongues])}."
        )
        yield (
            "Put each tongue's head from outside through the wide part of its slot, and pull it into the narrow part. Do "
            "so with the last one before the hooks beside it drop into their notches: "
            f"join {number_ranges(join.number for join in tongues)}."
        )


def _ends(join: Join, labels: dict[str, str]) -> str:
    """Return which end of a strip lies on which other end, where the rim is locked.

    Example: "the wheel rim 2 on the wheel rim 1 at join 20"
    """
    upper, lower = labels[join.piece_a], labels[join.piece_b]
    return f"the {upper} on {'itself' if upper == lower else f'the {lower}'} at join {join.number}"


def tyre_lines(car: FoldedCar, unit: str) -> Iterator[str]:
    """Yield what to take or to cut for the tyre of each wheel of a unit, and how it is put on."""
    tyre = car.parts.tyre
    axle = next(axle for axle in car.axles if axle.unit == unit)
    # The first size is what is bought. A second one describes the strip that replaces a band which nobody sells.
    bought, *strips = tyre.sizes(axle.radius_mm, axle.tyre_width_mm)
    yield f"The tyre is {tyre.note}. Take for each wheel {bought}."
    for strip in strips:
        yield f"If you have no such band, cut {strip}."
    is_taped = tyre.taped_mm(axle.radius_mm) > 0
    if is_taped:
        yield (
            "Hold a strip with double-sided tape: stick the tape around the rim, and lay the strip on it without "
            "stretching it. The ends of the strip meet and do not overlap."
        )
    elif tyre.stretch is None and tyre.form == "strip":
        yield "The ends of the strip meet and do not overlap."
    elif tyre.form == "tube":
        yield "Warm it with little heat, turning the wheel, until it lies tightly on the rim."
