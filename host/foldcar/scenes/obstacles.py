"""What stands on the floor of a sampled scene as one thing: the terrain pieces of one object of the program.

Input: the terrain of a scene, and which pieces each object has. Output: obstacles with their footprints. Objects whose
footprints have the same middle, such as blocks that a program stacks, are one obstacle.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from foldcar.scenes.reading import rounded
from foldcar.scenes.terrain_kinds import kind_of, reach_m

# What stands beside obstacles under the letters that they get.
CAR = "car"


@dataclass(frozen=True, slots=True)
class Obstacle:
    """One thing: its class in the program, the indices of its pieces in the scene's terrain, its footprint.

    The footprint is a rectangle of ``length_m`` along ``heading_rad`` by ``width_m``, with its middle at (x, y).
    """

    name: str
    pieces: tuple[int, ...]
    x_m: float
    y_m: float
    heading_rad: float
    length_m: float
    width_m: float


def obstacles_of(
    terrain: Sequence[Mapping[str, Any]], objects: Sequence[tuple[str, float, Sequence[int]]]
) -> list[Obstacle]:
    """The obstacles in the order of ``objects``, each of which is a class, a heading (rad) and indices of pieces.

    Pieces that belong to the floor itself, such as rough ground, are left out.
    """
    found: dict[tuple[float, float], Obstacle] = {}
    for name, heading_rad, indices in objects:
        standing = tuple(index for index in indices if not kind_of(terrain[index]).is_floor)
        if not standing:
            continue
        one = _obstacle(name, heading_rad, standing, terrain)
        below = found.get((one.x_m, one.y_m))
        if below is not None:
            one = replace(below, pieces=below.pieces + one.pieces, length_m=max(below.length_m, one.length_m),
                          width_m=max(below.width_m, one.width_m))  # fmt: skip
        found[one.x_m, one.y_m] = one
    return list(found.values())


def _obstacle(name: str, heading_rad: float, indices: tuple[int, ...], terrain: Sequence[Mapping[str, Any]]) -> Obstacle:
    if len(indices) == 1:
        piece = terrain[indices[0]]
        along, across = reach_m(piece)
        turned_rad = piece.get("heading_rad", 0.0)
        return Obstacle(name, indices, piece["x_m"], piece["y_m"], turned_rad, 2 * along, 2 * across)
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    ahead, left = [], []
    for index in indices:
        piece = terrain[index]
        along, across = reach_m(piece)
        turn_rad = piece.get("heading_rad", heading_rad) - heading_rad
        c, s = abs(math.cos(turn_rad)), abs(math.sin(turn_rad))
        x, y = piece["x_m"] * cos + piece["y_m"] * sin, piece["y_m"] * cos - piece["x_m"] * sin
        ahead += [x - along * c - across * s, x + along * c + across * s]
        left += [y - along * s - across * c, y + along * s + across * c]
    x, y = (min(ahead) + max(ahead)) / 2, (min(left) + max(left)) / 2
    return Obstacle(
        name,
        indices,
        rounded(x * cos - y * sin),
        rounded(x * sin + y * cos),
        heading_rad,
        max(ahead) - min(ahead),
        max(left) - min(left),
    )
