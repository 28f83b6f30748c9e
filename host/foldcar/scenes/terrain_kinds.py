"""The table of terrain kinds for the host; the simulator has its own. Pieces are those of docs/carsim.md.

A kind's ``form`` is its effect on the ground: a ``block`` is a solid with edges, ``smooth`` ground is added to the
heights of the floor, a ``patch`` changes the friction only. Its ``shape`` in the ground plane is a ``rectangle``
(length_m, width_m), a ``disc`` (radius_m, without a heading) or a ``bell`` (sd_along_m, sd_across_m). Limits are
closed intervals; lengths in metres.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

Limits = tuple[float, float]

# Lengths below 1 mm are within the tolerance of the simulator's contacts. No wheel of a design is larger than 0.15 m,
# so a height above 1 m is most likely a mistake of units.
SIDE_M = (0.001, 100.0)
SPREAD_M = (0.005, 100.0)
EDGE_M = (0.002, 100.0)
HEIGHT_M = (0.0001, 1.0)
# A bell is cut off at this many standard deviations, where its height is 0.03 % of its maximum.
BELL_REACH_SD = 4.0


@dataclass(frozen=True, slots=True)
class TerrainKind:
    """One kind: the limits of its sizes by key, and a format string of its description, with lengths in mm.

    ``is_floor``: it is part of the floor itself, not an obstacle to be placed.
    """

    form: Literal["block", "smooth", "patch"]
    shape: Literal["rectangle", "disc", "bell"]
    sizes: Mapping[str, Limits]
    description: str
    is_floor: bool = False


_RECTANGLE = {"length_m": SIDE_M, "width_m": SIDE_M}
_BLOCK = {**_RECTANGLE, "height_m": HEIGHT_M}
_BLOCK_SIZES = "{length_m:.0f} × {width_m:.0f} × {height_m:.1f} mm"

KINDS: Mapping[str, TerrainKind] = {
    "box": TerrainKind("block", "rectangle", _BLOCK, f"box {_BLOCK_SIZES}"),
    "ramp": TerrainKind("block", "rectangle", _BLOCK, f"ramp {_BLOCK_SIZES}"),
    "half_round": TerrainKind("block", "rectangle", _BLOCK, f"half-round {_BLOCK_SIZES}"),
    "hill": TerrainKind(
        "smooth",
        "bell",
        {"sd_along_m": SPREAD_M, "sd_across_m": SPREAD_M, "height_m": (-HEIGHT_M[1], HEIGHT_M[1])},
        "hill {height_m:.1f} mm high, {along_m:.0f} × {across_m:.0f} mm at its foot",
    ),
    "pothole": TerrainKind(
        "smooth",
        "disc",
        {"radius_m": EDGE_M, "depth_m": HEIGHT_M, "edge_m": EDGE_M},
        "hole {depth_m:.1f} mm deep, radius {radius_m:.0f} mm",
    ),
    "rough": TerrainKind(
        "smooth",
        "rectangle",
        {**_RECTANGLE, "height_sd_m": (0.0, HEIGHT_M[1]), "correlation_m": SIDE_M, "seed": (0.0, 2.0**31 - 1)},
        "rough ground {length_m:.0f} × {width_m:.0f} mm: heights of standard deviation {height_sd_m:.1f} mm, "
        "correlation length {correlation_m:.0f} mm",
        is_floor=True,
    ),
    "patch": TerrainKind(
        "patch",
        "rectangle",
        {**_RECTANGLE, "friction": (0.0, 5.0)},
        "patch {length_m:.0f} × {width_m:.0f} mm of friction {friction:g}",
    ),
}


# Kinds in readers' words, where these differ.
KIND_NAMES = {
    "box": "block",
    "half_round": "round bump",
    "patch": "friction patch",
    "ramp": "slope",
    "rough": "rough ground",
}


def kind_of(piece: Mapping[str, Any]) -> TerrainKind:
    """Return the kind of a checked piece."""
    return KINDS[piece["kind"]]


def reach_m(piece: Mapping[str, Any]) -> tuple[float, float]:
    """Return half the extent (m) of a piece's ground along its heading and across."""
    shape = kind_of(piece).shape
    if shape == "bell":
        return BELL_REACH_SD * piece["sd_along_m"], BELL_REACH_SD * piece["sd_across_m"]
    if shape == "disc":
        return piece["radius_m"], piece["radius_m"]
    return piece["length_m"] / 2, piece["width_m"] / 2


def bounds_m(piece: Mapping[str, Any]) -> tuple[float, float, float, float]:
    """Return x_min, x_max, y_min, y_max (m) of a placed piece's ground."""
    along, across = reach_m(piece)
    heading_rad = piece.get("heading_rad", 0.0)
    cos, sin = abs(math.cos(heading_rad)), abs(math.sin(heading_rad))
    dx, dy = along * cos + across * sin, along * sin + across * cos
    return piece["x_m"] - dx, piece["x_m"] + dx, piece["y_m"] - dy, piece["y_m"] + dy


def description(piece: Mapping[str, Any]) -> str:
    """Describe a piece, its kind and its sizes in mm, for the instructions of a trial."""
    along_m, across_m = (2 * reach for reach in reach_m(piece))
    sizes = {**piece, "along_m": along_m, "across_m": across_m}
    in_mm = {key: 1000 * value if key.endswith("_m") else value for key, value in sizes.items()}
    return kind_of(piece).description.format(**in_mm)
