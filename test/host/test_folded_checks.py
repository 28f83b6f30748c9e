"""The verification has no findings for cars that can be built, and finds every planted defect."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from foldcar.car.components.shape import rectangle_around
from foldcar.car.design import compose
from foldcar.car.folded.model import Crease, EdgeRef, Face, FoldedCar, Hole, Piece
from foldcar.car.folded_car import folded_car
from foldcar.car.proof.prove import prove
from foldcar.car.verify import check_design, verify
from spoiled_car import moved, with_faces, with_holes, with_mounts

Spoil = Callable[[FoldedCar], FoldedCar]


def with_piece(name: str, change: Callable[[Piece], Piece]) -> Spoil:
    """The car with one of its pieces changed."""
    return lambda car: replace(car, pieces=tuple(change(p) if p.name == name else p for p in car.pieces))


def with_face(piece: str, face: str, change: Callable[[Face], Face]) -> Spoil:
    """The car with one of its faces changed."""
    return lambda car: with_faces(car, lambda one: change(one) if one.name == face else one, piece)


def stretched(dx: float, dy: float) -> Callable[[Face], Face]:
    """The face with its points right of and above its origin moved."""
    return lambda face: replace(face, outline_mm=tuple((x + dx * (x > 0), y + dy * (y > 0)) for x, y in face.outline_mm))


def reversed_outline(face: Face) -> Face:
    """The face with its points the other way round."""
    return replace(face, outline_mm=face.outline_mm[::-1])


def with_angle(piece: str, crease: str, degrees: float) -> Spoil:
    """The car with one fold of another angle."""

    def spoil(old: Piece) -> Piece:
        assert any(one.name == crease for one in old.creases), [one.name for one in old.creases]
        creases = [replace(c, angle_rad=math.radians(degrees)) if c.name == crease else c for c in old.creases]
        return replace(old, creases=tuple(creases))

    return with_piece(piece, spoil)


def without_joins(kind: str) -> Spoil:
    """The car without any join of a kind."""
    return lambda car: replace(car, joins=tuple(join for join in car.joins if join.kind != kind))


def with_hole(piece: str, face: str, center: tuple[float, float], size: float = 3.0) -> Spoil:
    """The car with one more square hole."""
    hole = Hole("extra", "vent", rectangle_around(center, size, size))
    return with_face(piece, face, lambda old: replace(old, holes=(*old.holes, hole)))


def with_holes_moved(piece: str, face: str, kind: str, dx: float) -> Spoil:
    """The car with the holes of a kind moved along x."""

    def shifted(hole: Hole) -> Hole:
        return replace(hole, outline_mm=tuple((x + dx, y) for x, y in hole.outline_mm)) if hole.kind == kind else hole

    return lambda car: with_holes(car, shifted, piece, face)


def with_mount_moved(name: str, x: float, y: float, z: float) -> Spoil:
    """The car with a part shifted."""
    return lambda car: with_mounts(car, name, lambda mount: moved(mount, x, y, z))


def with_axle_moved(wheel: str, x: float, y: float) -> Spoil:
    """The car with a wheel's axle shifted."""

    def moved(axle: Any) -> Any:
        cx, cy, cz = axle.center_mm
        return replace(axle, center_mm=(cx + x, cy + y, cz)) if axle.wheel == wheel else axle

    return lambda car: replace(car, axles=tuple(moved(axle) for axle in car.axles))


def with_a_tab_that_is_long(car: FoldedCar) -> FoldedCar:
    """The front cap's tab on the left side reaches over the servo's opening."""
    return with_face(
        "front cap", "cap tab to left", lambda f: replace(f, outline_mm=tuple((x, y * 3) for x, y in f.outline_mm))
    )(car)


def with_a_face_cut_twice(old: Piece) -> Piece:
    """A second flange in the place of the first one."""
    flange = next(face for face in old.faces if face.name == "flange")
    crease = next(crease for crease in old.creases if crease.child.face == "flange")
    twin = Crease("twin", crease.parent, EdgeRef("twin", crease.child.index), crease.angle_rad)
    return replace(old, faces=(*old.faces, replace(flange, name="twin")), creases=(*old.creases, twin))


@pytest.mark.parametrize(
    ("type_string", "values"),
    [
        ("W_B_W", {"height": 47.8, "B.length": 66, "radius": 30}),
        ("W_B_W", {"W.length": 46, "radius": 30, "W.tire_thickness": 8}),
        ("W_B", {"radius": 150, "height": 80, "B.length": 170}),
        ("B_W_W_W_W", {"W.length": 70, "radius": 30}),
        ("B_H_W", {"H.fold_up": 6, "H.thickness": 0.127}),
        ("W_H_B_H_W", {"H.length": 20, "H.fold_up": 12, "W.length": 80}),
    ],
)
def test_cars_that_can_be_built_pass(type_string: str, values: dict[str, float]) -> None:
    verification = verify(compose(type_string, values))

    assert verification.findings == ()
    assert verification.worst_gap_mm < 1e-6
    assert verification.joins > 10 and verification.folds > 10
    assert 0 < verification.roundness_mm < 0.3


def test_the_study_car_encloses_its_box_and_one_of_another_size_is_found() -> None:
    verification = verify(compose("W_B_W", {}))

    assert verification.volumes_mm3["segment0"] == pytest.approx(200 * 94.75 * 49.75, rel=1e-9)
    assert verification.lines()[-1] == "flat, folded, parts, wheels, fits, leads, assembly: nothing found"
    wider = check_design(folded_car(compose("W_B_W", {"width": 96})), {"segment0": 200 * 94.75 * 49.75}).findings
    assert [one.check for one in wider] == ["volume"]


