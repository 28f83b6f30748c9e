"""The guide's first steps: cut all pieces, fold each.

Input: a FoldedCar, and the car with its pieces as cut. Output: Steps with pictures of each piece flat, half folded and
folded.
"""

import math
from collections import Counter
from collections.abc import Iterator, Mapping

import numpy as np

from foldcar.car.folded.model import FoldedCar, Piece
from foldcar.fabrication.assembly.drawing import picture
from foldcar.fabrication.assembly.facets import film_shape
from foldcar.fabrication.assembly.guide_shapes import same_shapes
from foldcar.fabrication.assembly.guide_step import Picture, Step, listed, numbers
from foldcar.fabrication.assembly.hidden_surfaces import camera
from foldcar.fabrication.assembly.join_marks import join_marks

ABOVE = camera(-90, 90)
ASLANT = camera(-55, 32)


def cut(as_cut: FoldedCar) -> Step:
    """The step that cuts all pieces, with a picture of each."""
    pictures = []
    for piece in as_cut.pieces:
        rim = any(face.role == "rim" for face in piece.faces)
        marks = [] if rim else join_marks(as_cut, piece, np.eye(4), 0.0)
        svg = picture(film_shape(piece, np.eye(4), 0.0), ABOVE, piece.label, marks, enlarged=2.0)
        times = f", {piece.count} times" if piece.count > 1 else ""
        pictures.append(Picture(svg, f"{piece.label}{times}"))
    lines = (
        "Cut all pieces from the sheets. Score the folds or cut them as dashes; do not fold yet.",
        "Pictures show the printed side. Numbers in circles are joins: both sides of a join have the same number.",
        "Fold valleys (blue, dashed) towards you and mountains (red, dash-dotted) away from you, the printed side up.",
    )
    return Step("Cut the pieces", lines, tuple(pictures))


def parted(folded: FoldedCar, as_cut: FoldedCar) -> Iterator[Step]:
    """Steps that glue pieces split to fit the sheet."""
    known = {join.number for join in folded.joins}
    cut_names = {piece.name for piece in as_cut.pieces}
    for piece in folded.pieces:
        if piece.name in cut_names:
            continue
        parts = [part for part in as_cut.pieces if part.name.startswith(f"{piece.name}, part ")]
        names = {part.name for part in parts}
        new = {join.number for join in as_cut.joins if join.piece_a in names and join.number not in known}
        times = f" ({piece.count} times)" if piece.count > 1 else ""
        lines = (
            f"The {piece.label} is too large for a sheet, so it is cut as {listed([part.label for part in parts])}.",
            f"Fold each tab and glue it to the printed side of the panel with the same number: join {numbers(new)}.",
            f"That corner is the fold there; from now on the pictures show the {piece.label} whole.",
        )
        pictures = tuple(
            Picture(
                picture(
                    film_shape(part, np.eye(4), 0.5), ASLANT, f"{part.label}, half folded",
                    [mark for mark in join_marks(as_cut, part, np.eye(4), 0.5) if int(mark.text) in new],
                ),
                part.label,
            )
            for part in parts
        )  # fmt: skip
        yield Step(f"Glue the parts of the {piece.label} together{times}", lines, pictures)


def folds(folded: FoldedCar, strips: Mapping[str, int]) -> Iterator[Step]:
    """Steps that fold each piece; ``strips`` is the number of parts of strips that are cut across."""
    for group in same_shapes(piece for piece in folded.pieces if any(crease.angle_rad for crease in piece.creases)):
        piece = group[0]
        rim = any(face.role == "rim" for face in piece.faces)
        names = listed([one.label for one in group])
        times = f" ({piece.count} times)" if piece.count > 1 else ""
        states = ((0.0, "flat"), (0.5, "half folded"), (1.0, "folded"))[1 if rim else 0 :]
        view = camera(-70, 25) if rim else ASLANT
        pictures = tuple(
            Picture(
                picture(
                    film_shape(piece, np.eye(4), share), view, f"{names}, {state}",
                    [] if rim else join_marks(folded, piece, np.eye(4), share),
                ),
                state,
            )
            for share, state in states
        )  # fmt: skip
        lines = [*_fold_lines(folded, piece, rim, strips.get(piece.name, 1))]
        if len(group) > 1:
            lines.append(f"The numbers in the pictures are those of the {piece.label}; see step 1 for the others.")
        yield Step(f"Fold the {names}{times}", tuple(lines), pictures)


def _fold_lines(folded: FoldedCar, piece: Piece, rim: bool, parts: int) -> Iterator[str]:
    if rim:
        if parts > 1:
            yield f"Glue the {parts} parts of the strip end to end, each one's tongue under the next."
        tabs = sum(face.role == "tab" for face in piece.faces)
        yield f"Bend the {tabs} teeth to the printed side by 90°; roll the strip evenly to a ring, printed side inside."
    else:
        rims = {face.name for face in piece.faces if face.role == "rim"}
        folds = Counter(
            ("valley" if c.angle_rad > 0 else "mountain", round(math.degrees(abs(c.angle_rad))))
            for c in piece.creases
            if c.child.face not in rims and not c.flexure and c.angle_rad
        )
        for (kind, degrees), count in folds.items():
            yield f"{count} {kind} fold{'s' if count > 1 else ''} of {degrees}°. Crease each fully once, then let go."
    own = sorted({join.number for join in folded.joins if join.piece_a == join.piece_b == piece.name})
    if own and rim:
        yield f"Glue the ends together: join {numbers(own)}."
    elif own:
        yield f"Its own seam, join {numbers(own)}, is glued later."
