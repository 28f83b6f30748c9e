"""The guide's words against the car's geometry: which film lies on top, which side is printed, where leads find room."""

import math
import re
from functools import cache

import numpy as np
import pytest

from foldcar.car.folded.model import FoldedCar, Mount
from foldcar.car.folded.pose import compose as chain
from foldcar.car.leads import leads
from foldcar.car.proof.prove import assembly_steps
from foldcar.fabrication.assembly.faces import face_poses
from foldcar.fabrication.assembly.guide_state import AssemblyState
from foldcar.fabrication.assembly.guide_words import step_lines
from foldcar.fabrication.assembly.plug_words import BUNDLE_MM, rests_mm
from published_cars import car

# A servo's lead: three wires of 1.2 mm side by side.
LEAD_MM = (3.6, 1.2)
VERBS = r"(?:put|push|move|lay|wind|stretch|stick) it "


@cache
def steps(name: str) -> dict[str, tuple[str, ...]]:
    """The lines of a car's proved steps, by title."""
    state, lines = AssemblyState(car(name)), {}
    for step in assembly_steps(car(name)):
        lines[step.title] = step_lines(step, state)
        state.advance(step)
    return lines


def finished_face(folded: FoldedCar, piece_name: str, face_name: str, near: tuple[float, ...] = ()) -> np.ndarray:
    """Return the pose (4, 4) of a face in the finished car: of its first copy, or of that whose middle is nearest."""
    piece = next(piece for piece in folded.pieces if piece.name == piece_name)
    placed = [copy for copy in folded.placed if copy.piece == piece_name]
    poses = [np.array(copy.pose) @ np.array(face_poses(piece, 1.0)[face_name]) for copy in placed]
    return min(poses, key=lambda pose: float(np.linalg.norm(pose[:3, 3] - near))) if near else poses[0]


@pytest.mark.parametrize("name", ["w65", "hinged"])
def test_the_strip_s_end_that_is_said_to_lie_on_top_is_farther_from_the_axle(name: str) -> None:
    folded = car(name)
    labels = {piece.name: piece.label for piece in folded.pieces}
    text = " ".join(steps(name)["Wind the rims around the discs"])
    wound = {piece.name: piece for piece in folded.pieces if any(crease.bend for crease in piece.creases)}
    centre = np.array(folded.axles[0].center_mm)

    locks = [join for join in folded.joins if join.kind == "lock" and join.piece_a in wound]
    assert locks
    for join in locks:
        # A point of the upper strip's first edge, and the lower strip's last edge, where both overlap.
        first = next(face for face in wound[join.piece_a].faces if face.role == "rim")
        last = next(face for face in wound[join.piece_b].faces if face.name == join.b.face)
        upper = finished_face(folded, join.piece_a, first.name) @ (0.0, 5.0, 0.0, 1.0)
        end_mm = max(x for x, _ in last.outline_mm)
        lower = finished_face(folded, join.piece_b, last.name) @ (end_mm, 5.0, 0.0, 1.0)
        over, under = (math.hypot(*(point[:3] - centre)[[0, 2]]) for point in (upper, lower))
        assert over - under > 0.6 * folded.parts.film_mm
        on = "itself" if join.piece_a == join.piece_b else f"the {labels[join.piece_b]}"
        assert f"the {labels[join.piece_a]} on {on} at join {join.number}" in text
    assert "the end with the tongue lies outside" in text


@pytest.mark.parametrize("name", ["w65", "hinged"])
def test_printed_sides_are_where_the_guide_says(name: str) -> None:
    folded, text = car(name), " ".join(line for lines in steps(name).values() for line in lines)

    # Caps: the printed side looks to the middle of their own beam.
    for piece in (piece for piece in folded.pieces if " cap" in piece.name):
        (copy,) = (copy for copy in folded.placed if copy.piece == piece.name)
        beam = next(copy_ for copy_ in folded.placed if copy_.body == copy.body and copy_.piece.startswith("beam"))
        floor = next(face for p in folded.pieces if p.name == beam.piece for face in p.faces if face.name == "floor")
        middle = finished_face(folded, beam.piece, "floor") @ (*np.mean(floor.outline_mm, axis=0), 0.0, 1.0)
        normal = np.array(copy.pose)[:3, 2]
        assert normal @ (middle[:3] - np.array(copy.pose)[:3, 3]) > 0
        assert re.search(rf"{piece.label}: (?:push|put) it in from [a-z ]+, its printed side inside", text, re.IGNORECASE)
    # Layers behind servos are inside the walls, with their print inside.
    walls = [mount for mount in folded.mounts if mount.part == folded.parts.servo.name]
    doublers = [copy for copy in folded.placed if copy.piece == "servo doubler"]
    assert len(doublers) == len(walls)
    for copy in doublers:
        normal, y = np.array(copy.pose)[:3, 2], copy.pose[1][3]
        assert normal[1] * y < 0
    assert "servo doubler: lay it onto the printed side of the beam, its own printed side up" in text
    # Both discs have their print inside the wheel.
    for disc, out in (("inner", 1), ("outer", -1)):
        copy = next(copy for copy in folded.placed if copy.piece == f"wheel {disc} disc")
        side = 1 if folded.axles[0].side == "left" else -1
        assert np.array(copy.pose)[1, 2] * side == pytest.approx(out)
    assert "Wheel outer disc: push it on from its outer side, its printed side inside" in text
    if name == "hinged":
        strip = next(copy for copy in folded.placed if copy.piece == "hinge strip")
        floor = finished_face(folded, "beam 1", "floor")
        assert strip.pose[2][3] < floor[2, 3] and strip.pose[2][2] * floor[2, 2] > 0
        assert "hinge strip: lay it onto the unprinted side of the beam, its own printed side down" in text


