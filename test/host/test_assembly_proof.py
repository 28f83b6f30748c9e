"""The proof of assembly: cars that can be built pass, cars that cannot fail by the step and the parts."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from shapely.affinity import scale

from foldcar.car.design import DesignError
from foldcar.car.design import compose as compose_design
from foldcar.car.folded.model import Access, Face, FoldedCar, Hole, Mount, Pose, Solid
from foldcar.car.folded.pose import compose, inverse, rotation, translation
from foldcar.car.folded.pose import folded as folded_poses
from foldcar.car.folded_car import folded_car
from foldcar.car.parts.catalogue import DEFAULT_CHOICES
from foldcar.car.proof.plan import planned
from foldcar.car.proof.prove import assembly_steps, prove, prove_steps, service_steps
from foldcar.car.proof.step import AssemblyStep
from foldcar.fabrication.assembly.parts_list import parts_list
from foldcar.fabrication.assembly.view_steps import view_steps
from published_cars import car
from spoiled_car import with_block, with_faces, with_holes, with_mounts

NAMES = ("w65", "w95", "w115", "w180", "six", "hinged")


def found(car: FoldedCar) -> list[str]:
    return [str(finding) for finding in prove(car).findings]


def test_things_come_in_on_the_side_that_is_open() -> None:
    folded, steps = car("w95"), assembly_steps(car("w95"))
    ways = {one.name: one.way_mm for step in steps for one in step.adds}
    sides = {axle.wheel: 1 if axle.side == "left" else -1 for axle in folded.axles}
    wheels = {one.body: one.way_mm for step in steps for one in step.adds if one.kind == "unit" and one.body in sides}

    assert ways["bridge"][0][2] < 0
    assert ways["front left servo"][0][1] < 0 < ways["front right servo"][0][1]
    assert ways["front left servo screw 1"][0][1] < 0
    assert ways[folded.parts.battery.name][0][2] < 0
    assert wheels.keys() == sides.keys()
    assert all(len(way) == 1 and way[0][1] * sides[body] < 0 for body, way in wheels.items())


def test_usb_and_switch_are_reached_with_the_lid_shut_and_the_battery_changes_with_it_open() -> None:
    folded = car("w95")
    steps = service_steps(folded)
    opened = next(i for i, step in enumerate(steps) if step.folds)
    shut = {reach.name for step in steps[:opened] for reach in step.reaches}

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
    def narrower(hole: Hole) -> Hole:
        if hole.name != "W0.left servo.wall opening":
            return hole
        return replace(hole, outline_mm=tuple(scale(shapely.Polygon(hole.outline_mm), yfact=0.94).exterior.coords)[:-1])

    (finding,) = found(with_holes(car("w95"), narrower))

    assert "Screw the servos in" in finding and "front left servo" in finding and "beam: left" in finding


def test_screws_behind_a_disc_and_plugs_behind_a_wall_without_their_holes_are_not_reached() -> None:
    def closed(hole: Hole) -> Hole | None:
        return None if hole.name.endswith((".access", "USB")) or hole.name == "outer.access" else hole

    feather = car("w95").parts.feather.name

    findings = found(with_holes(car("w95"), closed))

    assert any("wheel screw 1 of wheel0 has no room for its driver: wheel outer disc" in one for one in findings)
    assert any(f"{feather}, the lid shut" in one and "no room for its plug: beam: left" in one for one in findings)


# The Feather's holes in its board's frame, from Adafruit's drawing; the module's edges lie at y = -9 and 9.
USB_HOLES, ANTENNA_HOLES = ((-22.86, 8.89), (-22.86, -8.89)), ((22.86, 9.525), (22.86, -9.589))


def on_board(feather: Mount, x: float, y: float, z: float) -> tuple[tuple[float, float, float, float], ...]:
    """The pose in the car of a point of the Feather's board, z from its underside."""
    return compose(feather.pose, translation(x, y, z - feather.size_mm[2] / 2))


def test_the_feather_is_screwed_where_nothing_covers_its_holes_and_a_pad_holds_its_other_end() -> None:
    folded = car("w95")
    feather = next(m for m in folded.mounts if m.part == folded.parts.feather.name)
    pad = next(m for m in folded.mounts if m.part == folded.parts.board_pad.name)
    screws = [m for m in folded.mounts if m.part == folded.parts.board_screw.name]
    at = sorted(tuple(round(compose(inverse(feather.pose), m.pose)[i][3], 6) for i in (0, 1)) for m in screws)
    center = compose(inverse(feather.pose), pad.pose)

    assert at == sorted(USB_HOLES)
    # Under the board's end, from film to board, clear of the header's pins, 10.16 mm from the middle.
    assert center[0][3] + pad.size_mm[1] / 2 == pytest.approx(25.4)
    assert abs(center[1][3]) + pad.size_mm[0] / 2 < 10.16 - 1
    assert center[2][3] + pad.size_mm[2] / 2 == pytest.approx(-feather.size_mm[2] / 2)


