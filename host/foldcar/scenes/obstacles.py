"""What stands on the floor of a sampled scene as one thing: the terrain pieces of one object of the program.

Input: the terrain of a scene, and which pieces each object has. Output: obstacles with their footprints. Objects whose
footprints have the same middle, such as blocks that a program stacks, are one obstacle.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import shapely
from shapely import affinity

from foldcar.scenes.checks import rectangle
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

    @property
    def corners_m(self) -> list[tuple[float, float]]:
        """The footprint's corners (x, y), each beside the next."""
        cos, sin = math.cos(self.heading_rad), math.sin(self.heading_rad)
        ends = [(a * self.length_m / 2, b * self.width_m / 2) for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
        return [(self.x_m + a * cos - b * sin, self.y_m + a * sin + b * cos) for a, b in ends]

    def near_edge_m(self, terrain: Sequence[Mapping[str, Any]]) -> list[tuple[float, float]]:
        """What to measure from the mark on the floor, the origin: the nearest corner (x, y), and the end of the longer
        edge there, which tells the heading best; of a round thing the nearest point, none if the mark is in its middle.
        """
        if len(self.pieces) == 1 and kind_of(terrain[self.pieces[0]]).shape == "disc":
            away_m = math.hypot(self.x_m, self.y_m)
            share = abs(1 - self.length_m / 2 / away_m) if away_m else 0.0
            return [(share * self.x_m, share * self.y_m)] if share else []
        corners = self.corners_m
        # Of equally far ones, whatever the last bit says, the first.
        far = [round(math.hypot(*corner), 6) for corner in corners]
        first = far.index(min(far))
        beside = corners[(first + 1) % 4], corners[(first - 1) % 4]
        # Of equal edges the one whose other end is nearer too.
        second = max(beside, key=lambda one: (round(math.dist(one, corners[first]), 6), -math.hypot(*one)))
        return [corners[first], second]


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


def footprint(name: str, terrain: Sequence[Mapping[str, Any]], index: int) -> Obstacle:
    """One piece of a terrain as an obstacle."""
    piece = terrain[index]
    along, across = reach_m(piece)
    return Obstacle(name, (index,), piece["x_m"], piece["y_m"], piece.get("heading_rad", 0.0), 2 * along, 2 * across)


def _obstacle(name: str, heading_rad: float, indices: tuple[int, ...], terrain: Sequence[Mapping[str, Any]]) -> Obstacle:
    if len(indices) == 1:
        return footprint(name, terrain, *indices)
    # The box around all pieces along the object's heading, from which the middle is turned back.
    places = ({"heading_rad": heading_rad, **terrain[index]} for index in indices)
    ground = shapely.union_all([rectangle(place, reach_m(place)) for place in places])
    x_min, y_min, x_max, y_max = affinity.rotate(ground, -heading_rad, (0, 0), use_radians=True).bounds
    x, y, cos, sin = (x_min + x_max) / 2, (y_min + y_max) / 2, math.cos(heading_rad), math.sin(heading_rad)
    x_m, y_m = rounded(x * cos - y * sin), rounded(x * sin + y * cos)
    return Obstacle(name, indices, x_m, y_m, heading_rad, x_max - x_min, y_max - y_min)
