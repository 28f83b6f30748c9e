"""The proof of assembly: cars that can be built pass, cars that cannot fail by the step and the parts."""

import re
from dataclasses import replace

import numpy as np
import pytest
import shapely
from shapely.affinity import scale

from foldcar.car.components.mounts import BOARD_SWITCH, SERVO_SWITCH
from foldcar.car.design import DesignError
from foldcar.car.design import compose as compose_design
from foldcar.car.fits import check_fits
from foldcar.car.folded.model import FoldedCar, Hole, Mount, Pose, Solid
from foldcar.car.folded.pose import compose, inverse, translation
from foldcar.car.folded.pose import folded as folded_poses
from foldcar.car.folded_car import folded_car
from foldcar.car.parts.catalogue import DEFAULT_CHOICES, catalogue_of
from foldcar.car.proof.plan import plan_assembly
from foldcar.car.proof.prove import assembly_steps, prove, prove_steps, service_steps
from foldcar.car.proof.step import AssemblyStep
from foldcar.fabrication.assembly.parts_list import parts_list
from foldcar.fabrication.assembly.view_steps import view_steps
from published_cars import car
from spoiled_car import with_block, with_holes, with_mounts

ROOF = DEFAULT_CHOICES.changed({"battery_place": "roof"})


def assembly_findings(car: FoldedCar) -> list[str]:
    return [str(finding) for finding in prove(car).findings]


def mount_of(car: FoldedCar, part: str) -> Mount:
    """The first mount of a part."""
    return next(mount for mount in car.mounts if mount.part == part)


def test_things_come_in_on_the_side_that_is_open_and_the_battery_changes_with_the_lid_open() -> None:
    folded, steps = car("w95"), assembly_steps(car("w95"))
    ways = {add.name: add.way_mm for step in steps for add in step.adds}
    sides = {axle.wheel: 1 if axle.side == "left" else -1 for axle in folded.axles}
    wheels = {add.body: add.way_mm for step in steps for add in step.adds if add.kind == "unit" and add.body in sides}

    assert ways["bridge"][0][2] < 0
    assert ways["front left servo"][0][1] < 0 < ways["front right servo"][0][1]
    assert ways["front left servo screw 1"][0][1] < 0
    assert ways[folded.parts.battery.name][0][2] < 0
    assert wheels.keys() == sides.keys()
    assert all(len(way) == 1 and way[0][1] * sides[body] < 0 for body, way in wheels.items())

    service = service_steps(folded)
    opened = next(i for i, step in enumerate(service) if step.folds)
    shut = {reach.name for step in service[:opened] for reach in step.tool_uses}
    assert {folded.parts.feather.name, SERVO_SWITCH, BOARD_SWITCH} <= shut
    assert [add.name for step in service[opened:] for add in step.adds] == [folded.parts.battery.name]


def test_leads_of_a_battery_on_the_roof_pass_the_lid_before_they_are_soldered() -> None:
    folded = folded_car(compose_design("W_B_W", {"width": 95}, ROOF))
    battery, switch = folded.parts.battery.name, SERVO_SWITCH
    steps = list(assembly_steps(folded))
    on_lid, soldered = (
        next(n for n, step in enumerate(steps) if any(add.name == part for add in step.adds))
        for part in (battery, switch)
    )

    assert assembly_findings(folded) == []
    assert on_lid < soldered
    # Soldered first, the leads cannot pass; without their hole they cannot either.
    steps[on_lid], steps[soldered] = steps[soldered], steps[on_lid]
    late = [str(finding) for finding in prove_steps(folded, steps).findings]
    assert any(f"leads of {battery} must pass the lid, but are joined to {switch} already" in text for text in late), late
    shut = with_holes(folded, lambda hole: None if hole.name.endswith("lead") else hole)
    assert any(f"{battery} does not fit: at its place it runs into beam: lid" in text for text in assembly_findings(shut))


@pytest.mark.parametrize(("width", "film"), [(65, "0.25"), (95, "card_300"), (245, "0.25")])
def test_the_place_of_a_battery_on_the_roof_is_seen_on_both_sides_and_clear_of_folds(width: float, film: str) -> None:
    folded = folded_car(compose_design("W_B_W", {"width": width}, ROOF.changed({"film": film})))
    (lid,) = [face for piece in folded.pieces for face in piece.faces if face.name == "lid"]
    ys = [y for _, y in lid.outline_mm]

    assert lid.marks == ()
    for part in (folded.parts.battery, folded.parts.pad):
        corners = [hole.center_mm for hole in lid.holes if hole.name.rpartition(".")[2].startswith(f"{part.name} corner")]
        assert len(corners) == 4
        (x0, y0), (x1, y1) = np.min(corners, axis=0), np.max(corners, axis=0)
        assert (x1 - x0, y1 - y0) == pytest.approx((part.width_mm.value, part.length_mm.value))
        assert y0 - 0.6 >= 2 - 1e-6 and y1 + 0.6 <= max(ys) - 2 + 1e-6