def test_screws_under_the_module_are_found() -> None:
    folded = car("w95")
    feather = next(m for m in folded.mounts if m.part == folded.parts.feather.name)

    def under(mount: Mount) -> Mount:
        here = compose(inverse(feather.pose), mount.pose)
        (x, y), *_ = (hole for hole in ANTENNA_HOLES if hole[1] * here[1][3] > 0)
        return replace(mount, pose=compose(feather.pose, translation(x + 22.86, y - here[1][3], 0), here))

    planted = found(with_mounts(folded, folded.parts.board_screw.name, under))

    for number in (1, 2):
        assert any(f"board screw {number} does not fit: at its place it runs into HUZZAH32" in one for one in planted)


def test_blocks_over_the_holes_are_found_as_parts_of_the_board_and_as_parts_of_their_own() -> None:
    folded = car("w95")
    feather = next(m for m in folded.mounts if m.part == folded.parts.feather.name)
    size, high = (8.0, 8.0, 8.0), 1.6 + 4.0

    def covered(mount: Mount) -> Mount:
        low = high - feather.size_mm[2] / 2
        blocks = (Solid("box", size, translation(x, y, low)) for x, y in USB_HOLES)
        return replace(mount, solids=(*mount.solids, *blocks))

    grown = found(with_mounts(folded, feather.part, covered))
    for number in (1, 2):
        assert any("does not fit" in one and f"board screw {number}" in one for one in grown), grown

    poses = (on_board(feather, x, y, high) for x, y in (*USB_HOLES, *ANTENNA_HOLES))
    alone = found(with_block(folded, *poses, size_mm=size))
    for i in range(4):
        assert any("does not fit" in one and f"block {i}" in one for one in alone), alone


def face_pose(car: FoldedCar, name: str) -> Pose:
    """The pose in the car of a face of its first beam."""
    beam = next(piece for piece in car.pieces if piece.name.startswith("beam"))
    placed = next(one for one in car.placed if one.piece == beam.name)
    return compose(placed.pose, folded_poses(beam)[name])


def blocked(car: FoldedCar) -> list[str]:
    return [one for one in found(car) if "block" in one.rpartition(": ")[2] and one.endswith("is in the way")]


# In a tongue's frame x runs along the car, y outwards and z down, from the flap's film; the lever is above it.
LEVER_Z = -15.0
# 1 mm off the film of lever or flap, 0.25 mm thick, lies the near side of a block of 2 mm.
OFF = 0.125 + 1 + 1


@pytest.mark.parametrize(
    ("at", "room"),
    [((5, OFF, LEVER_Z), "finger"), ((5, -OFF, LEVER_Z), "finger"), ((5, -OFF, 0), "tongue"), ((5, -6, -45), "finger")],
    ids=["outside the lever", "between lever and pull tab", "inside the tongue", "over the notch"],
)
def test_a_block_1_mm_off_a_latch_is_found(at: tuple[float, float, float], room: str) -> None:
    folded = car("w95")
    poses = [compose(face_pose(folded, f"{latch} tongue"), translation(*at)) for latch in ("front", "rear")]

    findings = blocked(with_block(folded, *poses))

    for latch in ("front", "rear"):
        assert any(f"beam: {latch} tongue has no room for its {room}: block" in one for one in findings), findings
    assert all("Push the levers outwards" in one for one in findings)


@pytest.mark.parametrize("side", [-1, 1])
def test_fingers_have_room_on_both_sides_of_a_pull_tab(side: int) -> None:
    folded = car("w95")
    pose = compose(face_pose(folded, "front pull tab"), translation(5, 5, side * OFF))

    assert any("front pull tab has no room for its finger" in one for one in blocked(with_block(folded, pose)))


def test_locks_pressed_in_from_outside_would_be_behind_the_wheels() -> None:
    largest = car("w95").parts.tools.finger_mm

    def pressed(face: Face) -> Face:
        if face.name not in ("front tongue", "rear tongue"):
            return face
        tip = compose(translation(5, face.outline_mm[2][1], 0), rotation("x", -1.5707963267948966))
        return replace(face, accesses=(Access("finger", tip, *largest),))

    findings = found(with_faces(car("w95"), pressed))

    assert len(findings) == 2
    for latch, finding in zip(("front", "rear"), sorted(findings), strict=True):
        assert f"beam: {latch} tongue has no room for its finger: wheel inner disc: inner is in the way" in finding


def in_front(car: FoldedCar, part: str, index: int, off_mm: float, beside_mm: float = 0.0) -> Pose:
    """The pose of a block of 2 mm before what is reached, so far from it and from the access's axis."""
    mount = next(m for m in car.mounts if m.part == part)
    return compose(mount.pose, mount.accesses[index].pose, translation(beside_mm, 0, off_mm + 1))


