"""A scene's ground as static MJCF geoms of the world body.

Input: a scene's terrain (docs/carsim.md) and the grid of its smooth ground. Output: geoms. Boxes, ramps and
half-rounds become boxes, convex wedges and horizontal cylinders, which extend below the floor, so that none of their
faces coincides with it. Smooth ground becomes one height field with boxes for the level floor around it, because a
plane would fill its hollows.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any
from xml.etree.ElementTree import Element

import numpy

from foldcar.errors import FoldcarError
from foldcar.models.ground import HeightGrid
from foldcar.models.xml_elements import add, numbers
from foldcar.scenes.terrain_kinds import kind_of

# Ground collides with the car only, and the car with the ground only.
GROUND_CONTACT = {"contype": "1", "conaffinity": "2"}
SUNK_M = 0.1
FLOOR_REACH_M = 50.0
FLOOR_DEPTH_M = 1.0
HFIELD_BASE_M = 0.2
# MuJoCo refuses a height field without elevation.
LEAST_RISE_M = 1e-6
FLOOR_RGBA = "0.93 0.92 0.88 1"
PIECE_RGBA = "0.75 0.6 0.4 1"


def add_terrain(
    world: Element, asset: Element, terrain: Sequence[Mapping[str, Any]], grid: HeightGrid | None
) -> None:
    """Add the floor and all pieces that change the height; friction patches do not."""
    if grid is None:
        _geom(world, "floor", FLOOR_RGBA, type="plane", size=numbers(0, 0, 1))
    else:
        _add_height_field(world, asset, grid)
    for index, piece in enumerate(terrain):
        name, kind = f"{piece['kind']}{index}", piece["kind"]
        if kind_of(piece).form != "block":
            continue
        half_length, half_width, height = piece["length_m"] / 2, piece["width_m"] / 2, piece["height_m"]
        x, y, heading = piece["x_m"], piece["y_m"], piece["heading_rad"]
        turned = {"quat": numbers(math.cos(heading / 2), 0, 0, math.sin(heading / 2))}
        if kind == "box":
            half_height = (height + SUNK_M) / 2
            size = numbers(half_length, half_width, half_height)
            middle = numbers(x, y, height - half_height)
            _geom(world, name, PIECE_RGBA, type="box", size=size, pos=middle, **turned)
        elif kind == "ramp":
            corners = [(sx * half_length, sy * half_width, -SUNK_M) for sx in (-1, 1) for sy in (-1, 1)]
            corners += [(half_length, sy * half_width, height) for sy in (-1, 1)]
            corners += [(-half_length, sy * half_width, 0.0) for sy in (-1, 1)]
            vertices = " ".join(numbers(*corner) for corner in corners)
            add(asset, "mesh", name=name, vertex=vertices)
            _geom(world, name, PIECE_RGBA, type="mesh", mesh=name, pos=numbers(x, y, 0), **turned)
        elif kind == "half_round":
            radius = (half_length**2 + height**2) / (2 * height)
            across = (math.sin(heading), -math.cos(heading), 0)
            ends = [(x - s * across[0] * half_width, y - s * across[1] * half_width) for s in (-1, 1)]
            fromto = " ".join(numbers(*end, height - radius) for end in ends)
            _geom(world, name, PIECE_RGBA, type="cylinder", size=numbers(radius), fromto=fromto)
        else:
            raise FoldcarError(f"terrain {index}: a {kind} cannot be written as MJCF")


def _add_height_field(world: Element, asset: Element, grid: HeightGrid) -> None:
    low, high = float(numpy.min(grid.z_m)), float(numpy.max(grid.z_m))
    rise = max(high - low, LEAST_RISE_M)
    half_x, half_y = (grid.x_max_m - grid.x_min_m) / 2, (grid.y_max_m - grid.y_min_m) / 2
    middle_x, middle_y = (grid.x_max_m + grid.x_min_m) / 2, (grid.y_max_m + grid.y_min_m) / 2
    add(
        asset,
        "hfield",
        name="ground",
        nrow=str(grid.z_m.shape[0]),
        ncol=str(grid.z_m.shape[1]),
        size=numbers(half_x, half_y, rise, HFIELD_BASE_M),
        # Rows begin at the largest y; MuJoCo scales the values to the range 0 to 1.
        elevation=" ".join(f"{z:.6g}" for z in (grid.z_m[::-1] - low).ravel()),
    )
    _geom(world, "ground", FLOOR_RGBA, type="hfield", hfield="ground", pos=numbers(middle_x, middle_y, low))
    far, depth = FLOOR_REACH_M, FLOOR_DEPTH_M / 2
    for name, x_min, x_max, y_min, y_max in (
        ("floor_back", -far, grid.x_min_m, -far, far),
        ("floor_front", grid.x_max_m, far, -far, far),
        ("floor_right", grid.x_min_m, grid.x_max_m, -far, grid.y_min_m),
        ("floor_left", grid.x_min_m, grid.x_max_m, grid.y_max_m, far),
    ):
        size = numbers((x_max - x_min) / 2, (y_max - y_min) / 2, depth)
        middle = numbers((x_max + x_min) / 2, (y_max + y_min) / 2, -depth)
        _geom(world, name, FLOOR_RGBA, type="box", size=size, pos=middle)


def _geom(world: Element, name: str, rgba: str, **attributes: str) -> None:
    add(world, "geom", name=name, rgba=rgba, **attributes, **GROUND_CONTACT)
