"""The order of assembly as the view plays it: when each fold closes, when and along which path each part goes in.

Input: a FoldedCar. Output: steps counted from 1; lengths in millimetres. A part without an insertion path (it is bent,
stuck on or laid out) is drawn in its place.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from foldcar.car.folded.model import FoldedCar, Mount, PlacedPiece
from foldcar.car.proof.prove import assembly_steps
from foldcar.car.proof.roles import roles_of

Vector = tuple[float, float, float]
Part = tuple[str, str, int]  # kind ("piece", "mount" or "nut"), name, copy
NUT = "nut"
# Step, motions out, and start and end of the part's insertion as fractions of the step's time.
Ways = list[tuple[int, tuple[Vector, ...], float, float]]

# Minimum length of the drawn path: beyond its way out a part meets no obstacle.
MIN_WAY_MM = 30.0
# The last part of a step begins to go in at this fraction of the step's time.
TOGETHER = 0.5
# Distance of the first part in the exploded view, and additional distance of each later part in the same direction.
FIRST_MM, NEXT_MM = 30.0, 16.0
# Parts at the same depth go out together.
SAME_MM = 1.0


@dataclass
class ViewSteps:
    """What the view shows in each step.

    ``ways`` has how a part moves out, by the step that adds the part or its unit. ``closing`` has pairs of step and
    fraction by crease, which is (piece, name). ``exploded`` is how far a part is moved in the exploded view (mm), and
    ``rides`` is the piece and the face that a part moves with. ``bases`` are the beams by body. ``lids`` are the
    creases that open the car, by piece.
    """

    titles: list[str]
    bases: dict[str, Part]
    lids: dict[str, tuple[str, ...]]
    ways: dict[Part, Ways] = field(default_factory=dict)
    closing: dict[tuple[str, str], list[tuple[int, float]]] = field(default_factory=dict)
    exploded: dict[Part, Vector] = field(default_factory=dict)
    rides: dict[Part, tuple[Part, str]] = field(default_factory=dict)


def view_steps(folded: FoldedCar) -> ViewSteps:
    """Return what the steps of the car's guide do to every part and crease.

    A part that no step adds is in the car from the first step on. A crease that no step names is folded from the
    first step on.
    """
    steps = assembly_steps(folded)
    roles = roles_of(folded)
    bases = {body: _key(item) for body, item in roles.beams.items()}
    result = ViewSteps([step.title for step in steps], bases, {name: lid.creases for name, lid in roles.lids.items()})
    placed_items: list[PlacedPiece | Mount] = [*folded.placed, *folded.mounts]
    item_of = {_key(item): item for item in placed_items}
    for key, item in item_of.items():
        host = roles.host(item) if isinstance(item, PlacedPiece) else roles.mount_host(item)
        if host is not None:
            result.rides[key] = (_key(host.piece), host.face)
    units: dict[tuple[str, str], list[Part]] = {}
    for number, step in enumerate(steps, 1):
        for position, added in enumerate(step.adds):
            start = TOGETHER * position / len(step.adds)
            if step.unit and added.kind != "unit":
                units.setdefault((step.unit, added.body), []).append((added.kind, added.name, added.copy))
            if added.nut_mm:
                nut = NUT, added.name, added.copy
                item_of[nut] = item_of["mount", added.name, 0]
                if step.unit:
                    units[step.unit, added.body].append(nut)
                result.ways[nut] = [(number, _out(added.nut_mm), start, start + 1 - TOGETHER)]
                if ("mount", added.name, 0) in result.rides:
                    result.rides[nut] = result.rides["mount", added.name, 0]
            own_part = [(added.kind, added.name, added.copy)]
            for part in units[added.name, added.body] if added.kind == "unit" else own_part:
                way = _out(added.way_mm)
                result.ways.setdefault(part, []).append((number, way, start, start + 1 - TOGETHER))
        for piece, folds in step.folds.items():
            for crease, fraction in folds.items():
                result.closing.setdefault((piece, crease), []).append((number, fraction))
    # A crease that no step names is folded when its piece goes in.
    for folded_piece in folded.pieces:
        ids = [part for part in result.ways if part[:2] == ("piece", folded_piece.name)]
        first_step = min((result.ways[part][0][0] for part in ids), default=1)
        for fold in folded_piece.creases:
            result.closing.setdefault((folded_piece.name, fold.name), [(first_step, 1.0)])
    result.exploded = dict(_exploded(result, folded, item_of))
    return result


def _key(item: PlacedPiece | Mount) -> Part:
    """Return what identifies a placed piece or a mount in the view."""
    return ("piece", item.piece, item.copy) if isinstance(item, PlacedPiece) else ("mount", item.name, 0)


def _out(way_mm: Sequence[Vector]) -> tuple[Vector, ...]:
    """Return the moves out: the insertion path reversed, its last move at least MIN_WAY_MM long."""
    moves = [-np.array(move) for move in reversed(way_mm)]
    if moves:
        moves[-1] *= max(1.0, MIN_WAY_MM / float(np.linalg.norm(moves[-1])))
    return tuple(_vector(move) for move in moves)


def _axis_out(folded: FoldedCar, body: str) -> Vector:
    """Return the unit vector outwards along the axle if ``body`` is a wheel, else up."""
    axle = next((axle for axle in folded.axles if axle.wheel == body), None)
    if axle is None:
        return (0.0, 0.0, 1.0)
    return (0.0, 1.0 if axle.side == "left" else -1.0, 0.0)


class _PartOfGroup(NamedTuple):
    """A part that comes out of the car in the direction of its group.

    ``depth_mm`` is how far out it is already in that direction, and ``unit_shift_mm`` (3,) how far its unit is moved.
    """

    part: Part
    depth_mm: float
    unit_shift_mm: NDArray[np.float64]


def _exploded(
    steps: ViewSteps, folded: FoldedCar, item_of: dict[Part, PlacedPiece | Mount]
) -> Iterator[tuple[Part, Vector]]:
    """Yield how far each part is moved in the exploded view (mm), in the direction in which it comes out of the car.

    Parts of a body that come out in the same direction are ranked by how far out they are, and each rank goes NEXT_MM
    farther. A part without a way out goes outwards along the axle if it belongs to a wheel, else upwards.
    """
    # The parts that come out in the same direction, by body and rounded direction.
    groups: dict[tuple[str, tuple[int, ...]], list[_PartOfGroup]] = {}
    for part in steps.ways:
        if part in steps.bases.values():
            continue
        item = item_of[part]
        # The first direction is that of the part. Others are those of the unit that it belongs to.
        own_direction, *unit_directions = _directions_out(part, steps, default=np.array(_axis_out(folded, item.body)))
        # Directions are rounded to thirds, so that nearly equal ones are equal.
        rounded_direction = tuple(int(value) for value in np.rint(3 * own_direction))
        depth_mm = float(np.array(item.pose)[:3, 3] @ own_direction)
        unit_shift_mm = sum(unit_directions, np.zeros(3)) * FIRST_MM
        group = groups.setdefault((item.body, rounded_direction), [])
        group.append(_PartOfGroup(part, depth_mm, unit_shift_mm))
    for (_, rounded), group in groups.items():
        direction = np.array(rounded) / np.linalg.norm(rounded)
        for member, rank in _ranked(group):
            yield member.part, _vector(member.unit_shift_mm + direction * (FIRST_MM + NEXT_MM * rank))


def _directions_out(part: Part, steps: ViewSteps, default: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return the unit vectors (3,) in which a part comes out of the car, one for each step in which it moves.

    This is the direction from where it is to the end of its moves. If it has no moves, it is that of ``default``.
    """
    kind, _, _ = part
    directions = []
    for _step, moves, _start, _end in steps.ways[part]:
        # The first move takes a nut off the end of its screw. This move alone gives its direction.
        considered_moves = moves[:1] if kind == NUT else moves
        direction = np.array(considered_moves).sum(axis=0) if considered_moves else default
        directions.append(direction / np.linalg.norm(direction))
    return directions


def _ranked(group: Sequence[_PartOfGroup]) -> Iterator[tuple[_PartOfGroup, int]]:
    """Yield the parts of a group with their ranks from 0, the innermost first. Equally far parts have the same rank."""
    rank, last_depth_mm = -1, -np.inf
    for member in sorted(group, key=lambda member: member.depth_mm):
        if member.depth_mm > last_depth_mm + SAME_MM:
            rank += 1
            last_depth_mm = member.depth_mm
        yield member, rank


def _vector(values: NDArray[np.float64]) -> Vector:
    x, y, z = (round(float(value), 3) for value in values)
    return (x, y, z)