def test_blocks_in_front_of_what_is_pressed_or_plugged_are_found() -> None:
    folded = car("w95")
    # The USB socket's mouth lies 1.6 mm inside the wall's outer side.
    reached = [
        (folded.parts.switch.name, 0, 1.0, "finger", "Press rocker switch"),
        (folded.parts.feather.name, 0, 3.0, "plug", "lid shut"),
        (folded.parts.feather.name, 1, 1.0, "plug", "lid open"),
        (folded.parts.featherwing.name, 2, 1.0, "driver", "lid open"),
    ]

    findings = blocked(with_block(folded, *(in_front(folded, *one[:3]) for one in reached)))

    for i, (name, _, _, tool, state) in enumerate(reached):
        told = f"{name} has no room for its {tool}: block {i} is in the way"
        assert any(told in one and state in one for one in findings), (told, findings)


@pytest.mark.parametrize(("off_mm", "beside_mm", "met"), [(30, 8.7, True), (30, 10.0, False), (38, 0, False)])
def test_the_largest_finger_is_tried(off_mm: float, beside_mm: float, met: bool) -> None:
    # A finger of 14 + 3 mm reaches 8.5 mm from its axis, one of 25 + 10 mm 35 mm; the block reaches 1 mm from its middle.
    folded = car("w95")

    findings = blocked(with_block(folded, in_front(folded, folded.parts.switch.name, 0, off_mm, beside_mm)))

    assert bool(findings) == met


def test_a_battery_on_the_roof_keeps_off_a_latch() -> None:
    roof = DEFAULT_CHOICES.changed({"battery_place": "roof"})
    values = {"W.length": 130.0, "B.length": 60.0}
    with pytest.raises(DesignError, match=r"B\.length: 60 is below the minimum ([0-9.]+) .*latch") as refused:
        folded_car(compose_design("B_W_W", values, roof))

    least = float(str(refused.value).partition("minimum ")[2].split()[0])
    assert found(folded_car(compose_design("B_W_W", {**values, "B.length": least}, roof))) == []


def test_a_segment_too_short_for_a_latch_is_refused_with_what_would_do() -> None:
    with pytest.raises(DesignError, match=r"B\.length: 20 is below the minimum ([0-9.]+) .*latch"):
        folded_car(compose_design("W_B_W_B", {"B.length": 20, "W.length": 170}))


def swapped(steps: tuple[AssemblyStep, ...], first: str, second: str) -> tuple[AssemblyStep, ...]:
    """The steps with two things of one step in each other's place."""
    changed = []
    for step in steps:
        names = [one.name for one in step.adds]
        if first in names and second in names:
            adds, i, k = list(step.adds), names.index(first), names.index(second)
            adds[i], adds[k] = adds[k], adds[i]
            step = replace(step, adds=tuple(adds))
        changed.append(step)
    assert tuple(changed) != steps
    return tuple(changed)


@pytest.mark.parametrize(
    ("first", "second", "words"),
    [
        ("HUZZAH32 Feather", "board screw 1", "board screw 1 passes HUZZAH32 Feather, which is not there yet"),
        ("board screw 2", "8-channel Servo FeatherWing", "the nut of board screw 2 has no way out"),
        ("HUZZAH32 Feather", "8-channel Servo FeatherWing", "HUZZAH32 Feather has no way out"),
        ("front left servo", "front left servo screw 1", "passes front left servo, which is not there yet"),
        ("horn of wheel0", "centre screw of wheel0", "passes horn of wheel0, which is not there yet"),
    ],
)
def test_a_wrong_order_is_found(first: str, second: str, words: str) -> None:
    folded = car("w95")

    found = [str(finding) for finding in prove_steps(folded, swapped(planned(folded), first, second)).findings]

    assert any(words in one for one in found), found


def test_a_step_too_early_is_found() -> None:
    folded = car("w95")
    steps = list(planned(folded))
    shut = next(i for i, step in enumerate(steps) if step.title == "Shut the lid")
    steps.insert(9, steps.pop(shut))

    found = [str(finding) for finding in prove_steps(folded, steps).findings]

    assert any(folded.parts.battery.name in one and "beam: lid" in one for one in found), found


@pytest.mark.parametrize("name", ["w95", "hinged"])
def test_parts_list_and_view_follow_the_same_order(name: str) -> None:
    folded, steps = car(name), assembly_steps(car(name))
    parts = {mount.name: mount.part for mount in folded.mounts}
    used = dict.fromkeys(parts[one.name] for step in steps for one in step.adds if one.kind == "mount")
    shown = view_steps(folded)

    assert [row.name for row in parts_list(folded) if row.name in used] == list(used)
    for number, step in enumerate(steps, 1):
        starts = [
            next(begin for n, _, begin, _ in shown.ways[one.kind, one.name, one.copy] if n == number)
            for one in step.adds if one.kind != "unit"
        ]  # fmt: skip
        assert starts == sorted(starts)
        for one in (one for one in step.adds if one.nut_mm):
            (first, *_) = [way for n, way, _, _ in shown.ways["nut", one.name, 0] if n == number]
            assert np.allclose(first[0], -np.array(one.nut_mm[-1]), atol=1e-3)
