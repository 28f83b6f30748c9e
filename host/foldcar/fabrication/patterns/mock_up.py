"""A paper prototype: the body of a car and plain discs for its wheels, scaled, to try the fold on before film is cut.

Input: a Design, Options for scissors and the scale. Output: the Pattern of a car of card, and a page of text. It has no
openings for parts, which are drawn only, and pins for axles: it rolls, and it does not drive. Card is as thick at every
scale: at 1:2 it takes 0.05 mm more at each wall than the caps leave, which paper gives.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import shapely

from foldcar.car.components.shape import on_circle
from foldcar.car.design import Design, compose
from foldcar.car.folded.model import Face, FoldedCar, Hole, Mark, Piece, PlacedPiece, Point, Pose
from foldcar.car.folded.placed import PlacedFace, place
from foldcar.car.folded.pose import translation
from foldcar.car.folded_car import folded_car
from foldcar.fabrication.patterns.options import OptionError, Options
from foldcar.fabrication.patterns.sheets import REFERENCE_MM, Pattern, pattern
from foldcar.figures.page import page_template

FILM = "card_160"
SCALES = (0.25, 1.0)
# Holes for the pins of the wheels, tooth-picks or split pins, are as large at every scale.
PIN_MM = 2.0
DISC_CORNERS = 72


def mock_up(design: Design, chosen: Options, scale: float, command: str = "") -> Pattern:
    """The sheets; OptionError for a scale outside 0.25 to 1, DesignError if the design cannot be made of card."""
    if not SCALES[0] <= scale <= SCALES[1]:
        raise OptionError(f"--mockup {scale:g}: not within {SCALES[0]:g} to {SCALES[1]:g} (scale of a paper prototype)")
    # A hinge's strip is of the same card.
    values = {key: value for key, value in design.values.items() if key != "H.thickness"}
    of_card = compose("_".join(design.modules), values, design.choices.changed({"film": FILM}))
    title = f"PAPER PROTOTYPE {scale_text(scale)}, not for driving: {design.title}"
    return pattern(mocked(folded_car(of_card), scale), chosen, title, command)


def scale_text(scale: float) -> str:
    """The scale as people write it."""
    whole = round(1 / scale)
    return f"scale 1:{whole}" if abs(whole * scale - 1) < 1e-9 else f"scale {scale:g}"


def mocked(car: FoldedCar, scale: float) -> FoldedCar:
    """The car of which a prototype is cut: its folded pieces and discs of the wheels' size, both scaled."""
    wheels = {axle.wheel for axle in car.axles}
    turning = {placed.piece for placed in car.placed if placed.body in wheels}
    kept = {piece.name for piece in car.pieces if piece.creases and piece.name not in turning}
    joins = tuple(join for join in car.joins if join.piece_a in kept and join.piece_b in kept)
    slots = {join.slot for join in joins if join.slot}
    pins = _pins(car, kept)
    disc = Face("disc", _circle(scale * car.axles[0].radius_mm, (0.0, 0.0)), (_pin("pin", (0.0, 0.0)),))
    thickness = car.parts.film.thickness_mm.value
    least = thickness + car.parts.assembly.slot_clearance_mm.value
    pieces = [
        replace(piece, faces=tuple(_scaled(face, scale, slots, least, pins.get((piece.name, face.name), ()))
                                   for face in piece.faces))
        for piece in car.pieces if piece.name in kept
    ]  # fmt: skip
    pieces.append(Piece("wheel", "wheel", (disc,), (), thickness, len(car.axles)))
    placed = [
        replace(one, pose=_smaller(one.pose, scale)) for one in car.placed if one.piece in kept
    ] + [PlacedPiece("wheel", i, axle.wheel, translation(*(scale * c for c in axle.center_mm)))
         for i, axle in enumerate(car.axles)]  # fmt: skip
    return replace(car, pieces=tuple(pieces), placed=tuple(placed), joins=joins, mounts=(), axles=(), hinges=(), wires=())


def how_to_fold(made: Pattern, scale: float) -> str:
    """A page in Markdown: what to print, cut, fold and join, and what the prototype does not show."""
    names = [piece.origin for piece in made.pieces]
    return page_template("foldcar.fabrication.patterns", "how_to_fold.md").render(
        made=made,
        scale=scale,
        bar_mm=REFERENCE_MM,
        bridge="bridge" in names,
        hinged=any("hinge strip" in name for name in names),
    )


def _scaled(face: Face, scale: float, slots: set[str], least_mm: float, pins: tuple[Point, ...]) -> Face:
    """The face with its joins' slots, wide enough for card, and pins' holes; openings and laid parts as outlines."""
    holes = [_slot(hole, scale, least_mm) for hole in face.holes if hole.name in slots]
    holes += [_pin(f"pin {i}", (scale * x, scale * y)) for i, (x, y) in enumerate(pins, 1)]
    marks = [Mark(mark.name, _times(mark.outline_mm, scale)) for mark in face.marks]
    openings = [hole for hole in face.holes if hole.kind == "opening" and hole.diameter_mm is None]
    names = ["servo" if "servo" in hole.name else hole.name.removesuffix(" opening") for hole in openings]
    marks += [
        Mark(f"{name} {i}" if names.count(name) > 1 else name, _times(hole.outline_mm, scale))
        for i, (name, hole) in enumerate(zip(names, openings, strict=True), 1)
    ]
    return replace(face, outline_mm=_times(face.outline_mm, scale), holes=tuple(holes), marks=tuple(marks))


def _slot(hole: Hole, scale: float, least_mm: float) -> Hole:
    outline = shapely.Polygon(_times(hole.outline_mm, scale))
    x0, y0, x1, y1 = outline.bounds
    wider = max(0.0, least_mm - min(x1 - x0, y1 - y0)) / 2
    grown = shapely.geometry.polygon.orient(outline.buffer(wider, join_style="mitre"))
    return replace(hole, outline_mm=tuple((float(x), float(y)) for x, y in grown.exterior.coords[:-1]))


def _pins(car: FoldedCar, kept: set[str]) -> Mapping[tuple[str, str], tuple[Point, ...]]:
    """Where the axles meet the walls: points of faces (mm, unscaled), by piece and face."""
    found: dict[tuple[str, str], tuple[Point, ...]] = {}
    walls = [face for faces in place(car).values() for face in faces if face.piece.name in kept]
    for axle in car.axles:
        at = np.array([axle.center_mm])

        def height(face: PlacedFace, at: np.ndarray = at) -> float:
            x, y, z = face.in_face(at)[0]
            within = face.polygon.envelope.contains(shapely.Point(x, y)) and face.face.role == "panel"
            return abs(float(z)) if within and abs(face.normal[1]) > 0.9 else math.inf

        wall = min((face for face in walls if face.body == axle.body), key=height)
        x, y, _ = wall.in_face(at)[0]
        key = (wall.piece.name, wall.face.name)
        found[key] = (*found.get(key, ()), (float(x), float(y)))
    return found


def _pin(name: str, at_mm: Point) -> Hole:
    return Hole(name, "axle", _circle(PIN_MM / 2, at_mm), PIN_MM, at_mm)


def _circle(radius_mm: float, at_mm: Point) -> tuple[Point, ...]:
    return tuple(on_circle(radius_mm, (2 * math.pi * i / DISC_CORNERS for i in range(DISC_CORNERS)), at_mm))


def _times(points: tuple[Point, ...], scale: float) -> tuple[Point, ...]:
    return tuple((scale * x, scale * y) for x, y in points)


def _smaller(pose: Pose, scale: float) -> Pose:
    return (*((*row[:3], scale * row[3]) for row in pose[:3]), pose[3])
