"""The steps that make a car: what to do, in words, and pictures of each fold state.

Input: a FoldedCar. Output: Steps in order. Words and numbers follow from the design: its folds, joins, mounts and axles.
"""

import math
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from foldcar.assembly.drawing import Mark, picture
from foldcar.assembly.facets import Shape, film_shape, mount_shape, together
from foldcar.assembly.guide_shapes import Body, key, outside, same_shapes, whole_car
from foldcar.assembly.hidden_surfaces import camera
from foldcar.assembly.join_marks import join_marks
from foldcar.parts import catalogue
from foldcar.sheet.model import FoldedCar, Join, Piece, PlacedPiece

ABOVE = camera(-90, 90)
ASLANT = camera(-55, 32)
FROM_FRONT = camera(38, 30)
EXPLODED_MM = 45.0
SERVOS_SEEN = 0.55
LID_OPEN = 0.6


@dataclass(frozen=True, slots=True)
class Picture:
    """An SVG element and its caption."""

    svg: str
    caption: str


@dataclass(frozen=True, slots=True)
class Step:
    """One step: what to do, line by line."""

    title: str
    lines: tuple[str, ...]
    pictures: tuple[Picture, ...] = ()


def steps(folded: FoldedCar) -> list[Step]:
    """All steps, from cutting to the finished car."""
    segments = [Body(folded, name) for name in _bodies(folded, "segment")]
    wheels = [Body(folded, name) for name in _bodies(folded, "wheel")]
    found = [_cut(folded), *_folds(folded)]
    for body in segments:
        found += _segment(folded, body, f" of segment {segments.index(body) + 1}" if len(segments) > 1 else "")
    if folded.hinges:
        found.append(_hinges(folded))
    if wheels:
        found += [_wheel(folded, wheels[0], len(wheels)), _wheels_on(folded)]
    return found


def finished(folded: FoldedCar) -> Picture:
    """The whole car."""
    return Picture(picture(whole_car(folded, FROM_FRONT), FROM_FRONT, "The finished car"), "the finished car")


def _cut(folded: FoldedCar) -> Step:
    pictures = []
    for piece in folded.pieces:
        rim = any(face.role == "rim" for face in piece.faces)
        marks = [] if rim else join_marks(folded, piece, np.eye(4), 0.0)
        svg = picture(film_shape(piece, np.eye(4), 0.0), ABOVE, piece.label, marks, enlarged=2.0)
        times = f", {piece.count} times" if piece.count > 1 else ""
        pictures.append(Picture(svg, f"{piece.label}{times}"))
    lines = (
        "Cut all pieces from the sheets. Score the folds or cut them as dashes; do not fold yet.",
        "Pictures show the printed side. Numbers in circles are joins: the same number stands on both sides of a join.",
        "Fold valleys (blue, dashed) towards you and mountains (red, dash-dotted) away from you, the printed side up.",
    )
    return Step("Cut the pieces", lines, tuple(pictures))


def _folds(folded: FoldedCar) -> Iterator[Step]:
    for group in same_shapes(piece for piece in folded.pieces if piece.creases):
        piece = group[0]
        rim = any(face.role == "rim" for face in piece.faces)
        names = " and ".join(one.label for one in group)
        times = f" ({piece.count} times)" if piece.count > 1 else ""
        states = ((0.5, "half folded"), (1.0, "folded")) if rim else ((0.0, "flat"), (0.5, "half folded"), (1.0, "folded"))
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
        yield Step(f"Fold the {names}{times}", tuple(_fold_lines(folded, piece, rim)), pictures)


def _fold_lines(folded: FoldedCar, piece: Piece, rim: bool) -> Iterator[str]:
    if rim:
        tabs = sum(face.role == "tab" for face in piece.faces)
        yield f"Bend the {tabs} teeth to the printed side by 90° and roll the strip evenly to a ring, printed side inside."
    else:
        rims = {face.name for face in piece.faces if face.role == "rim"}
        folds = Counter(
            ("valley" if c.angle_rad > 0 else "mountain", round(math.degrees(abs(c.angle_rad))))
            for c in piece.creases
            if c.child.face not in rims and not c.flexure and c.angle_rad
        )
        for (kind, degrees), count in folds.items():
            yield f"{count} {kind} fold{'s' if count > 1 else ''} of {degrees}°. Crease each fully once, then let go."
        if any(crease.flexure for crease in piece.creases):
            yield "Do not crease the flexure (grey): it bends when the car drives."
    own = sorted({join.number for join in folded.joins if join.piece_a == join.piece_b == piece.name})
    if own and rim:
        yield f"Glue the ends together: join {_numbers(own)}."
    elif own:
        yield f"Its own seam, join {_numbers(own)}, is glued later."


