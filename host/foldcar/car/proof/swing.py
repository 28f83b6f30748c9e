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
    """What moves and what stands still while a piece folds.

    ``copies`` are the copies of the piece, and ``moving_faces`` the titles of their faces that move. ``carried`` are the
    other parts that move along with them. ``obstacles`` is all that stands still.
    """

    copies: list[PartKey]
    moving_faces: set[str]
    carried: list[PartKey]
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
    """Yield the positions of the folds of a lid, step by step, while it shuts.

    A position has a number for each crease: 0 means that the fold is flat, and 1 that it has its final angle, which
    ``angles_rad`` contains. The lid turns about its hinge, and a flap hangs on its other edge. With its final angle to
    the lid, the flap would hit the wall behind which it must go. So it is bent further at first, as the lid turns, up to
    the middle of the lid's turn. Then it is bent back.
    """
    hinge, *flaps = lid.creases
    if not flaps:
        for number in range(SWING_STEPS + 1):
            yield {hinge: number / SWING_STEPS}
        return
    flap, *others = flaps
    others_closed = dict.fromkeys(others, 1.0)
    # While the lid is open, the flap is folded to its final angle.
    for number in range(SWING_STEPS):
        yield {hinge: 0.0, flap: number / SWING_STEPS, **others_closed}
    # Then the lid turns. The flap is bent by the same angle as the lid turns, which is another fraction of its own angle.
    flap_per_hinge = angles_rad[hinge] / angles_rad[flap]
    for number in range(SWING_STEPS + 1):
        closed = number / SWING_STEPS
        further_bent = min(closed, 1.0 - closed)
        yield {hinge: closed, flap: 1.0 + flap_per_hinge * further_bent, **others_closed}


def swing_of(name: str, first: Stage, last: Stage, standing: Mapping[PartKey, Blocks]) -> Swing:
    """Return what moves and what stands still when the piece ``name`` folds between two stages.

    ``standing`` are the parts that are in place, with their solids.
    """
    moving = [key for key in standing if first.poses(key) != last.poses(key)]
    copies = [key for key in moving if key.kind == "piece" and key.name == name]
    carried = [key for key in moving if key not in copies]
    moving_faces: set[str] = set()
    for key in copies:
        first_poses, last_poses = first.poses(key), last.poses(key)
        moving_faces |= {title(name, face) for face in first_poses if first_poses[face] != last_poses[face]}
    still_faces = [standing[key].without_titles(moving_faces) for key in copies]
    still_parts = [blocks for key, blocks in standing.items() if key not in moving]
    return Swing(copies, moving_faces, carried, obstacles=merge_blocks([*still_faces, *still_parts]))