@pytest.mark.parametrize("name", ["w65", "hinged", "six"])
def test_every_instruction_for_a_part_begins_with_what_the_hand_does(name: str) -> None:
    folded = car(name)
    labels = {piece.label for piece in folded.pieces} | {mount.part for mount in folded.mounts} | {"wheel", "bridge"}
    names = "|".join(map(re.escape, sorted(labels, key=len)))
    parts = re.compile(rf"(?:^|: |; then )(?:\d+ × )?({names}): (.*?)(?=; then|$)", re.IGNORECASE)

    instructions = [match for lines in steps(name).values() for line in lines for match in parts.findall(line)]

    assert len(instructions) > 20
    assert all(re.match(VERBS, text) for _, text in instructions), instructions


def boxes(mount: Mount) -> list[np.ndarray]:
    """The bounding boxes (2, 3) of a mount's solids in the car's frame (mm)."""
    result = []
    for solid in mount.shape:
        pose = np.array(chain(mount.pose, solid.pose))
        half = np.abs(pose[:3, :3]) @ (np.array(solid.size_mm) / 2)
        result.append(np.stack([pose[:3, 3] - half, pose[:3, 3] + half]))
    return result


@pytest.mark.parametrize("name", ["w65", "w95", "w180", "six", "hinged"])
def test_the_rest_of_a_lead_is_its_length_minus_its_way_and_finds_room_below_its_servo(name: str) -> None:
    folded = car(name)
    text = next(line for line in steps(name)["Plug all wires in"] if "longer than they need to be" in line)
    assert text.count(" mm") - 1 == len(rests_mm(folded))
    told = {servo: float(rest) for servo, rest in re.findall(r"((?:axle \d |front |rear )\w+ servo) (\d+) mm", text)}
    mounts = {mount.name: mount for mount in folded.mounts}
    wiring = folded.parts.wiring.name

    for lead in (lead for lead in leads(folded) if lead.start in {axle.servo for axle in folded.axles}):
        rest_mm = lead.available_mm - lead.needed_mm
        assert (lead.start in told) == (rest_mm >= BUNDLE_MM)
        if lead.start not in told:
            continue
        assert 0 <= rest_mm - told[lead.start] < 10
        # Layers of the lead, flat on each other in two stacks, on the floor or on the joint that lies there.
        servo = mounts[lead.start]
        (low, high), *_ = boxes(servo)
        inside = 1 if servo.pose[1][3] < 0 else -1
        floor = max(
            finished_face(folded, piece.name, face.name)[2, 3]
            for piece in folded.pieces for face in piece.faces
            if piece.name.startswith("beam") and face.name == "floor"
        ) + 2 * folded.parts.film_mm  # fmt: skip
        joint = mounts.get(f"extension of {servo.name}")
        bottom = floor if joint is None else boxes(joint)[0][1, 2]
        height = math.ceil(math.ceil(rest_mm / BUNDLE_MM) / 2) * LEAD_MM[1]
        # Inwards from the servo's middle: to its ears, which lie on the wall's outside, then the wall and its layer.
        servo_data, film_mm = folded.parts.servo, folded.parts.film_mm
        inwards_mm = servo_data.depth_mm.value / 2 - servo_data.ear_underside_mm.value + 2 * film_mm
        wall_y = servo.pose[1][3] + inside * inwards_mm
        ys = sorted((wall_y + inside * 1.0, wall_y + inside * (1.0 + 2 * LEAD_MM[0])))
        middle_x = (low[0] + high[0]) / 2
        half = BUNDLE_MM / 2
        bundle = np.array([[middle_x - half, ys[0], bottom], [middle_x + half, ys[1], bottom + height]])
        for mount in folded.mounts:
            if mount.part != wiring and mount is not joint:
                for box in boxes(mount):
                    assert not ((bundle[0] < box[1] - 1e-6) & (box[0] + 1e-6 < bundle[1])).all(), (servo.name, mount.name)
