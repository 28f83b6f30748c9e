"""All steps of the guide: instructions and pictures of each fold state.

Input: a FoldedCar, and the car with its pieces as cut. Output: Steps in order. Texts and numbers are derived from the
design's folds, joins, mounts and axles.
"""

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Literal

import numpy as np

from foldcar.car.folded.model import FoldedCar, PlacedPiece
from foldcar.car.parts.catalogue import catalogue
from foldcar.fabrication.assembly.drawing import Mark, picture
from foldcar.fabrication.assembly.facets import Shape, together
from foldcar.fabrication.assembly.guide_folding import ASLANT, cut, folds, parted
from foldcar.fabrication.assembly.guide_shapes import FROM_FRONT, Body, key, whole_car
from foldcar.fabrication.assembly.guide_step import Picture, Step, listed, numbers
from foldcar.fabrication.assembly.guide_wheels import wheel, wheels_on
from foldcar.fabrication.assembly.hidden_surfaces import camera
from foldcar.fabrication.assembly.join_marks import join_marks

EXPLODED_MM = 45.0
SERVOS_SEEN = 0.55
LID_OPEN = 0.6


def steps(folded: FoldedCar, as_cut: FoldedCar, strips: Mapping[str, int]) -> list[Step]:
    """All steps, from cutting to the finished car; ``as_cut`` has the pieces and joins of the sheets.

    ``strips`` is the number of parts of each strip that is cut across, by its piece's name.
    """
    segments = [Body(folded, name) for name in _bodies(folded, "segment")]
    wheels = [Body(folded, name) for name in _bodies(folded, "wheel")]
    found = [cut(as_cut), *parted(folded, as_cut), *folds(folded, strips)]
    for body in segments:
        found += _segment(folded, body, f" of segment {segments.index(body) + 1}" if len(segments) > 1 else "")
    left = [(body, placed) for body in segments for placed in body.others if _part_of(body, placed) == "left"]
    if left:
        found.append(_left(folded, segments, left))
    if wheels:
        found += [wheel(folded, wheels[0], len(wheels)), wheels_on(folded)]
    return found


def finished(folded: FoldedCar) -> Picture:
    """A picture of the whole car."""
    return Picture(picture(whole_car(folded, FROM_FRONT), FROM_FRONT, "The finished car"), "the finished car")


def _segment(folded: FoldedCar, body: Body, of: str) -> Iterator[Step]:
    """The steps of one segment's beam: doublings, servos, boards, seam, caps."""
    parts = {kind: [p for p in body.others if _part_of(body, p) == kind] for kind in ("doubling", "inside", "cap")}
    if parts["doubling"]:
        yield _doublings(folded, body, parts["doubling"], of)
    servos = [mount for mount in body.mounts if mount.part == catalogue().servo.name]
    if servos:
        yield _servos(folded, body, parts["doubling"], of)
    if parts["inside"] or len(body.mounts) > len(servos):
        yield _inside(folded, body, [*parts["doubling"], *parts["inside"]], of)
    yield _close(folded, body, parts["cap"], of)


def _part_of(body: Body, placed: PlacedPiece) -> Literal["doubling", "inside", "cap", "left"]:
    """The function of a piece for its body: a layer on a wall, an insert, an end cap, or something else ("left")."""
    name, base = placed.piece, body.base_piece.name
    kinds = {j.kind for j in body.folded.joins if j.piece_a == name and j.piece_b == base}
    if "tab" in kinds:
        return "cap"
    if "tab_slot" in kinds:
        return "inside"
    return "doubling" if body.face_of(placed) and not body.pieces[name].creases else "left"


def _doublings(folded: FoldedCar, body: Body, flat: list[PlacedPiece], of: str) -> Step:
    shape = together([body.base_shape(0.0), *(body.piece_shape(placed, 0.0) for placed in flat)])
    pieces = {placed.piece for placed in flat}
    found = sorted({j.number for j in folded.joins if j.piece_a in pieces and j.piece_b == body.base.piece})
    names = ", ".join(f"{count} × {name}" for name, count in Counter(placed.piece for placed in flat).items())
    lines = (
        f"Glue onto the printed side of the flat {body.base_piece.label}: {names}. Join {numbers(found)}.",
        "Openings and screw holes must lie on each other: put screws through them while the glue sets.",
    )
    marks: list[Mark] = []
    for placed in flat:
        pose = body.follow(body.face_of(placed), placed.pose, 0.0)
        marks += join_marks(folded, body.pieces[placed.piece], pose, 0.0, key(placed))
    drawn = Picture(picture(shape, camera(-75, 50), "Doublings", marks), "printed side up")
    return Step(f"Double the walls{of}", lines, (drawn,))


def _servos(folded: FoldedCar, body: Body, flat: list[PlacedPiece], of: str) -> Step:
    shapes = [body.base_shape(SERVOS_SEEN), *(body.piece_shape(placed, SERVOS_SEEN) for placed in flat)]
    shapes += body.mount_shapes(SERVOS_SEEN, lambda mount: mount.part == catalogue().servo.name)
    axles = [axle for axle in folded.axles if axle.body == body.name]
    lines = [
        "Before you build a servo in, give it pulses of 1500 µs and turn its potentiometer until it stands still.",
        "Put each servo in from outside until its ears lie on the wall; the shaft is at the end nearer to the car's end. "
        f"Each is held by two screws ({catalogue().screw.name}).",
        "Mark the leads: " + "; ".join(f"{axle.servo}: output {axle.channel}" for axle in axles) + ".",
    ]
    pictures = (
        Picture(picture(together(shapes), ASLANT, "Servos in the open beam"), "the open beam, seen from its right"),
        Picture(picture(together(shapes), camera(125, 32), "Servos in the open beam"), "the same from its left"),
    )
    return Step(f"Screw in the servos{of}", tuple(lines), pictures)


