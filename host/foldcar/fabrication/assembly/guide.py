"""The assembly guide: one HTML page with numbered steps and pictures, for screen and print.

Input: a FoldedCar, and the CutCar of its sheets. Output: the page's text; it needs no other file.
"""

from collections.abc import Collection, Iterator, Sequence

import numpy as np
from markupsafe import Markup

from foldcar.car.folded.model import FoldedCar, Piece
from foldcar.car.proof.prove import service_steps
from foldcar.fabrication.assembly.drawing import Drawing
from foldcar.fabrication.assembly.facets import film_shape
from foldcar.fabrication.assembly.finished_car import finished_car
from foldcar.fabrication.assembly.guide_pictures import Step, service_picture, step_pictures
from foldcar.fabrication.assembly.guide_service import ListedCar, driving_steps, service_lines
from foldcar.fabrication.assembly.guide_state import AssemblyState
from foldcar.fabrication.assembly.guide_words import step_lines
from foldcar.fabrication.assembly.hidden_surfaces import camera
from foldcar.fabrication.assembly.insertion_words import DRIVER, join_words, number_ranges
from foldcar.fabrication.assembly.join_numbers import join_marks
from foldcar.fabrication.assembly.operations import (
    is_screw,
    is_wound,
    kinds,
    minutes,
    operations,
    operations_by_step,
    operations_of_sheets,
    operations_of_splices,
)
from foldcar.fabrication.assembly.parts_list import parts_list
from foldcar.fabrication.assembly.plug_words import rests_mm
from foldcar.fabrication.assembly.soldering import soldering_step
from foldcar.fabrication.assembly.view_page import facts
from foldcar.fabrication.assembly.wiring import wiring_drawing
from foldcar.fabrication.patterns.drawing import Sheet
from foldcar.fabrication.patterns.options import MACHINES
from foldcar.fabrication.patterns.sheets import CutCar
from foldcar.figures.page import content_policy, page_template
from foldcar.statistics.words import count

# From above; x points to the right, or to the top of the picture.
ABOVE, ABOVE_TURNED = camera(-90, 90), camera(180, 90)
ASLANT = camera(-55, 32)
# Long pieces are turned along the picture's wider side.
UPRIGHT = 1.3
UNLISTED = ListedCar()
# How far the folds of a picture are folded: 0 is flat, 1 is finished.
HALF_FOLDED = 0.5


def guide_page(
    folded: FoldedCar,
    cut: CutCar,
    machine: str,
    title: str,
    sheets: Sequence[Sheet] = (),
    listed: ListedCar = UNLISTED,
) -> str:
    """Return the HTML page that shows how to build a car, which is cut from these sheets on a machine of that name.

    ``listed`` says in which listing and experiment the car is, as far as known.
    """
    lines = service_lines(folded, service_steps(folded))
    return page_template("foldcar.fabrication.assembly", "guide.html").render(
        title=title,
        policy=content_policy(),
        facts=facts(folded, sheets),
        rows=parts_list(folded, sheets, cut),
        finished=finished_car(folded, "The finished car"),
        steps=build_steps(folded, cut, machine, listed),
        upkeep=Step("Open, charge, connect, reset", lines, service_picture(folded)),
        done=operations(folded, cut),
        kinds=kinds(),
        minutes=minutes,
        parts=folded.parts,
        driver=DRIVER,
        # One cable tie holds the USB cable, and one each lead of a servo that is too long.
        ties=count(1 + len(rests_mm(folded)), "cable tie"),
        screws=join_words(sorted({mount.part for mount in folded.mounts if is_screw(folded.parts, mount)})),
        wiring=Markup(wiring_drawing(folded, title)),
    )


def build_steps(folded: FoldedCar, cut: CutCar, machine: str, listed: ListedCar = UNLISTED) -> list[Step]:
    """Return all steps, from cutting on the ``machine`` to a car that has driven a metre.

    ``listed`` says in which listing of cars and experiment the car is, as far as known.
    """
    all_steps = [cutting_step(cut, machine), *splice_steps(folded, cut)]
    state = AssemblyState(folded)
    for step, step_operations in operations_by_step(folded):
        if any(added.name == folded.parts.feather.name for added in step.adds):
            all_steps.append(soldering_step(folded))
        lines = step_lines(step, state)
        state.advance(step)
        # A unit is assembled outside the car. If the car has several equal units, such as wheels, the step is repeated.
        repeated = len(state.unit_bodies(step.unit)) if step.unit else 1
        title = f"{step.title} ({repeated} times)" if repeated > 1 else step.title
        all_steps.append(Step(title, lines, step_pictures(step, state, step.title), step_operations))
    return [*all_steps, *(Step(title, lines) for title, lines in driving_steps(folded, listed))]