@pytest.mark.parametrize(
    ("spoil", "check", "words"),
    [
        (with_face("front cap", "cap", stretched(1.5, 0)), "closure", "apart, the limit is 0.05 mm"),
        (with_face("front cap", "cap", stretched(1.5, 0)), "fold", "1.500 mm apart; limit 0.05 mm"),
        (with_face("beam", "lid", stretched(0, -1.5)), "tuck", "apart, the limit is 0.55 mm"),
        (with_face("beam", "lid", stretched(0, 0.4)), "crossing", "beam: right: lies in the film of beam: flap"),
        (with_angle("beam", "left to lid", 85), "tuck", "apart"),
        (with_angle("beam", "lid to flap", 80), "slot", "do not go through"),
        (without_joins("tab"), "skin", "segment0: has no faces that are glued to a skin"),
        (without_joins("tuck"), "skin", "beam: lid: edge 1 meets no other face"),
        (with_angle("front cap", "cap tab to left", 85), "tab", "off the face it is glued to"),
        (with_hole("beam", "lid", (-50, 0.5)), "hole", "mm from a fold, the limit is 2 mm"),
        (with_hole("beam", "lid", (-50, 0.5)), "outline", "the hole is not inside its face"),
        (with_hole("beam", "lid", (-50, 3)), "hole", "is 1.50 mm from a fold, the limit is 2 mm"),
        (with_hole("beam", "left", (24, 24.9)), "outline", "runs into another one"),
        (with_a_tab_that_is_long, "tab", "lie beside its face or over a hole in it"),
        (with_face("bridge", "flange", stretched(0, 3)), "crossing", "runs through bridge: flange"),
        (with_piece("bridge", with_a_face_cut_twice), "overlap", "overlaps twin"),
        (with_piece("bridge", with_a_face_cut_twice), "duplicate", "shares a cut with flange"),
        (with_face("wheel inner disc", "inner", reversed_outline), "outline", "clockwise"),
        (with_holes_moved("beam", "right", "slot", 5.0), "slot", "do not go through"),
        (with_holes_moved("beam", "floor", "slot", 5.0), "crossing", "bridge: flange"),
        (with_holes_moved("servo doubler", "doubler", "opening", 2.0), "laminate", "holes on holes"),
        (with_face("beam", "rear tongue", stretched(0, -2.2)), "slot", "inside the slot"),
        (with_mount_moved("front left servo", -3, 0, 0), "assembly", "it runs into beam: left"),
        (with_holes_moved("bridge", "shelf", "screw", 0.5), "parts", "Feather: is 0.50 mm off its hole B1.board"),
        (with_holes_moved("beam", "left", "opening", 1.0), "parts", "servo: is 1.00 mm off its hole W0.left servo"),
        (with_mount_moved("500 mAh LiPo", 0, 0, 4), "assembly", "does not fit: at its place it runs into 500 mAh LiPo"),
        (with_mount_moved("square 4xAA holder", 5, 0, 0), "assembly", "holder does not fit: at its place it"),
        (with_mount_moved("front left servo screw 1", 0, -3, 0), "assembly", "servo screw 1 does not fit"),
        (with_axle_moved("wheel2", 20, 0), "wheels", "is 0.00 mm from wheel2"),
        (with_axle_moved("wheel1", 0, 13), "wheels", "runs into front right servo"),
        (with_axle_moved("wheel1", 0, 20), "wheels", "runs into beam: right"),
    ],
)  # fmt: skip
def test_broken_designs_are_found(spoil: Spoil, check: str, words: str) -> None:
    car = spoil(folded_car(compose("W_B_W", {})))

    findings = [*check_design(car).findings, *(prove(car).findings if check == "assembly" else ())]

    assert any(one.check == check and words in str(one) for one in findings), "\n".join(map(str, findings))


def with_hinge(**changes: float) -> FoldedCar:
    """A hinged car whose joint exceeds what its geometry permits."""
    car = folded_car(compose("W_B_H_W", {"W.length": 70, "radius": 36}))
    return replace(car, hinges=tuple(replace(hinge, **changes) for hinge in car.hinges))


def test_hinges_are_checked_at_their_limits() -> None:
    assert check_design(with_hinge()).findings == ()
    # The stop reaches to the other cap; the lids, 6 mm apart and 49.75 mm above the strip, meet at 6.9 degrees.
    stopped = check_design(with_hinge(max_rad=math.radians(4))).findings
    assert stopped and all("folded by 4.0 degrees: hinge stop: side" in str(one) for one in stopped)
    met = check_design(with_hinge(max_rad=math.radians(9))).findings
    assert any("folded by 9.0 degrees: rear cap 1: cap runs through front cap 2: cap" in str(one) for one in met)
    # At axle height the strip would let the floors run into each other over a crest.
    down = check_design(with_hinge(center_mm=(-40.0, 0.0, 0.0))).findings
    assert any("folded by -60.0 degrees: beam 1: floor runs through" in str(one) for one in down)


def test_wheels_are_checked_at_the_limits_of_hinges() -> None:
    car = folded_car(compose("B_W_H_W", {"W.length": 120, "radius": 60.3, "H.fold_up": 5}))
    assert check_design(car).findings == ()

    up = replace(car, hinges=tuple(replace(hinge, max_rad=math.radians(6)) for hinge in car.hinges))

    # 2 · (63 · cos 3° - 25.1 · sin 3°) = 123.2, less 120.6.
    assert [str(one) for one in check_design(up).findings if "wheel0" in str(one)] == [
        "hinge: between segment0 and segment1, folded by 6.0 degrees: wheel0 is 2.60 mm from wheel2, the limit is 3 mm",
    ]
