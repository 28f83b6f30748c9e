"""Obstacles of a sampled scene: the terrain pieces of one object of the program stand on the floor as one obstacle.

Input: the terrain of a scene, and the pieces of each object. Output: obstacles with their footprints. Objects whose
footprints have the same middle, such as stacked blocks, are one obstacle.
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

# The key of the car beside the letters of obstacles.
CAR = "car"


@dataclass(frozen=True, slots=True)
class Obstacle:
    """An obstacle: its class in the program, the indices of its pieces in the scene's terrain, its footprint.

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
        """The footprint's corners (x, y) in sequence."""
        cos, sin = math.cos(self.heading_rad), math.sin(self.heading_rad)
        ends = [(a * self.length_m / 2, b * self.width_m / 2) for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
        return [(self.x_m + a * cos - b * sin, self.y_m + a * sin + b * cos) for a, b in ends]

    def near_edge_m(self, terrain: Sequence[Mapping[str, Any]]) -> list[tuple[float, float]]:
        """Return the points (x, y) of the obstacle whose distances from the mark on the floor (the origin) are measured.

        They are the nearest corner, and the other end of its longer edge, which determines the heading best. Of a round
        obstacle it is the nearest point alone; no point if the mark is in its middle.
        """
        if len(self.pieces) == 1 and kind_of(terrain[self.pieces[0]]).shape == "disc":
            distance_m = math.hypot(self.x_m, self.y_m)
            scale = abs(1 - self.length_m / 2 / distance_m) if distance_m else 0.0
            return [(scale * self.x_m, scale * self.y_m)] if scale else []
        corners = self.corners_m
        # Rounded, so that the last bit does not decide between corners at equal distance: the first is taken.
        distances = [round(math.hypot(*corner), 6) for corner in corners]
        first = distances.index(min(distances))
        # The corners are in order around the obstacle.
        neighbours = corners[(first + 1) % 4], corners[(first - 1) % 4]
        # Of equal edges, the one whose other end is nearer to the mark.
        second = max(neighbours, key=lambda corner: (round(math.dist(corner, corners[first]), 6), -math.hypot(*corner)))
        return [corners[first], second]


def obstacles_of(
    terrain: Sequence[Mapping[str, Any]], objects: Sequence[tuple[str, float, Sequence[int]]]
) -> list[Obstacle]:
    """Return the obstacles of ``objects``, each a class name, a heading (rad) and indices of pieces, in their order.

    Objects with the same middle, such as stacked blocks, are one obstacle. Pieces of the floor itself, such as rough
    ground, are left out.
    """
    obstacle_by_middle: dict[tuple[float, float], Obstacle] = {}
    for name, heading_rad, indices in objects:
        standing_pieces = tuple(index for index in indices if not kind_of(terrain[index]).is_floor)
        if not standing_pieces:
            continue
        obstacle = _obstacle(name, heading_rad, standing_pieces, terrain)
        same_middle = obstacle_by_middle.get((obstacle.x_m, obstacle.y_m))
        if same_middle is not None:
            length_m, width_m = max(same_middle.length_m, obstacle.length_m), max(same_middle.width_m, obstacle.width_m)
            pieces = same_middle.pieces + obstacle.pieces
            obstacle = replace(same_middle, pieces=pieces, length_m=length_m, width_m=width_m)
        obstacle_by_middle[obstacle.x_m, obstacle.y_m] = obstacle
    return list(obstacle_by_middle.values())


def footprint(name: str, terrain: Sequence[Mapping[str, Any]], index: int) -> Obstacle:
    """Return one piece of a terrain as an obstacle."""
    piece = terrain[index]
    along, across = reach_m(piece)
    return Obstacle(name, (index,), piece["x_m"], piece["y_m"], piece.get("heading_rad", 0.0), 2 * along, 2 * across)


def _obstacle(name: str, heading_rad: float, indices: tuple[int, ...], terrain: Sequence[Mapping[str, Any]]) -> Obstacle:
    """Return the pieces with these indices as one obstacle, whose footprint is their bounding box along the heading."""
    if len(indices) == 1:
        return footprint(name, terrain, *indices)
    # The pieces are rotated by the negative heading, and the middle of their bounding box is rotated back.
    places = ({"heading_rad": heading_rad, **terrain[index]} for index in indices)
    ground = shapely.union_all([rectangle(place, reach_m(place)) for place in places])
    x_min, y_min, x_max, y_max = affinity.rotate(ground, -heading_rad, (0, 0), use_radians=True).bounds
    x, y, cos, sin = (x_min + x_max) / 2, (y_min + y_max) / 2, math.cos(heading_rad), math.sin(heading_rad)
    x_m, y_m = rounded(x * cos - y * sin), rounded(x * sin + y * cos)
    return Obstacle(name, indices, x_m, y_m, heading_rad, x_max - x_min, y_max - y_min)