def _segment(folded: FoldedCar, body: Body, of: str) -> Iterator[Step]:
    """The beam of one segment: doublings, servos, boards, seam, caps."""
    base = body.base_piece
    flat = [placed for placed in body.others if body.face_of(placed) and not body.pieces[placed.piece].creases]
    if flat:
        yield _doublings(folded, body, flat, of)
    servos = [mount for mount in body.mounts if mount.part == catalogue().servo.name]
    if servos:
        yield _servos(folded, body, flat, of)
    inside = [placed for placed in body.others if placed not in flat and not _is_cap(folded, placed, base)]
    bought = [m for m in body.mounts if m not in servos and m.part != catalogue().wiring.name]
    if bought or inside:
        yield _inside(folded, body, [*flat, *inside], of)
    caps = [placed for placed in body.others if _is_cap(folded, placed, base)]
    own = sorted({join.number for join in folded.joins if join.piece_a == join.piece_b == base.name})
    yield _close(folded, body, caps, own, of)


def _doublings(folded: FoldedCar, body: Body, flat: list[PlacedPiece], of: str) -> Step:
    shape = together([body.base_shape(0.0), *(body.piece_shape(placed, 0.0) for placed in flat)])
    numbers = sorted({join.number for join in folded.joins if join.kind == "laminate" and join.piece_b == body.base.piece})
    names = ", ".join(f"{count} × {name}" for name, count in Counter(placed.piece for placed in flat).items())
    lines = (
        f"Glue onto the printed side of the flat {body.base_piece.label}: {names}. Join {_numbers(numbers)}.",
        "Openings and screw holes must lie on each other: put screws through them while the glue sets.",
    )
    marks: list[Mark] = []
    for placed in flat:
        pose = body.follow(body.face_of(placed), placed.pose, 0.0)
        marks += join_marks(folded, body.pieces[placed.piece], pose, 0.0, key(placed))
    return Step(f"Double the walls{of}", lines, (Picture(picture(shape, camera(-75, 50), "Doublings", marks), "printed side up"),))


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
        numbers = sorted({j.number for j in folded.joins if j.piece_a == piece.name and j.kind == "tab_slot"})
        if numbers:
            lines.append(f"Put the folded {piece.label} in: its tongues go through the slots, joins {_numbers(numbers)}.")
    fixed = [m for m in body.mounts if m.part not in (catalogue().servo.name, catalogue().wiring.name)]
    for mount in fixed:
        how = f"with {len(mount.holes)} screws" if mount.holes else "with double-sided tape or on its headers"
        lines.append(f"{mount.name}: fix it {how}.")
    lines.append("Lead the servos' cables to the boards and plug them in: see the wiring.")
    own = Picture(picture(together(shapes), ASLANT, "Inside the car"), "before the beam is closed")
    return Step(f"Build in boards and batteries{of}", tuple(lines), (own,))


def _close(folded: FoldedCar, body: Body, caps: list[PlacedPiece], own: list[int], of: str) -> Step:
    lines, marks = [], []
    if own:
        lines.append(f"Close the beam and glue its seam from inside: join {_numbers(own)}.")
    shapes = [body.base_shape(creases=False), *(body.piece_shape(p) for p in body.others if p not in caps)]
    shapes += body.mount_shapes()
    middle = np.array([placed.pose for placed in caps])[:, 0, 3].mean() if caps else 0.0
    for cap in caps:
        apart = np.array([math.copysign(EXPLODED_MM, np.array(cap.pose)[0, 3] - middle), 0, 0])
        shapes.append(body.piece_shape(cap, apart=apart))
        pose = np.array(cap.pose)
        pose[:3, 3] += apart
        marks += join_marks(folded, body.pieces[cap.piece], pose, 1.0, key(cap))
        numbers = sorted({join.number for join in folded.joins if join.piece_a == cap.piece})
        lines.append(f"Glue the {body.pieces[cap.piece].label} in, its tabs inside the walls: joins {_numbers(numbers)}.")
    marks += join_marks(folded, body.base_piece, np.array(body.base.pose), 1.0, key(body.base))
    views = ((FROM_FRONT, "from the front"), (camera(218, 30), "from the rear"))
    pictures = tuple(Picture(picture(together(shapes), view, f"Caps, {text}", marks), text) for view, text in views)
    return Step(f"Close the beam{of}", tuple(lines), pictures)


