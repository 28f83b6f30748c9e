"""The pictures of a step and of the service: what is there already is pale, what goes in has an arrow along its way.

Input: a step and the State after it; a FoldedCar. Output: Pictures.
"""

import numpy as np

from foldcar.car.folded.model import FoldedCar, Mount
from foldcar.car.proof.prove import assembly_steps, service_steps
from foldcar.car.proof.roles import roles_of
from foldcar.car.proof.step import AssemblyStep
from foldcar.fabrication.assembly.drawing import Arrow, Drawing
from foldcar.fabrication.assembly.facets import together
from foldcar.fabrication.assembly.guide_scene import Scene, points, tiny
from foldcar.fabrication.assembly.guide_state import State
from foldcar.fabrication.assembly.guide_step import Picture
from foldcar.fabrication.assembly.guide_words import reached_word
from foldcar.fabrication.assembly.hidden_surfaces import Camera, camera
from foldcar.fabrication.assembly.poses import face_poses, moved

# Open lids stand on the left, so that most is seen from the right.
FROM_RIGHT, FROM_LEFT, FROM_REAR = camera(-55, 34), camera(125, 34), camera(-125, 34)
FROM_BELOW, FLAT = camera(-55, -34), camera(-75, 50)
FLAT_MM, TOOL_MM, PUSH_MM = 16.0, 28.0, 16.0
# Longer than those of plugs, whose words it would cross.
DRIVER_MM = 65.0
# Where a lever is pushed, as a share of its height.
LEVER_AT = 0.8
# Cosine from which on something comes from a side.
SIDEWAYS = 0.7


def step_pictures(step: AssemblyStep, state: State, title: str) -> tuple[Picture, ...]:
    """The pictures of one step, one from each side that something comes from."""
    scene = Scene(step, state)
    return tuple(
        Picture(Drawing(scene.shape, view, title, scene.marks, 1.0, scene.faded, scene.arrows_in(view)), caption)
        for view, caption in _views(scene)
    )


def service_picture(car: FoldedCar) -> tuple[Picture, ...]:
    """The finished car: how its lids open; with them open, what is reached by plug and finger."""
    state = State(car)
    for step in assembly_steps(car):
        state.take(step)
    wheels = {axle.wheel for axle in car.axles}
    shown = [part for part in state.there if part.body not in wheels and not tiny(state, part)]
    lids = [step.folds for step in service_steps(car) if step.folds]
    pictures: list[Picture] = []
    if lids:
        off = [part for part in shown if not (isinstance(part, Mount) and roles_of(car).is_on_lid(part))]
        drawn = Drawing(together(map(state.shape, off)), FROM_RIGHT, "Open", arrows=_opening(car, state))
        pictures.append(Picture(drawn, "the lid shut, without wheels: push each lever outwards, lift by the pull tab"))
    for folds in lids:
        for piece, creases in folds.items():
            state.closed.setdefault(piece, {}).update(creases)
    mounts = {mount.name: mount for mount in car.mounts}
    arrows: list[Arrow] = []
    for reach in (reach for step in service_steps(car) for reach in step.reaches if not reach.piece):
        mount = mounts[reach.name]
        access = mount.accesses[reach.index]
        longest_mm = DRIVER_MM if access.tool == "driver" else TOOL_MM
        at = state.pose(mount) @ np.array(access.pose)
        ends = np.stack([at[:3, 3] + at[:3, 2] * min(access.length_mm, longest_mm), at[:3, 3]])
        word = reached_word(car, mount, reach.index)
        arrows.append(Arrow(ends, "tool", "" if any(one.text == word for one in arrows) else word))
    caption = "the lid open, without wheels" if lids else "without wheels"
    pictures.append(Picture(Drawing(together(map(state.shape, shown)), FROM_RIGHT, "Service", arrows=arrows), caption))
    return tuple(pictures)


def _opening(car: FoldedCar, state: State) -> list[Arrow]:
    """Where fingers push the levers of the lids, outwards, and where they lift."""
    arrows: list[Arrow] = []
    for name, lid in roles_of(car).lids.items():
        one = next(one for one in car.placed if one.piece == name)
        poses = face_poses(state.pieces[name], state.closed.get(name, {}))
        for face in lid.gripped:
            pose = state.pose(one) @ poses[face.name]
            kinds = [access.tool for access in face.accesses]
            middle = max(x for x, _ in face.outline_mm) / 2
            if "tongue" in kinds:
                # The lever stands as high over the lid as the tongue is below it; printed sides face down.
                lever = (car.parts.assembly.flap_mm.value + car.parts.assembly.grip_mm.value * LEVER_AT) * -1.0
                points_mm = [(middle, -PUSH_MM, lever), (middle, 0.0, lever)]
            else:
                tip = max(y for _, y in face.outline_mm)
                points_mm = [(middle, tip, 0.0), (middle, tip + TOOL_MM, 0.0)]
            arrows.append(Arrow(moved(pose, np.array(points_mm))))
    return arrows


def _views(scene: Scene) -> list[tuple[Camera, str]]:
    """Cameras and captions."""
    if scene.outward is not None:
        return [(camera(35 if scene.outward[1] > 0 else -35, 18), "seen from its outer side")]
    sides = scene.from_
    if not sides and np.ptp(points([scene.shape])[:, 2]) < FLAT_MM:
        return [(FLAT, "")]
    left, right = any(one[1] > SIDEWAYS for one in sides), any(one[1] < -SIDEWAYS for one in sides)
    if left and right:
        return [(FROM_RIGHT, "seen from the right"), (FROM_LEFT, "seen from the left")]
    if sides and all(one[2] < -SIDEWAYS for one in sides):
        return [(FROM_BELOW, "seen from below")]
    if sides and all(one[0] < -SIDEWAYS for one in sides):
        return [(FROM_REAR, "seen from the rear")]
    return [(FROM_LEFT, "seen from the left") if left else (FROM_RIGHT, "seen from the right")]
