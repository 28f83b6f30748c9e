"""Converts the Terrain objects of a sampled Scenic scene to the terrain pieces of docs/carsim.md.

Input: an object, whose method ``pieces`` returns its pieces in its own frame. Output: the pieces in the simulator's
frame, with all values checked against the simulator's limits.
"""

import math
from collections.abc import Mapping
from typing import Any

from foldcar.scenes.reading import UnusableError, finite, pose, rounded
from foldcar.scenes.terrain_kinds import HEIGHT_M, KINDS, kind_of

PLACE_M = (-1000.0, 1000.0)
TURN_RAD = (-100.0, 100.0)

PLACE_KEYS = {"x_m": PLACE_M, "y_m": PLACE_M, "heading_rad": TURN_RAD}
MOST_PIECES = 10_000
# The simulator represents rough ground as a grid with cells of an eighth of the correlation length.
GRID_FINENESS = 8
MOST_NODES = 4_000_000


def terrain_pieces(thing: Any) -> list[dict[str, Any]]:
    """The pieces of a Terrain object in the simulator's frame (m, rad). Raises UnusableError."""
    try:
        parts = list(thing.pieces())
    except Exception as error:
        raise UnusableError(f"{type(error).__name__}: {error}", thing) from error
    if not parts:
        raise UnusableError("has no pieces", thing)
    place = pose(thing)
    return [_placed(_checked(part, thing), place) for part in parts]


def _checked(part: Any, thing: Any) -> dict[str, Any]:
    """A piece in its object's frame with all keys of its kind, each checked to be a number within its limits."""
    if not isinstance(part, Mapping) or part.get("kind") not in KINDS:
        raise UnusableError(
            f"{part!r} is not a piece of terrain; its kind must be one of {', '.join(KINDS)}", thing
        )
    kind = part["kind"]
    sizes = KINDS[kind].sizes
    unknown = [key for key in part if key != "kind" and key not in sizes and key not in PLACE_KEYS]
    if unknown:
        raise UnusableError(f"{kind}: unknown key {unknown[0]}; its keys are {', '.join(sizes)}", thing)
    checked: dict[str, Any] = {"kind": kind}
    for key, limits in {**PLACE_KEYS, **sizes}.items():
        if key in PLACE_KEYS and key not in part:
            checked[key] = 0.0
            continue
        if key not in part:
            raise UnusableError(f"{kind}: {key} is missing", thing)
        checked[key] = _within(f"{kind}: {key}", part[key], limits, thing)
    if kind == "half_round":
        _not_above(checked, "height_m", checked["length_m"] / 2, "half the length", thing)
    elif kind == "pothole":
        _not_above(checked, "edge_m", checked["radius_m"], "the radius", thing)
    elif kind == "rough":
        _check_rough(checked, thing)
    return checked


def _check_rough(piece: dict[str, Any], thing: Any) -> None:
    length, width, correlation = piece["length_m"], piece["width_m"], piece["correlation_m"]
    _not_above(piece, "correlation_m", min(length, width), "the shorter side", thing)
    cells = GRID_FINENESS / correlation
    nodes = (length * cells + 1) * (width * cells + 1)
    if nodes > MOST_NODES:
        raise UnusableError(
            f"rough: correlation_m: {correlation:g} makes a grid of {nodes:.3g} heights, "
            f"which is above the limit {MOST_NODES:.3g}; enlarge it or shrink the rectangle",
            thing,
        )
    if piece["seed"] != int(piece["seed"]):
        raise UnusableError(f"rough: seed: {piece['seed']:g} is not a whole number", thing)
    piece["seed"] = int(piece["seed"])


def _not_above(piece: Mapping[str, Any], key: str, limit: float, what: str, thing: Any) -> None:
    if piece[key] > limit:
        raise UnusableError(f"{piece['kind']}: {key}: {piece[key]:g} is above {what}, {limit:g}", thing)


def _within(name: str, value: Any, limits: tuple[float, float], thing: Any) -> float:
    low, high = limits
    read = finite(name, value, thing)
    if read < low:
        raise UnusableError(f"{name}: {value} is below the limit {low:g}", thing)
    if read > high:
        hint = "; lengths are in metres" if limits[1] == HEIGHT_M[1] else ""
        raise UnusableError(f"{name}: {value} is above the limit {high:g}{hint}", thing)
    return read


def _placed(part: dict[str, Any], place: Mapping[str, float]) -> dict[str, Any]:
    """The piece in the world's frame; ``place`` is its object's pose."""
    cos, sin = math.cos(place["heading_rad"]), math.sin(place["heading_rad"])
    ahead, left = part["x_m"], part["y_m"]
    piece = {
        **part,
        "x_m": rounded(place["x_m"] + ahead * cos - left * sin),
        "y_m": rounded(place["y_m"] + ahead * sin + left * cos),
        "heading_rad": rounded(math.remainder(place["heading_rad"] + part["heading_rad"], 2 * math.pi)),
    }
    if kind_of(piece).shape == "disc":
        del piece["heading_rad"]
    return piece