def _inside(folded: FoldedCar, body: Body, film: list[PlacedPiece], of: str) -> Step:
    shapes = [body.base_shape(LID_OPEN), *(body.piece_shape(placed, LID_OPEN) for placed in film)]
    shapes += body.mount_shapes(LID_OPEN, lambda mount: mount.part != catalogue().wiring.name)
    lines = []
    for placed in film:
        piece = body.pieces[placed.piece]
        found = sorted({j.number for j in folded.joins if j.piece_a == piece.name and j.kind == "tab_slot"})
        if found:
            lines.append(f"Put the folded {piece.label} in: its tongues go through the slots, joins {numbers(found)}.")
    fixed = [m for m in body.mounts if m.part not in (catalogue().servo.name, catalogue().wiring.name)]
    for mount in fixed:
        how = f"with {len(mount.holes)} screws" if mount.holes else "with double-sided tape or on its headers"
        lines.append(f"{mount.name}: fix it {how}.")
    lines.append("Lead the servos' cables to the boards and plug them in: see the wiring.")
    own = Picture(picture(together(shapes), ASLANT, "Inside the car"), "before the beam is closed")
    return Step(f"Build in boards and batteries{of}", tuple(lines), (own,))


def _close(folded: FoldedCar, body: Body, caps: list[PlacedPiece], of: str) -> Step:
    lines, marks = [], []
    base = body.base_piece
    own = sorted({join.number for join in folded.joins if join.piece_a == join.piece_b == base.name})
    if own:
        lines.append(f"Close the beam and glue its seam from inside: join {numbers(own)}.")
    inside = [placed for placed in body.others if _part_of(body, placed) in ("doubling", "inside")]
    shapes = [body.base_shape(creases=False), *map(body.piece_shape, inside), *body.mount_shapes()]
    middle = np.array([placed.pose for placed in caps])[:, 0, 3].mean() if caps else 0.0
    for cap in caps:
        apart = np.array([math.copysign(EXPLODED_MM, np.array(cap.pose)[0, 3] - middle), 0, 0])
        shapes.append(body.piece_shape(cap, apart=apart))
        pose = np.array(cap.pose)
        pose[:3, 3] += apart
        marks += join_marks(folded, body.pieces[cap.piece], pose, 1.0, key(cap))
        found = sorted({join.number for join in folded.joins if join.piece_a == cap.piece})
        lines.append(f"Glue the {body.pieces[cap.piece].label} in, its tabs inside the walls: joins {numbers(found)}.")
    marks += join_marks(folded, base, np.array(body.base.pose), 1.0, key(body.base))
    views = ((FROM_FRONT, "from the front"), (camera(218, 30), "from the rear"))
    pictures = tuple(Picture(picture(together(shapes), view, f"Caps, {text}", marks), text) for view, text in views)
    return Step(f"Close the beam{of}", tuple(lines), pictures)


def _left(folded: FoldedCar, bodies: list[Body], left: list[tuple[Body, PlacedPiece]]) -> Step:
    """The step that glues pieces onto closed beams: hinges between segments, and pieces of user modules."""
    names = {placed.piece for _, placed in left}
    joins = [join for join in folded.joins if join.piece_a in names]
    lines = list(dict.fromkeys(
        f"Join {j.number}: glue the {j.piece_a}, {j.a.face}, to the {j.piece_b}, {j.b.face}." for j in joins
    ))  # fmt: skip
    if folded.hinges:
        low, high = (math.degrees(limit) for limit in (folded.hinges[0].min_rad, folded.hinges[0].max_rad))
        lines.append(
            "A hinge's strip stays flat and uncreased between the segments. When the glue is dry, the segments pitch "
            f"freely from {low:.0f}° (nose down) to {high:.0f}° (nose up) against each other."
        )
    shape = together([one for body in bodies for one in _body_shapes(body)])
    views = ((FROM_FRONT, "from above"), (camera(38, -28), "from below"))
    pictures = tuple(Picture(picture(shape, view, f"Segments {text}"), text) for view, text in views)
    title = "Join the segments" if len(bodies) > 1 else f"Glue on the {listed(sorted(names))}"
    return Step(title, tuple(lines), pictures)


def _body_shapes(body: Body) -> list[Shape]:
    driving = {axle.servo for axle in body.folded.axles}
    pieces = [body.piece_shape(placed, tabs=False) for placed in body.others if _part_of(body, placed) in ("cap", "left")]
    return [body.base_shape(creases=False), *pieces, *body.mount_shapes(wanted=lambda mount: mount.name in driving)]


def _bodies(folded: FoldedCar, kind: str) -> list[str]:
    return sorted({placed.body for placed in folded.placed if placed.body.startswith(kind)})
