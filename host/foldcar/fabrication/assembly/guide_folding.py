"""The guide's first steps: cut all pieces, join those that the sheets have in parts.

Input: a FoldedCar, and the CutCar of its sheets. Output: Steps with a picture of each piece.
"""

from collections.abc import Iterator

import numpy as np

from foldcar.car.folded.model import FoldedCar
from foldcar.fabrication.assembly.drawing import Drawing
from foldcar.fabrication.assembly.facets import film_shape
from foldcar.fabrication.assembly.guide_step import Picture, Step, listed, numbers
from foldcar.fabrication.assembly.hidden_surfaces import camera
from foldcar.fabrication.assembly.join_marks import join_marks
from foldcar.fabrication.assembly.operations import is_wound, of_parting, of_sheets
from foldcar.fabrication.patterns.options import MACHINES
from foldcar.fabrication.patterns.sheets import CutCar

ABOVE = camera(-90, 90)
ASLANT = camera(-55, 32)
# Long pieces are turned along the picture's wider side.
UPRIGHT = 1.3


def out_of_sheets(cut: CutCar, machine: str) -> Step:
    """The step that cuts all pieces, with a picture of each, for a machine of that name."""
    pictures = []
    for piece in cut.car.pieces:
        shape = film_shape(piece, np.eye(4), 0.0)
        points = np.concatenate([facet.rings_mm[0] for facet in shape.facets])
        across, along, _ = np.ptp(points, axis=0)
        view = camera(180, 90) if along > UPRIGHT * across else ABOVE
        drawing = Drawing(shape, view, piece.label, join_marks(cut.car, piece, np.eye(4), 0.0), enlarged=2.0)
        times = f", {piece.count} times" if piece.count > 1 else ""
        pictures.append(Picture(drawing, f"{piece.label}{times}"))
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
        *([f"Do not crease the {listed(wound)}: they are curled."] if wound else []),
    )
    return Step("Cut the pieces", lines, tuple(pictures), of_sheets(cut))


def parted(folded: FoldedCar, cut: CutCar) -> Iterator[Step]:
    """The step that joins pieces split to fit the sheets, along folds and across."""
    known = {join.number for join in folded.joins}
    cut_names = {piece.name for piece in cut.car.pieces}
    lines, pictures = [], []
    for piece in (piece for piece in folded.pieces if piece.name not in cut_names):
        parts = [part for part in cut.car.pieces if part.name.startswith(f"{piece.name}, part ")]
        names = {part.name for part in parts}
        new = {join.number for join in cut.car.joins if join.piece_a in names and join.number not in known}
        times = f", {piece.count} times" if piece.count > 1 else ""
        lines.append(
            f"The {piece.label} is cut as {listed([part.label for part in parts])}{times}: fold each tab and tape it to "
            f"the printed side of the panel with the same number, join {numbers(new)}. From now on it is one piece."
        )
        pictures += [
            Picture(
                Drawing(
                    film_shape(part, np.eye(4), 0.5), ASLANT, f"{part.label}, half folded",
                    [mark for mark in join_marks(cut.car, part, np.eye(4), 0.5) if int(mark.text) in new],
                ),
                f"{part.label}, half folded",
            )
            for part in parts
        ]  # fmt: skip
    for name, count in cut.strips.items():
        parts_across = [flat for flat in cut.pieces if flat.origin == name]
        seams = {number for flat in parts_across for number, _ in flat.seams}
        copies = parts_across[0].count
        lines.append(
            f"The {name} is cut across, in {count} parts{f', {copies} times' if copies > 1 else ''}: lay the edge of one "
            f"onto the line of the part with the same number, printed side up, and tape it there: join {numbers(seams)}."
        )
    if lines:
        yield Step("Join the parts of pieces", tuple(lines), tuple(pictures), of_parting(folded, cut))
