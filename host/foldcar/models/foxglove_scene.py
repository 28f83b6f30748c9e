"""A car and its ground as a foxglove.SceneUpdate, for the 3D panel of Foxglove.

Input: body and scene of docs/carsim.md, the grid of the scene's smooth ground. Output: the message, without times. The
ground is in the frame ``world``, the car in its own, hinges flat; friction patches are not shown.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy

from foldcar.link.mcap_export import CAR, WORLD, quaternion, vector
from foldcar.models.exported_car import axle_m, tyre_center_m
from foldcar.models.ground import HeightGrid
from foldcar.scenes.terrain_kinds import kind_of

FLOOR, PIECE = {"r": 0.93, "g": 0.92, "b": 0.88, "a": 1.0}, {"r": 0.75, "g": 0.6, "b": 0.4, "a": 1.0}
BODY, TYRE = {"r": 0.1, "g": 0.45, "b": 0.7, "a": 0.8}, {"r": 0.15, "g": 0.15, "b": 0.15, "a": 1.0}
FLOOR_DEPTH_M = 0.01
# A finer grid is thinned out to this number of points along each side.
MAX_POINTS_PER_SIDE = 150
ARC_SLICES = 12


def foxglove_scene(body: Mapping[str, Any], scene: Mapping[str, Any], grid: HeightGrid | None) -> dict[str, Any]:
    """Return the message with the entities ``car`` and ``ground``.

    ``grid`` is the scene's smooth ground with the floor around it; without one, the floor is a flat box.
    """
    pieces = [piece for piece in scene["terrain"] if kind_of(piece).form == "block"]
    ground = [_block(piece) for piece in pieces]
    course = scene["course"]
    size = vector(course["x_max_m"] - course["x_min_m"], course["y_max_m"] - course["y_min_m"], FLOOR_DEPTH_M)
    middle = ((course["x_max_m"] + course["x_min_m"]) / 2, (course["y_max_m"] + course["y_min_m"]) / 2)
    floor = []
    if grid is None:
        floor.append({"pose": _pose((*middle, -FLOOR_DEPTH_M / 2)), "size": size, "color": FLOOR})
    else:
        ground.append(_surface(grid))
    wheels = [
        {
            # The axis of a cylinder is z.
            "pose": {
                "position": vector(*(a + b for a, b in zip(axle_m(body, wheel), tyre_center_m(wheel), strict=True))),
                "orientation": quaternion(0.0, 0.0, math.pi / 2),
            },
            "size": vector(2 * wheel["radius_m"], 2 * wheel["radius_m"], wheel["width_m"]),
            "bottom_scale": 1.0,
            "top_scale": 1.0,
            "color": TYRE,
        }
        for wheel in body["wheels"]
    ]
    segments = [
        {
            "pose": _pose((segment["x_m"], 0.0, segment["center_z_m"])),
            "size": vector(segment["length_m"], segment["width_m"], segment["height_m"]),
            "color": BODY,
        }
        for segment in body["segments"]
    ]
    entities = [
        _entity("ground", WORLD, cubes=floor, triangles=ground),
        _entity("car", CAR, cubes=segments, cylinders=wheels),
    ]
    return {"deletions": [], "entities": entities}


def _entity(name: str, frame: str, **shapes: Sequence[Any]) -> dict[str, Any]:
    """Return a foxglove.SceneEntity with these shapes; the format requires lists of all kinds."""
    kinds = ("metadata", "arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")
    zero = {"sec": 0, "nsec": 0}
    head = {"timestamp": zero, "frame_id": frame, "id": name, "lifetime": zero, "frame_locked": True}
    return {**head, **{kind: list(shapes.get(kind, ())) for kind in kinds}}


def _pose(place: tuple[float, float, float], heading_rad: float = 0.0) -> dict[str, Any]:
    return {"position": vector(*place), "orientation": quaternion(heading_rad)}


def _block(piece: Mapping[str, Any]) -> dict[str, Any]:
    """Return a block as triangles: its profile (x, z), extruded across; the two ends are fans of triangles."""
    half, height, half_width = piece["length_m"] / 2, piece["height_m"], piece["width_m"] / 2
    if piece["kind"] == "box":
        profile = [(-half, 0.0), (half, 0.0), (half, height), (-half, height)]
    elif piece["kind"] == "ramp":
        profile = [(-half, 0.0), (half, 0.0), (half, height)]
    else:
        # A half round is the segment of a circle through both ends of its base.
        radius = (half**2 + height**2) / (2 * height)
        x_m = numpy.linspace(half, -half, ARC_SLICES + 1)
        arc_z_m = numpy.sqrt(numpy.maximum(radius**2 - x_m**2, 0.0)) + height - radius
        profile = [(-half, 0.0), *((float(x), float(z)) for x, z in zip(x_m[:-1], arc_z_m[:-1], strict=True))]
    count = len(profile)
    points = [vector(x, y, z) for y in (-half_width, half_width) for x, z in profile]
    # Three indices of points for each triangle: the right end, the left end, two for each side between them.
    indices = [i for k in range(1, count - 1) for i in (0, k, k + 1)]
    indices += [i for k in range(1, count - 1) for i in (count, count + k + 1, count + k)]
    for k in range(count):
        next_index = (k + 1) % count
        indices += [k, count + k, count + next_index, k, count + next_index, next_index]
    pose = _pose((piece["x_m"], piece["y_m"], 0.0), piece["heading_rad"])
    return {"pose": pose, "points": points, "color": PIECE, "colors": [], "indices": indices}


def _surface(grid: HeightGrid) -> dict[str, Any]:
    """Return uneven ground as a triangle mesh."""
    rows, columns = (
        numpy.unique(numpy.linspace(0, count - 1, min(count, MAX_POINTS_PER_SIDE)).round().astype(int))
        for count in grid.z_m.shape
    )
    x = numpy.linspace(grid.x_min_m, grid.x_max_m, grid.z_m.shape[1])[columns]
    y = numpy.linspace(grid.y_min_m, grid.y_max_m, grid.z_m.shape[0])[rows]
    # A resolution of 0.1 mm keeps the message small.
    z = numpy.round(grid.z_m[numpy.ix_(rows, columns)], 4)
    grid_x, grid_y = (numpy.round(side, 4).ravel() for side in numpy.meshgrid(x, y))
    points = [vector(*point) for point in numpy.stack([grid_x, grid_y, z.ravel()], axis=1).tolist()]
    # Two triangles for each cell, by the indices of its corners relative to the first one.
    first_corners = (numpy.arange(len(y) - 1)[:, None] * len(x) + numpy.arange(len(x) - 1)).ravel()
    corners = [0, 1, len(x) + 1, 0, len(x) + 1, len(x)]
    cells = numpy.stack([first_corners + corner for corner in corners], axis=1)
    pose, indices = _pose((0.0, 0.0, 0.0)), cells.ravel().tolist()
    return {"pose": pose, "points": points, "color": FLOOR, "colors": [], "indices": indices}
