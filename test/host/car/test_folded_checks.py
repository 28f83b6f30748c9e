"""The verification has no findings for cars that can be built, and finds every planted defect."""

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from foldcar.car.components.shape import rectangle_around
from foldcar.car.design import compose
from foldcar.car.folded.model import Crease, EdgeRef, Face, FoldedCar, Hole, Piece
from foldcar.car.folded_car import folded_car
from foldcar.car.proof.prove import prove
from foldcar.car.verify import check_folded_car, verify
from spoiled_car import moved, with_faces, with_holes, with_mounts

Spoil = Callable[[FoldedCar], FoldedCar]


def with_piece(name: str, change: Callable[[Piece], Piece]) -> Spoil:
    """The car with one of its pieces changed."""
    return lambda car: replace(car, pieces=tuple(change(p) if p.name == name else p for p in car.pieces))


def with_face(piece: str, face: str, change: Callable[[Face], Face]) -> Spoil:
    """The car with one of its faces changed."""
    return lambda car: with_faces(car, lambda old_face: change(old_face) if old_face.name == face else old_face, piece)


def stretched(dx: float, dy: float) -> Callable[[Face], Face]:
    """The face with its points right of and above its origin moved."""
    return lambda face: replace(face, outline_mm=tuple((x + dx * (x > 0), y + dy * (y > 0)) for x, y in face.outline_mm))


def reversed_outline(face: Face) -> Face:
    """The face with its points the other way round."""
    return replace(face, outline_mm=face.outline_mm[::-1])


def with_angle(piece: str, crease: str, degrees: float) -> Spoil:
    """The car with one fold of another angle."""

    def spoil(old: Piece) -> Piece:
        assert any(old_crease.name == crease for old_crease in old.creases), [
            old_crease.name for old_crease in old.creases
        ]
        creases = [replace(c, angle_rad=math.radians(degrees)) if c.name == crease else c for c in old.creases]
        return replace(old, creases=tuple(creases))

    return with_piece(piece, spoil)


def with_hole(piece: str, face: str, center: tuple[float, float], size: float = 3.0) -> Spoil:
    """The car with one more square hole."""
    hole = Hole("extra", "vent", rectangle_around(center, size, size))
    return with_face(piece, face, lambda old: replace(old, holes=(*old.holes, hole)))


def with_holes_moved(piece: str, face: str, kind: str, dx: float) -> Spoil:
    """The car with the holes of a kind moved along x."""

    def shifted(hole: Hole) -> Hole:
        return replace(hole, outline_mm=tuple((x + dx, y) for x, y in hole.outline_mm)) if hole.kind == kind else hole

    return lambda car: with_holes(car, shifted, piece, face)


def with_a_tab_that_is_long(car: FoldedCar) -> FoldedCar:
    """The front cap's tab on the left side reaches over the servo's opening."""
    return with_face(
        "front cap", "cap tab to left", lambda f: replace(f, outline_mm=tuple((x, y * 3) for x, y in f.outline_mm))
    )(car)


def with_a_twin(old: Piece) -> Piece:
    """A second flange in the place of the first one."""
    flange = next(face for face in old.faces if face.name == "flange")
    crease = next(crease for crease in old.creases if crease.child.face == "flange")
    twin = Crease("twin", crease.parent, EdgeRef("twin", crease.child.index), crease.angle_rad)
    return replace(old, faces=(*old.faces, replace(flange, name="twin")), creases=(*old.creases, twin))


@pytest.mark.parametrize(
    ("type_string", "values"),
    [
        ("W_B_W", {"height": 47.8, "B.length": 66, "radius": 30}),
        ("B_W_W_W_W", {"W.length": 70, "radius": 30}),
        ("W_H_B_H_W", {"H.length": 20, "H.fold_up": 12, "W.length": 80}),
    ],
)
def test_cars_that_can_be_built_pass(type_string: str, values: dict[str, float]) -> None:
    assert verify(compose(type_string, values)).findings == ()


@pytest.mark.parametrize(
    ("spoil", "check", "words"),
    [
        (with_face("front cap", "cap", stretched(1.5, 0)), "closure", "apart, the limit is 0.05 mm"),
        (with_face("beam", "lid", stretched(0, 0.4)), "crossing", "beam: right: runs into beam: flap"),
        (with_angle("beam", "lid to flap", 80), "slot", "do not go through"),
        (with_angle("front cap", "cap tab to left", 85), "tab", "off the face it is glued to"),
        (with_hole("beam", "lid", (-50, 0.5)), "hole", "mm from a fold, the limit is 2 mm"),
        (with_hole("beam", "lid", (-50, 0.5)), "outline", "the hole is not inside its face"),
        (with_hole("beam", "left", (24, 24.9)), "outline", "runs into another one"),
        (with_a_tab_that_is_long, "tab", "lie beside its face or over a hole in it"),
        (with_face("bridge", "flange", stretched(0, 3)), "crossing", "beam: floor: runs into bridge: flange"),
        (with_piece("bridge", with_a_twin), "overlap", "overlaps twin"),
        (with_face("wheel inner disc", "inner", reversed_outline), "outline", "clockwise"),
        (with_holes_moved("beam", "right", "slot", 5.0), "slot", "do not go through"),
        (with_holes_moved("beam", "floor", "slot", 5.0), "crossing", "bridge: flange"),
        (with_face("beam", "rear tongue", stretched(0, -2.2)), "slot", "inside the slot"),
    ],
)  # fmt: skip
def test_broken_designs_are_found(spoil: Spoil, check: str, words: str) -> None:
    car = spoil(folded_car(compose("W_B_W", {})))

    findings = check_folded_car(car)

    assert any(finding.check == check and words in str(finding) for finding in findings), "\n".join(map(str, findings))


def test_parts_that_are_out_of_place_are_found() -> None:
    spoiled = folded_car(compose("W_B_W", {}))
    places = {"front left servo": (-3, 0, 0), "500 mAh LiPo": (0, 0, 4), "rear left servo screw 1": (0, -3, 0)}
    for name, at in places.items():
        spoiled = with_mounts(spoiled, name, lambda mount, at=at: moved(mount, *at))

    findings = "\n".join(map(str, prove(spoiled).findings))

    assert "front left servo does not fit: at its place it runs into beam: left" in findings
    assert "does not fit: at its place it runs into 500 mAh LiPo" in findings
    assert "rear left servo screw 1 does not fit" in findings


def with_hinge(**changes: float) -> FoldedCar:
    """A hinged car whose joint exceeds what its geometry permits."""
    car = folded_car(compose("W_B_H_W", {"W.length": 70, "radius": 36}))
    return replace(car, hinges=tuple(replace(hinge, **changes) for hinge in car.hinges))


def test_hinges_are_checked_at_their_limits() -> None:
    assert check_folded_car(with_hinge()) == []
    # The stop reaches to the other cap; the lids, 6 mm apart and 49.75 mm above the strip, meet at 6.9 degrees.
    stopped = check_folded_car(with_hinge(max_rad=math.radians(4)))
    assert stopped and all(
        "folded by 4.0 degrees: front cap 2: cap runs into hinge stop" in str(finding) for finding in stopped
    )
    met = check_folded_car(with_hinge(max_rad=math.radians(9)))
    assert any("folded by 9.0 degrees: front cap 2: cap runs into rear cap 1: cap" in str(finding) for finding in met)
    # At axle height the strip would let the floors run into each other over a crest.
    down = check_folded_car(with_hinge(center_mm=(-40.0, 0.0, 0.0)))
    assert any("folded by -60.0 degrees: beam 2: floor runs into beam 1: floor" in str(finding) for finding in down)