def test_a_battery_on_the_roof_is_taken_off_first() -> None:
    folded = folded_car(compose_design("W_B_W", {"width": 95}, ROOF))

    assert [step.adds != () for step in service_steps(folded) if step.adds or step.folds] == [True, False]


@pytest.mark.parametrize(
    ("type_string", "values", "roof"),
    [("B_W_W", {"W.length": 130.0, "B.length": 60.0}, True), ("W_B_W_B", {"B.length": 20, "W.length": 170}, False)],
)
def test_a_module_too_short_for_a_latch_is_refused_with_what_would_do(
    type_string: str, values: dict[str, float], roof: bool
) -> None:
    choices = ROOF if roof else DEFAULT_CHOICES
    with pytest.raises(DesignError, match=r"B\.length: \d+ is below the minimum ([0-9.]+) .*latch") as refused:
        folded_car(compose_design(type_string, values, choices))

    (least,) = re.findall(r"minimum ([0-9.]+)", str(refused.value))
    if roof:
        assert (
            assembly_findings(folded_car(compose_design(type_string, {**values, "B.length": float(least)}, choices)))
            == []
        )


def test_a_lid_that_is_glued_shut_leaves_no_way_for_what_is_inside() -> None:
    folded = car("w95")
    glued = replace(folded, joins=tuple(replace(j, kind="tab") if j.kind == "lock" else j for j in folded.joins))

    findings = assembly_findings(glued)

    for name in (folded.parts.battery.name, folded.parts.lipo.name, "bridge"):
        (finding,) = (finding for finding in findings if finding.startswith("assembly: step") and f": {name}" in finding)
        assert "has no way out" in finding and "along +z it meets beam: lid" in finding
    assert any(finding.startswith("assembly: service") and folded.parts.battery.name in finding for finding in findings)


def test_openings_that_are_missing_or_too_small_and_a_battery_that_is_too_high_are_found() -> None:
    folded = car("w95")
    battery, feather = folded.parts.battery.name, folded.parts.feather.name

    def spoiled(hole: Hole) -> Hole | None:
        if hole.name == "W1.left servo.wall opening":
            smaller = scale(shapely.Polygon(hole.outline_mm), yfact=0.94)
            return replace(hole, outline_mm=tuple(smaller.exterior.coords)[:-1])
        return None if hole.name.endswith(("USB", "outer.access")) else hole

    def higher(mount: Mount) -> Mount:
        x, y, z = mount.size_mm
        return replace(mount, size_mm=(x, y, z + 22), pose=compose(mount.pose, translation(0, 0, 11)))

    findings = assembly_findings(with_mounts(with_holes(folded, spoiled), battery, higher))

    for words in (
        ("Screw the servos in", "front left servo", "beam: left"),
        ("wheel screw 1 of wheel0 has no room for its driver: wheel outer disc",),
        (f"{feather}, the lid shut", "no room for its plug: beam: left"),
        ("Shut the lid", "does not shut", f"it meets {battery}"),
    ):
        assert any(all(word in finding for word in words) for finding in findings), (words, findings)


# The Feather's holes in its board's frame, from Adafruit's drawing; the module's edges lie at y = -9 and 9.
USB_HOLES, ANTENNA_HOLES = ((-22.86, 8.89), (-22.86, -8.89)), ((22.86, 9.525), (22.86, -9.589))


def test_the_feather_is_screwed_where_nothing_covers_its_holes_and_a_pad_holds_its_other_end() -> None:
    folded = car("w95")
    feather, pad = mount_of(folded, folded.parts.feather.name), mount_of(folded, folded.parts.board_pad.name)
    screws = [m for m in folded.mounts if m.part == folded.parts.board_screw.name]
    at = sorted(tuple(round(compose(inverse(feather.pose), m.pose)[i][3], 6) for i in (0, 1)) for m in screws)
    center = compose(inverse(feather.pose), pad.pose)

    assert at == sorted(USB_HOLES)
    # Under the board's end, from film to board, clear of the header's pins, 10.16 mm from the middle.
    assert center[0][3] + pad.size_mm[1] / 2 == pytest.approx(25.4)
    assert abs(center[1][3]) + pad.size_mm[0] / 2 < 10.16 - 1
    assert center[2][3] + pad.size_mm[2] / 2 == pytest.approx(-feather.size_mm[2] / 2)


