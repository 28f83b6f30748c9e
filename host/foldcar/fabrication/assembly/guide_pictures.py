"""The pictures of a step and of the service: what is there already is pale, what goes in has an arrow along its way.

Input: a step and the State after it; a FoldedCar. Output: Pictures.
"""

import numpy as np

from foldcar.car.assembly.order import assembly_steps, service_steps
from foldcar.car.assembly.step import AssemblyStep
from foldcar.car.folded.model import FoldedCar
from foldcar.fabrication.assembly.drawing import Arrow, Drawing
from foldcar.fabrication.assembly.facets import together
from foldcar.fabrication.assembly.guide_scene import Scene, points, tiny
from foldcar.fabrication.assembly.guide_state import State
from foldcar.fabrication.assembly.guide_step import Picture
from foldcar.fabrication.assembly.guide_words import reached_word
from foldcar.fabrication.assembly.hidden_surfaces import Camera, camera

# Open lids stand on the left, so that most is seen from the right.
FROM_RIGHT, FROM_LEFT, FROM_REAR = camera(-55, 34), camera(125, 34), camera(-125, 34)
FROM_BELOW, FLAT = camera(-55, -34), camera(-75, 50)
FLAT_MM, TOOL_MM = 16.0, 28.0
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
    """The finished car with its lids open, and what is reached by plug and finger."""
    state = State(car)
    for step in assembly_steps(car):
        state.take(step)
    lids = [step.folds for step in service_steps(car) if step.folds]
    for folds in lids:
        for piece, creases in folds.items():
            state.closed.setdefault(piece, {}).update(creases)
    wheels = {axle.wheel for axle in car.axles}
    shown = [part for part in state.there if part.body not in wheels and not tiny(state, part)]
    arrows: list[Arrow] = []
    for mount in car.mounts:
        for index, access in enumerate(mount.accesses):
            if access.tool != "driver":
                at = state.pose(mount) @ np.array(access.pose)
                ends = np.stack([at[:3, 3] + at[:3, 2] * min(access.length_mm, TOOL_MM), at[:3, 3]])
                word = reached_word(car, mount, index)
                arrows.append(Arrow(ends, "tool", "" if any(one.text == word for one in arrows) else word))
    caption = "the lid open, without wheels" if lids else "without wheels"
    return (Picture(Drawing(together(map(state.shape, shown)), FROM_RIGHT, "Service", arrows=arrows), caption),)


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
