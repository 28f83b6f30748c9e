"""Obstacles of a sampled scene: the terrain pieces of one object of the program stand on the floor as one obstacle.

Input: the terrain of a scene, and the pieces of each object. Output: obstacles with their footprints. Objects whose
footprints have the same middle, such as stacked blocks, are one obstacle.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

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
        corners = []
        for length_sign, width_sign in ((1, 1), (1, -1), (-1, -1), (-1, 1)):
            # From the middle, along the heading and to the left of it.
            ahead_m, left_m = length_sign * self.length_m / 2, width_sign * self.width_m / 2
            corners.append((self.x_m + ahead_m * cos - left_m * sin, self.y_m + ahead_m * sin + left_m * cos))
        return corners

    def near_edge_m(self, terrain: Sequence[Mapping[str, Any]]) -> list[tuple[float, float]]:
        """Return the points (x, y) of the obstacle to which a person measures from the mark on the floor, the origin.

        An obstacle with corners has two points: the nearest corner, and the other end of the longer of the two edges at
        this corner, because a long edge determines the heading best. A round obstacle has one point, the nearest one. It
        has none if the mark is in its middle.
        """
        if len(self.pieces) == 1 and kind_of(terrain[self.pieces[0]]).shape == "disc":
            return self._near_points_of_disc_m()
        corners = self.corners_m
        # Distances are rounded to micrometres. So if two corners are equally near, every machine chooses the same one.
        distances_m = [round(math.hypot(*corner), 6) for corner in corners]
        nearest_index = distances_m.index(min(distances_m))
        nearest = corners[nearest_index]
        # The corners are in order around the obstacle.
        next_corner = corners[(nearest_index + 1) % 4]
        previous_corner = corners[(nearest_index - 1) % 4]
        length_to_next_m = round(math.dist(next_corner, nearest), 6)
        length_to_previous_m = round(math.dist(previous_corner, nearest), 6)
        if length_to_next_m == length_to_previous_m:
            # Both edges are equally long, so take the one whose other end is nearer to the mark.
            return [nearest, min(next_corner, previous_corner, key=lambda corner: math.hypot(*corner))]
        return [nearest, next_corner if length_to_next_m > length_to_previous_m else previous_corner]

    def _near_points_of_disc_m(self) -> list[tuple[float, float]]:
        """Return the point of a round obstacle's edge that is nearest to the mark on the floor, the origin.

        The list is empty if the mark is in the middle of the obstacle, or on its edge.
        """
        distance_m = math.hypot(self.x_m, self.y_m)
        radius_m = self.length_m / 2
        if not distance_m or distance_m == radius_m:
            return []
        # The point is on the line through the mark and the middle, one radius from the middle towards the mark.
        # ``fraction`` says how far it is along the way from the mark to the middle. It is negative if the mark is inside
        # the obstacle: the point then lies on the other side of the mark.
        fraction = 1 - radius_m / distance_m
        return [(fraction * self.x_m, fraction * self.y_m)]


class PlacedObject(NamedTuple):
    """A terrain object of a program: its class, its heading, and the indices of its pieces in the scene's terrain."""

    name: str
    heading_rad: float
    pieces: Sequence[int]


def obstacles_of(terrain: Sequence[Mapping[str, Any]], objects: Sequence[PlacedObject]) -> list[Obstacle]:
    """Return the obstacles of a scene, which a person has to place on the floor, in the order of ``objects``.

    Each object of the program is an obstacle. Objects with the same middle, such as stacked blocks, are one obstacle.
    Pieces of the floor itself, such as rough ground, are left out.
    """
    obstacle_by_middle: dict[tuple[float, float], Obstacle] = {}
    for placed in objects:
        standing_pieces = tuple(index for index in placed.pieces if not kind_of(terrain[index]).is_floor)
        if not standing_pieces:
            continue
        obstacle = _obstacle(placed.name, placed.heading_rad, standing_pieces, terrain)
        middle = (obstacle.x_m, obstacle.y_m)
        earlier_obstacle = obstacle_by_middle.get(middle)
        if earlier_obstacle is not None:
            obstacle = replace(
                earlier_obstacle,
                pieces=earlier_obstacle.pieces + obstacle.pieces,
                length_m=max(earlier_obstacle.length_m, obstacle.length_m),
                width_m=max(earlier_obstacle.width_m, obstacle.width_m),
            )
        obstacle_by_middle[middle] = obstacle
    return list(obstacle_by_middle.values())


def footprint(name: str, terrain: Sequence[Mapping[str, Any]], index: int) -> Obstacle:
    """Return one piece of a terrain as an obstacle."""
    piece = terrain[index]
    half_length_m, half_width_m = reach_m(piece)
    return Obstacle(
        name=name,
        pieces=(index,),
        x_m=piece["x_m"],
        y_m=piece["y_m"],
        # Round pieces have no heading.
        heading_rad=piece.get("heading_rad", 0.0),
        length_m=2 * half_length_m,
        width_m=2 * half_width_m,
    )


def _obstacle(name: str, heading_rad: float, indices: tuple[int, ...], terrain: Sequence[Mapping[str, Any]]) -> Obstacle:
    """Return the pieces with these indices as one obstacle, whose footprint is their bounding box along the heading."""
    if len(indices) == 1:
        return footprint(name, terrain, indices[0])
    # Round pieces have no heading of their own.
    pieces = [{"heading_rad": heading_rad, **terrain[index]} for index in indices]
    ground = shapely.union_all([rectangle(piece, reach_m(piece)) for piece in pieces])
    # The ground is turned by the negative heading, where its bounding box is parallel to the axes.
    x_min, y_min, x_max, y_max = affinity.rotate(ground, -heading_rad, (0, 0), use_radians=True).bounds
    turned_x_m, turned_y_m = (x_min + x_max) / 2, (y_min + y_max) / 2
    # The middle of the box is turned back.
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    return Obstacle(
        name=name,
        pieces=indices,
        x_m=rounded(turned_x_m * cos - turned_y_m * sin),
        y_m=rounded(turned_x_m * sin + turned_y_m * cos),
        heading_rad=heading_rad,
        length_m=x_max - x_min,
        width_m=y_max - y_min,
    )