def test_screws_under_the_module_or_under_a_part_of_the_board_are_found() -> None:
    folded = car("w95")
    feather = mount_of(folded, folded.parts.feather.name)

    def under(mount: Mount) -> Mount:
        here = compose(inverse(feather.pose), mount.pose)
        (x, y), *_ = (hole for hole in ANTENNA_HOLES if hole[1] * here[1][3] > 0)
        return replace(mount, pose=compose(feather.pose, translation(x + 22.86, y - here[1][3], 0), here))

    def covered(mount: Mount) -> Mount:
        low = 1.6 + 4.0 - feather.size_mm[2] / 2
        blocks = (Solid("box", (8.0, 8.0, 8.0), translation(x, y, low)) for x, y in USB_HOLES)
        return replace(mount, solids=(*mount.solids, *blocks))

    screw = folded.parts.board_screw.name
    for spoiled in (with_mounts(folded, screw, under), with_mounts(folded, feather.part, covered)):
        findings = assembly_findings(spoiled)
        for number in (1, 2):
            assert any("does not fit" in finding and f"board screw {number}" in finding for finding in findings), findings


def test_headers_whose_legs_reach_the_cell_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    parts = catalogue_of(DEFAULT_CHOICES)
    # The legs of stacking headers. The board lies 5 mm over the bridge's film, the LiPo 2.4 mm below the film.
    leg = parts.headers.leg_mm.model_copy(update={"value": 10.5})
    stacking = parts.model_copy(update={"headers": parts.headers.model_copy(update={"leg_mm": leg})})
    plain = folded_car(compose_design("W_B_W", {"width": 97}))
    monkeypatch.setattr("foldcar.car.design.catalogue_of", lambda _: stacking)
    spoiled = folded_car(compose_design("W_B_W", {"width": 98}))

    def deepest_mm(folded: FoldedCar) -> float:
        """How far the Feather's pins reach below the LiPo's top, if positive."""
        feather, lipo = (mount_of(folded, part.name) for part in (folded.parts.feather, folded.parts.lipo))
        low = min(compose(feather.pose, solid.pose)[2][3] - solid.size_mm[2] / 2 for solid in feather.solids)
        return lipo.pose[2][3] + lipo.half_mm(2) - low

    assert deepest_mm(plain) < -5
    assert deepest_mm(spoiled) == pytest.approx(1.25, abs=0.01)
    assert assembly_findings(plain) == []
    assert any(
        "HUZZAH32 Feather does not fit: at its place it runs into bridge" in text for text in assembly_findings(spoiled)
    )
    assert any(str(finding).startswith("fit: Feather's pins over the bridge: lacks") for finding in check_fits(spoiled))


def face_pose(car: FoldedCar, name: str) -> Pose:
    """The pose in the car of a face of its first beam."""
    beam = next(piece for piece in car.pieces if piece.name.startswith("beam"))
    placed = next(piece for piece in car.placed if piece.piece == beam.name)
    return compose(placed.pose, folded_poses(beam)[name])


def blocked(car: FoldedCar) -> list[str]:
    return [
        finding
        for finding in assembly_findings(car)
        if "block" in finding.rpartition(": ")[2] and finding.endswith("is in the way")
    ]


def in_front(car: FoldedCar, part: str, index: int, off_mm: float, beside_mm: float = 0.0) -> Pose:
    """The pose of a block of 2 mm before what is reached, so far from it and from the access's axis."""
    mount = next(mount for mount in car.mounts if part in (mount.part, mount.name))
    return compose(mount.pose, mount.clearances[index].pose, translation(beside_mm, 0, off_mm + 1))