def cutting_step(cut: CutCar, machine: str) -> Step:
    """Return the first step of the guide: cutting all pieces with the given machine. It has a picture of each piece."""
    pictures = []
    for piece in cut.car.pieces:
        # The piece lies flat, as it comes out of the sheet.
        shape = film_shape(piece, np.eye(4), fraction=0.0)
        points = np.concatenate([facet.rings_mm[0] for facet in shape.facets])
        across, along, _ = np.ptp(points, axis=0)
        # A piece that is UPRIGHT times as long along y as along x is turned to lie across the picture.
        view = ABOVE_TURNED if along > UPRIGHT * across else ABOVE
        marks = join_marks(cut.car, piece, np.eye(4), fraction=0.0)
        caption = piece.label + (f", {piece.count} times" if piece.count > 1 else "")
        pictures.append(Drawing(shape, view, piece.label, marks, enlarged=2.0, caption=caption))
    # The pieces that are not folded at creases but wound into rings.
    wound = [piece.label for piece in cut.car.pieces if is_wound(piece)]
    program, files = MACHINES[machine].program, MACHINES[machine].files
    lines = (
        f"Cut the sheets ({machine}: {files.upper()} files, {program}); how_to_cut.md says how, layer by layer; "
        "sheets.png shows all sheets. Cut the coupon first.",
        "Take the pieces out of the sheets, and the waste out of every opening (green on the sheets) with a fingertip, a "
        "pin or tweezers. Pictures show the printed side, which is inside the car; numbers in circles are joins, the "
        "same on both sides of a join.",
        "Crease every fold once before you build: valleys (blue, dashed) towards you, mountains (red, dash-dotted) away "
        "from you, the printed side up.",
        *([f"Do not crease the {join_words(wound)}: they are curled."] if wound else []),
    )
    return Step("Cut the pieces", lines, tuple(pictures), operations_of_sheets(cut))


def _half_folded(part: Piece, cut: CutCar, numbers: Collection[int]) -> Drawing:
    """Return a picture of a half folded part of a split piece, with the marks of the joins that have these numbers."""
    place = np.eye(4)
    marks = [mark for mark in join_marks(cut.car, part, place, HALF_FOLDED) if int(mark.text) in numbers]
    text = f"{part.label}, half folded"
    return Drawing(film_shape(part, place, HALF_FOLDED), ASLANT, text, marks, caption=text)


def splice_steps(folded: FoldedCar, cut: CutCar) -> Iterator[Step]:
    """Yield one step of the guide, which joins the parts of pieces that were too large for a sheet.

    ``folded`` is the car as it was designed, and ``cut`` is the same car after large pieces were split into parts. Yields
    nothing if no piece was split.
    """
    cut_names = {piece.name for piece in cut.car.pieces}
    split_pieces = [piece for piece in folded.pieces if piece.name not in cut_names]
    designed_joins = {join.number for join in folded.joins}
    lines, pictures = [], []
    for piece in split_pieces:
        parts = [part for part in cut.car.pieces if part.name.startswith(f"{piece.name}, part ")]
        part_names = {part.name for part in parts}
        # The joins between the parts, which the designed car does not have.
        new_joins = set()
        for join in cut.car.joins:
            if join.piece_a in part_names and join.number not in designed_joins:
                new_joins.add(join.number)
        parts_text = join_words([part.label for part in parts])
        times = f", {piece.count} times" if piece.count > 1 else ""
        lines.append(
            f"The {piece.label} is cut as {parts_text}{times}. Fold each tab and tape it to the printed side of the "
            "panel with the same number, so that the tab lies inside the car: join "
            f"{number_ranges(new_joins)}. From now on it is one piece."
        )
        pictures += [_half_folded(part, cut, new_joins) for part in parts]
    if lines:
        yield Step("Join the parts of pieces", tuple(lines), tuple(pictures), operations_of_splices(folded, cut))
