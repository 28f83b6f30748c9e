"""All steps of the guide: cutting, then those of the order of assembly, which is proved; then the service.

Input: a FoldedCar, and the CutCar of its sheets. Output: Steps in order, with texts, pictures and counts.
"""

from foldcar.car.folded.model import FoldedCar
from foldcar.car.proof.prove import service_steps
from foldcar.fabrication.assembly.drawing import Drawing
from foldcar.fabrication.assembly.guide_folding import out_of_sheets, parted
from foldcar.fabrication.assembly.guide_pictures import service_picture, step_pictures
from foldcar.fabrication.assembly.guide_shapes import FROM_FRONT, whole_car
from foldcar.fabrication.assembly.guide_state import State
from foldcar.fabrication.assembly.guide_step import Picture, Step
from foldcar.fabrication.assembly.guide_words import service_lines, step_lines
from foldcar.fabrication.assembly.operations import by_step
from foldcar.fabrication.patterns.sheets import CutCar


def steps(folded: FoldedCar, cut: CutCar, machine: str) -> list[Step]:
    """All steps, from cutting on a machine of that name to the finished car."""
    found = [out_of_sheets(cut, machine), *parted(folded, cut)]
    state = State(folded)
    for step, done in by_step(folded):
        lines = step_lines(step, state)
        state.take(step)
        repeated = len(state.unit_bodies(step.unit)) if step.unit else 1
        title = f"{step.title} ({repeated} times)" if repeated > 1 else step.title
        found.append(Step(title, lines, step_pictures(step, state, step.title), done))
    return found


def upkeep(folded: FoldedCar) -> Step:
    """How the finished car is opened, charged, connected and reset."""
    lines = service_lines(folded, service_steps(folded))
    return Step("Open, charge, connect, reset", lines, service_picture(folded))


def finished(folded: FoldedCar) -> Picture:
    """A picture of the whole car."""
    return Picture(Drawing(whole_car(folded, FROM_FRONT), FROM_FRONT, "The finished car"), "the finished car")