def test_blocks_in_the_way_of_fingers_tongues_plugs_and_drivers_are_found() -> None:
    folded = car("w95")
    parts = folded.parts
    # In a tongue's frame x runs along the car, y outwards and z down, from the flap's film; the lever is above it.
    # 1 mm off the film of lever or flap, 0.25 mm thick, lies the near side of a block of 2 mm.
    lever_z, off = -15.0, 0.125 + 1 + 1
    at_beam = {
        "front tongue has no room for its finger": ("front tongue", (5, off, lever_z)),
        "rear tongue has no room for its finger": ("rear tongue", (5, -off, lever_z)),
        "rear tongue has no room for its tongue": ("rear tongue", (5, -off, 0)),
        "front pull tab has no room for its finger": ("front pull tab", (5, 5, off)),
    }
    # The USB socket's mouth lies 1.6 mm inside the wall's outer side. A finger of 14 + 3 mm reaches 8.5 mm from its axis,
    # one of 25 + 10 mm 35 mm; the block reaches 1 mm from its middle.
    reached = [
        (SERVO_SWITCH, 0, 30, 8.7, "finger", "Press servo switch"),
        (parts.feather.name, 0, 3.0, 0, "plug", "lid shut"),
        (parts.feather.name, 1, 1.0, 0, "plug", "lid open"),
        (parts.featherwing.name, 2, 1.0, 0, "driver", "lid open"),
    ]
    poses = [compose(face_pose(folded, face), translation(*at)) for face, at in at_beam.values()]

    findings = blocked(with_block(folded, *poses, *(in_front(folded, *tool_position[:4]) for tool_position in reached)))

    for sentence in at_beam:
        assert any(sentence in finding and "Push the levers outwards" in finding for finding in findings), (
            sentence,
            findings,
        )
    for i, (name, _, _, _, tool, state) in enumerate(reached, len(at_beam)):
        sentence = f"{name} has no room for its {tool}: block {i} is in the way"
        assert any(sentence in finding and state in finding for finding in findings), (sentence, findings)
    beyond = [in_front(folded, SERVO_SWITCH, 0, *off) for off in ((30, 10.0), (38, 0.0))]
    assert blocked(with_block(folded, *beyond)) == []


def swapped(steps: tuple[AssemblyStep, ...], first: str, second: str) -> tuple[AssemblyStep, ...]:
    """The steps with two things of one step in each other's place."""
    changed = []
    for step in steps:
        names = [add.name for add in step.adds]
        if first in names and second in names:
            adds, i, k = list(step.adds), names.index(first), names.index(second)
            adds[i], adds[k] = adds[k], adds[i]
            step = replace(step, adds=tuple(adds))
        changed.append(step)
    assert tuple(changed) != steps
    return tuple(changed)


def test_a_wrong_order_is_found() -> None:
    folded = car("w95")
    feather, wing = folded.parts.feather.name, folded.parts.featherwing.name
    steps = plan_assembly(folded)
    early = [(feather, "board screw 1"), ("front left servo", "front left servo screw 1"),
             ("horn of wheel0", "centre screw of wheel0")]  # fmt: skip
    shuffled = steps
    for part, screw in early:
        shuffled = swapped(shuffled, part, screw)
    open_steps = [step for step in steps if step.title != "Shut the lid"]
    (shut,) = (step for step in steps if step.title == "Shut the lid")

    passed = list(map(str, prove_steps(folded, shuffled).findings))
    behind = list(map(str, prove_steps(folded, swapped(steps, "board screw 2", wing)).findings))
    closed = list(map(str, prove_steps(folded, [*open_steps[:9], shut, *open_steps[9:]]).findings))

    for part, screw in early:
        assert any(f"{screw} passes {part}, which is not there yet" in finding for finding in passed), passed
    assert any("the nut of board screw 2 has no way out" in finding for finding in behind), behind
    assert any(folded.parts.battery.name in finding and "beam: lid" in finding for finding in closed), closed


def test_parts_list_and_view_follow_the_same_order() -> None:
    folded, steps = car("hinged"), assembly_steps(car("hinged"))
    parts = {mount.name: mount.part for mount in folded.mounts}
    used = dict.fromkeys(parts[add.name] for step in steps for add in step.adds if add.kind == "mount")
    shown = view_steps(folded)

    assert [row.name for row in parts_list(folded) if row.name in used] == list(used)
    for number, step in enumerate(steps, 1):
        starts = [
            next(begin for n, _, begin, _ in shown.ways[add.kind, add.name, add.copy] if n == number)
            for add in step.adds if add.kind != "unit"
        ]  # fmt: skip
        assert starts == sorted(starts)
        for added in (add for add in step.adds if add.nut_mm):
            (first, *_) = [way for n, way, _, _ in shown.ways["nut", added.name, 0] if n == number]
            assert np.allclose(first[0], -np.array(added.nut_mm[-1]), atol=1e-3)
