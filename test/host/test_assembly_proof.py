"""The proof of assembly: cars that can be built pass, cars that cannot fail by the step and the parts."""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from foldcar.car.assembly.order import assembly_steps, service_steps
from foldcar.car.assembly.prove import prove
from foldcar.car.design import compose as compose_design
from foldcar.car.folded.model import Face, FoldedCar, Mount
from foldcar.car.folded.pose import compose, translation
from foldcar.car.folded_car import folded_car
from foldcar.car.parts.choices import DEFAULT_CHOICES
from foldcar.study.family import read_family
from foldcar.study.listing_file import read_listing

PATTERNS = Path(__file__).parents[2] / "patterns"
NAMES = ("w65", "w95", "w115", "w180", "six", "hinged")


@cache
def car(name: str) -> FoldedCar:
    for file in PATTERNS.glob("*.json"):
        listing, _ = read_listing(file)
        if name in listing.vehicles:
            return folded_car(read_family(file, name, listing.vehicles[name]).single())
    raise KeyError(name)


def found(car: FoldedCar) -> list[str]:
    return [str(finding) for finding in prove(car).findings]


def with_faces(car: FoldedCar, changed: Callable[[Face], Face]) -> FoldedCar:
    pieces = tuple(replace(piece, faces=tuple(changed(face) for face in piece.faces)) for piece in car.pieces)
    return replace(car, pieces=pieces)


def with_mounts(car: FoldedCar, part: str, changed: Callable[[Mount], Mount]) -> FoldedCar:
    return replace(car, mounts=tuple(changed(mount) if mount.part == part else mount for mount in car.mounts))


@pytest.mark.parametrize("name", NAMES)
def test_every_car_can_be_put_together_and_serviced(name: str) -> None:
    assert found(car(name)) == []


@pytest.mark.parametrize("name", ["w95", "hinged"])
def test_the_steps_use_every_part_once_make_every_join_once_and_close_every_fold(name: str) -> None:
    folded, steps = car(name), assembly_steps(car(name))
    added = Counter((one.kind, one.name, one.copy) for step in steps for one in step.adds if one.kind != "unit")
    joined = Counter(number for step in steps for number in step.joins)
    closed: dict[tuple[str, str], float] = {}
    for step in steps:
        closed.update({(piece, crease): share for piece, folds in step.folds.items() for crease, share in folds.items()})

    things = [("piece", one.piece, one.copy) for one in folded.placed] + [("mount", m.name, 0) for m in folded.mounts]
    assert added == Counter(things)
    assert joined == Counter({join.number for join in folded.joins})
    assert closed == {(piece.name, crease.name): 1.0 for piece in folded.pieces for crease in piece.creases}


def test_things_come_in_on_the_side_that_is_open() -> None:
    ways = {one.name: one.way_mm for step in assembly_steps(car("w95")) for one in step.adds}

    assert ways["bridge"][0][2] < 0
    assert ways["front left servo"][0][1] < 0 < ways["front right servo"][0][1]
    assert ways["front left servo screw 1"][0][1] < 0
    assert ways[car("w95").parts.battery.name][0][2] < 0


def test_usb_and_switch_are_reached_with_the_lid_shut_and_the_battery_changes_with_it_open() -> None:
    folded = car("w95")
    steps = service_steps(folded)
    opened = next(i for i, step in enumerate(steps) if step.folds)
    shut = {reach.mount for step in steps[:opened] for reach in step.reaches}

    assert {folded.parts.feather.name, folded.parts.switch.name} <= shut
    assert [one.name for step in steps[opened:] for one in step.adds] == [folded.parts.battery.name]


def test_a_battery_on_the_roof_is_put_on_last_and_taken_off_first() -> None:
    folded = folded_car(compose_design("W_B_W", {"width": 95}, DEFAULT_CHOICES.changed({"battery_place": "roof"})))

    assert found(folded) == []
    assert [one.name for one in assembly_steps(folded)[-1].adds] == [folded.parts.battery.name]
    assert [step.adds != () for step in service_steps(folded) if step.adds or step.folds] == [True, False]


def test_a_lid_that_is_glued_shut_leaves_no_way_for_what_is_inside() -> None:
    folded = car("w95")
    glued = replace(folded, joins=tuple(replace(j, kind="tab") if j.kind == "lock" else j for j in folded.joins))

    findings = found(glued)

    for name in (folded.parts.battery.name, folded.parts.lipo.name, "bridge"):
        (finding,) = (one for one in findings if one.startswith("assembly: step") and f": {name}" in one)
        assert "has no way out" in finding and "along +z it meets beam: lid" in finding
    assert any(one.startswith("assembly: service") and folded.parts.battery.name in one for one in findings)


def test_a_battery_higher_than_the_room_keeps_the_lid_from_shutting() -> None:
    folded = car("w95")
    battery = folded.parts.battery.name

    def higher(mount: Mount) -> Mount:
        x, y, z = mount.size_mm
        return replace(mount, size_mm=(x, y, z + 22), pose=compose(mount.pose, translation(0, 0, 11)))

    (finding, *_) = found(with_mounts(folded, battery, higher))

    assert "Shut the lid" in finding and "does not shut" in finding and finding.endswith(f"it meets {battery}")


def test_a_servo_does_not_pass_an_opening_that_is_too_small() -> None:
    def narrower(face: Face) -> Face:
        holes = [
            replace(hole, outline_mm=tuple((x, y * 0.96 + hole.center_mm[1] * 0.04) for x, y in hole.outline_mm))
            if hole.name == "W0.left servo.wall opening" and hole.center_mm
            else hole
            for hole in face.holes
        ]
        return replace(face, holes=tuple(holes))

    findings = found(with_faces(car("w95"), narrower))

    assert len(findings) == 1
    assert "Screw the servos in" in findings[0] and "front left servo" in findings[0] and "beam: left" in findings[0]


def test_a_screw_behind_a_disc_without_its_hole_is_not_reached() -> None:
    closed = with_faces(car("w95"), lambda face: replace(face, holes=()) if face.name == "outer" else face)

    findings = found(closed)

    assert any("wheel screw 1 of wheel0 has no room for its driver: wheel outer disc" in one for one in findings)


def test_a_plug_needs_its_slot_in_the_wall() -> None:
    def closed(face: Face) -> Face:
        return replace(face, holes=tuple(hole for hole in face.holes if "usb" not in hole.name.lower()))

    feather = car("w95").parts.feather.name

    (finding,) = found(with_faces(car("w95"), closed))

    assert f"{feather}, the lid shut" in finding and "no room for its plug: beam: left" in finding


def test_a_part_too_large_for_its_place_is_named_with_what_it_runs_into() -> None:
    folded = car("w95")
    wide = with_mounts(folded, folded.parts.battery.name, lambda m: replace(m, size_mm=(60.0, *m.size_mm[1:])))

    (finding, *_) = (one for one in found(wide) if folded.parts.battery.name in one)

    assert "does not fit: at its place it runs into" in finding


def test_wheels_go_on_from_their_own_side() -> None:
    steps = assembly_steps(car("w95"))
    sides = {axle.wheel: 1 if axle.side == "left" else -1 for axle in car("w95").axles}
    ways = {one.body: one.way_mm for step in steps for one in step.adds if one.kind == "unit" and one.body in sides}

    assert ways.keys() == sides.keys()
    assert all(len(way) == 1 and way[0][1] * sides[body] < 0 for body, way in ways.items())
