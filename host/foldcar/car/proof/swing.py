"""Folds that close: how far each is closed from step to step, and what moves along.

Input: folds before and after, or a lid. Output: paths as fractions of the folds' angles by crease; the moving faces and
parts, and those that stand still.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from foldcar.car.proof.blocks import Blocks, merge_blocks
from foldcar.car.proof.roles import Lid
from foldcar.car.proof.scene import Stage, title
from foldcar.car.proof.step import PartKey

# Steps of a lid's turn: film 100 mm from the fold leaves the convex hull of two successive positions by 0.02 mm only.
SWING_STEPS = 40


class Swing(NamedTuple):
    """The copies of a piece that folds, the titles of their faces that move, the parts that move along, and all that
    stands still.
    """

    piece_keys: list[PartKey]
    faces: set[str]
    part_keys: list[PartKey]
    obstacles: Blocks


def even_path(start: Mapping[str, float], end: Mapping[str, float]) -> Iterator[dict[str, float]]:
    """Yield the positions of folds, in equal steps from ``start`` to ``end``.

    A position has, for each crease, the fraction of its final angle by which it is closed. A crease that is not in
    ``start`` is open at first, with the fraction 0. All creases of ``end`` move at the same time.
    """
    for number in range(SWING_STEPS + 1):
        t = number / SWING_STEPS
        yield {crease: start.get(crease, 0.0) * (1 - t) + fraction * t for crease, fraction in end.items()}


def lid_path(lid: Lid, angles_rad: Mapping[str, float]) -> Iterator[dict[str, float]]:
    """Yield how far the folds of a lid are closed, step by step, while it shuts.

    Each value has a number for each crease: 0 means that the fold is flat, and 1 that it has its final angle. The lid
    turns about its hinge, and a flap hangs on its other edge. If the flap had its final angle all the time, it would hit
    the wall behind which it must go. So it is first bent to its final angle. During the first half of the lid's turn it
    is bent further, by as much as the lid turns, so its number is above 1. During the second half it is bent back.
    """
    hinge, *flaps = lid.creases
    if not flaps:
        for number in range(SWING_STEPS + 1):
            yield {hinge: number / SWING_STEPS}
        return
    flap, *others = flaps
    others_closed = dict.fromkeys(others, 1.0)
    for number in range(SWING_STEPS):
        yield {hinge: 0.0, flap: number / SWING_STEPS, **others_closed}
    # Both folds have numbers relative to their own final angles. This turns one of the hinge into one of the flap.
    hinge_to_flap = angles_rad[hinge] / angles_rad[flap]
    for number in range(SWING_STEPS + 1):
        closed = number / SWING_STEPS
        further_bent = min(closed, 1.0 - closed)
        yield {hinge: closed, flap: 1.0 + hinge_to_flap * further_bent, **others_closed}


def swing_of(name: str, first: Stage, last: Stage, standing: Mapping[PartKey, Blocks]) -> Swing:
    """Return what moves and what stands still when the piece ``name`` folds between two stages.

    ``standing`` are the parts that are in place, with their solids.
    """
    moving_keys = [key for key in standing if first.poses(key) != last.poses(key)]
    piece_keys = [key for key in moving_keys if key.kind == "piece" and key.name == name]
    part_keys = [key for key in moving_keys if key not in piece_keys]
    faces: set[str] = set()
    for key in piece_keys:
        last_poses = last.poses(key)
        faces |= {title(name, face) for face, pose in first.poses(key).items() if pose != last_poses[face]}
    still_faces = [standing[key].without_titles(faces) for key in piece_keys]
    still_parts = [blocks for key, blocks in standing.items() if key not in moving_keys]
    return Swing(piece_keys, faces, part_keys, obstacles=merge_blocks([*still_faces, *still_parts]))