def _hinges(folded: FoldedCar) -> Step:
    between = [join for join in folded.joins if _body_of(folded, join, "a") != _body_of(folded, join, "b")]
    shapes = [shape for name in _bodies(folded, "segment") for shape in _body_shapes(Body(folded, name))]
    lines = [
        f"Join {join.number}: {join.piece_a} to {join.piece_b}." for join in {join.number: join for join in between}.values()
    ]
    lines.append("The hinge's strip stays flat and uncreased; it must bend freely between the segments.")
    lines += [
        f"It may pitch from {math.degrees(hinge.min_rad):.0f}° to {math.degrees(hinge.max_rad):.0f}°."
        for hinge in folded.hinges[:1]
    ]
    return Step("Join the segments", tuple(lines), (Picture(picture(together(shapes), FROM_FRONT, "Segments"), "joined"),))


def _body_shapes(body: Body) -> list[Shape]:
    return [
        body.base_shape(creases=False), *(body.piece_shape(placed, tabs=False) for placed in body.others), *body.mount_shapes(),
    ]  # fmt: skip


def _wheel(folded: FoldedCar, body: Body, count: int) -> Step:
    """One wheel with its layers pulled apart along the axle, and whole."""
    axle = next(axle for axle in folded.axles if axle.wheel == body.name)
    outward = 1.0 if axle.side == "left" else -1.0
    order = sorted(body.placed, key=lambda placed: (outward * _middle_y(body, placed), placed.copy))
    view = camera(35 if outward > 0 else -35, 18)
    apart, whole = [], []
    for place, placed in enumerate(order):
        shift = np.array([0.0, outward * place * 0.5 * axle.radius_mm, 0.0])
        pose = np.array(placed.pose)
        film = film_shape(body.pieces[placed.piece], pose, 1.0, key(placed), tabs=False, creases=False)
        whole.append(outside(film, view))
        pose[:3, 3] += shift
        apart.append(film_shape(body.pieces[placed.piece], pose, 1.0, key(placed), creases=False))
    for mount in body.mounts:
        pose = np.array(mount.pose)
        pose[1, 3] -= outward * 0.5 * axle.radius_mm
        apart.append(mount_shape(mount, pose))
    names = [piece.name for piece in (body.pieces[placed.piece] for placed in order)]
    lines = []
    for kind, text in (
        ("laminate", "Glue the layers around the hub onto each other and onto the disc, holes on holes: join {}."),
        ("rim", "Glue the ring's teeth onto the discs from inside, one tooth after the other: joins {}."),
    ):
        numbers = sorted({join.number for join in folded.joins if join.kind == kind and join.piece_a in names})
        if numbers:
            lines.append(text.format(_numbers(numbers)))
    lines.append(f"Screw the {catalogue().horn.name} to the disc with the small holes before you close the wheel.")
    pictures = (
        Picture(picture(together(apart), view, "A wheel's layers"), "the layers, horn first"),
        Picture(picture(together(whole), view, "A wheel"), "the wheel, from its outer side"),
    )
    return Step(f"Make the wheels ({count} times)", tuple(lines), pictures)


def _wheels_on(folded: FoldedCar) -> Step:
    shape = whole_car(folded, FROM_FRONT, EXPLODED_MM)
    lines = (
        "Press each wheel's horn onto its servo and drive the servo's own screw in through the hole of the outer disc.",
        "Turn every wheel by hand: it must not touch the wall, nor its neighbour.",
    )
    return Step("Put the wheels on", lines, (Picture(picture(shape, FROM_FRONT, "Wheels beside the car"), ""),))


def _middle_y(body: Body, placed: PlacedPiece) -> float:
    shape = film_shape(body.pieces[placed.piece], np.array(placed.pose), 1.0, tabs=False)
    return float(np.concatenate([facet.rings_mm[0] for facet in shape.facets])[:, 1].mean())


def _bodies(folded: FoldedCar, kind: str) -> list[str]:
    return sorted({placed.body for placed in folded.placed if placed.body.startswith(kind)})


def _body_of(folded: FoldedCar, join: Join, side: str) -> str:
    name = join.piece_a if side == "a" else join.piece_b
    return next(placed.body for placed in folded.placed if placed.piece == name)


def _is_cap(folded: FoldedCar, placed: PlacedPiece, base: Piece) -> bool:
    """Whether a piece is glued to the base by tabs of its own."""
    return any(j.kind == "tab" and j.piece_a == placed.piece and j.piece_b == base.name for j in folded.joins)


def _numbers(numbers: Iterable[int]) -> str:
    """Numbers as people list them: ``2 to 5, 11``."""
    runs: list[list[int]] = []
    for number in sorted(numbers):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs)
