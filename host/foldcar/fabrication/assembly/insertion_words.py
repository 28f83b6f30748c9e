"""The instructions that put parts in: what the hand does, on which side of the film, and with which tool.

Input: a step and the AssemblyState before it. Output: lines of text, in the order of the proof.
"""

import itertools
import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from foldcar.car.folded.model import Join, PlacedPiece
from foldcar.car.proof.step import AddedPart, AssemblyStep, Vector
from foldcar.fabrication.assembly.guide_state import AssemblyState
from foldcar.fabrication.assembly.operations import is_screw, is_wound

DRIVER = "PH0 screwdriver"
# A part is on the left or right of the car if its distance from the middle plane is larger.
MIDDLE_MM = 10.0
# The number of a beam is left out: a screw passes through its own beam.
NUMBER = re.compile(r" \d+$")
SIDES = (("the front", "the rear"), ("the left", "the right"), ("above", "below"))
# Two directions are parallel above this cosine.
PARALLEL = 0.9


def insertion_lines(step: AssemblyStep, state: AssemblyState) -> list[str]:
    """Return the instructions for putting in the parts of a step, in their order. Repetitions are counted, not written.

    If a step builds a unit for several bodies, the first body stands for all. Wires have lines of their own.
    """
    of_first_body = [added for added in step.adds if not step.unit or added.body == step.adds[0].body]
    wires = {mount.name for mount in state.car.mounts if mount.part == state.car.parts.wiring.name}
    parts = [added for added in of_first_body if added.name not in wires]
    screws = _screws(parts, state)
    turn_line = [_turn_line(screws)] if screws else []
    counted = _counted_instructions(parts, screws, _InsertionWords(step, state))
    texts = [instruction.text for instruction in counted]
    # All texts may be one sequence that is repeated.
    length = _period(texts)
    if 1 < length < len(texts):
        return [f"{len(texts) // length} times: {'; then '.join(texts[:length])}.", *turn_line]
    lines = [f"{text[0].upper()}{text[1:]}." for text in texts]
    # Screws are turned before the parts that cover them go in, so directly after the last of them.
    screw_positions = [number for number, instruction in enumerate(counted, 1) if instruction.is_screw]
    turn_position = max(screw_positions, default=0)
    return [*lines[:turn_position], *turn_line, *lines[turn_position:]]


class _Instruction(NamedTuple):
    """What the hand does with a part, or with several equal parts, and whether these are screws."""

    text: str
    is_screw: bool


def _counted_instructions(
    parts: Sequence[AddedPart], screws: Sequence[AddedPart], words: "_InsertionWords"
) -> list[_Instruction]:
    """Return the instructions for the parts in their order. Equal ones that follow each other become one with a count."""
    instructions = [_Instruction(f"{words.label(part)}: {words.insertion(part)}", part in screws) for part in parts]
    counted = []
    for instruction, group in itertools.groupby(instructions):
        count = len(list(group))
        text = f"{count} × {instruction.text}" if count > 1 else instruction.text
        counted.append(_Instruction(text, instruction.is_screw))
    return counted


def _period(texts: Sequence[str]) -> int:
    """Return the length of the shortest sequence at the beginning of ``texts`` that, repeated, gives all of them."""
    for length in range(1, len(texts) + 1):
        repetitions = len(texts) // length
        if list(texts) == list(texts[:length]) * repetitions:
            return length
    return 1


def _screws(parts: Sequence[AddedPart], state: AssemblyState) -> list[AddedPart]:
    """Return those of the added parts that are screws."""
    return [part for part in parts if part.kind == "mount" and is_screw(state.car.parts, state.mounts[part.name])]


def _turn_line(screws: Sequence[AddedPart]) -> str:
    """Return how screws are turned, and how their nuts are held."""
    nuts = any(screw.nut_mm for screw in screws)
    return f"Turn the screws with the {DRIVER}{', and hold their nuts with pliers' if nuts else ''}."


class _LayerPlace(NamedTuple):
    """How a layer of film lies on a piece.

    ``height_mm`` is the distance between both films, and ``distance_mm`` that of the middles of their faces.
    ``is_on_print`` is whether the layer lies on the printed side of the piece. ``prints_agree`` is whether both printed
    sides point in the same direction.
    """

    piece: str
    height_mm: float
    distance_mm: float
    is_on_print: bool
    prints_agree: bool

    @property
    def own_print(self) -> str:
        """Where the layer's printed side points, "up" or "down", if the side of the piece that gets it is up."""
        piece_print_is_up = self.is_on_print
        own_print_is_up = piece_print_is_up if self.prints_agree else not piece_print_is_up
        return "up" if own_print_is_up else "down"


class _InsertionWords:
    """The words about the parts of a step. ``host`` is the piece that lies flat, onto which the step puts its parts."""

    def __init__(self, step: AssemblyStep, state: AssemblyState) -> None:
        self.step, self.state = step, state
        body = step.adds[0].body if step.adds else ""
        in_unit = state.unit_parts(step.unit, body) if step.unit else []
        laid = [part for added in step.adds if self._is_laid(added) for part in state.parts_of(added)]
        pieces = [part for part in (*in_unit, *laid) if isinstance(part, PlacedPiece)]
        self.host = pieces[0] if pieces else None

    def label(self, added: AddedPart) -> str:
        """Return the name of an added unit, piece or bought part as the guide prints it."""
        if added.kind == "unit":
            return added.name
        if added.kind == "piece":
            return self.state.pieces[added.name].label
        return self.state.mounts[added.name].part

    def insertion(self, added: AddedPart) -> str:
        """Return what the hand does with a part, and from which side the part comes.

        The words differ for screws, for parts without a way, for layers, and for all other parts.
        """
        if added.kind == "mount" and is_screw(self.state.car.parts, self.state.mounts[added.name]):
            return self._screw(added)
        on_wheel = added.body in {axle.wheel for axle in self.state.car.axles}
        if not added.way_mm:
            return self._without_way(added, on_wheel)
        if self._is_layer(added):
            return self._layer(added)
        printed_side = self._printed_side(added)
        # The piece that the step assembles in the hand may stand upright in the car. In the hand it lies, so what is
        # above or below it in the car has no meaning. The sides of its film are named instead.
        host_stands_in_car = self.host is not None and abs(self._normal(self.host)[2]) < PARALLEL
        goes_into_unit = bool(self.step.unit) and added.kind == "mount" and not on_wheel
        if host_stands_in_car and goes_into_unit:
            return f"push it in from the {self._film_side(added)}{printed_side}"
        return f"{self._verb(added, on_wheel)} {self._directions(added, added.way_mm)}{printed_side}"

    def _without_way(self, added: AddedPart, on_wheel: bool) -> str:
        """Return what the hand does with a part that has no way: it is laid down, wound around discs, or stretched."""
        if self._is_laid(added):
            return "lay it down, its printed side up"
        if added.kind == "piece":
            return "wind it around the discs"
        return TYRES[self._tyre_form()] if on_wheel else "lay it down"

    def _is_laid(self, added: AddedPart) -> bool:
        return added.kind == "piece" and not added.way_mm and not is_wound(self.state.pieces[added.name])

    def _tyre_form(self) -> str:
        """Return the form of the car's tyres, as a key of TYRES."""
        tyre = self.state.car.parts.tyre
        if tyre.form == "tube":
            return "tube"
        return "tape" if tyre.stretch is None else "band"

    def _verb(self, added: AddedPart, on_wheel: bool) -> str:
        """Return the verb for a part that moves to its place: move, push or put it in or on.

        ``way_mm`` has the straight moves of the part in the car's frame, in which z points up.
        """
        if len(added.way_mm) > 1:
            # It moves in several directions.
            return "move it in"
        if on_wheel:
            return "push it on"
        if added.kind == "mount" and self.state.roles.is_on_lid(self.state.mounts[added.name]):
            return "put it on"
        axis = int(np.argmax(np.abs(added.way_mm[0])))
        moves_down = axis == 2
        if not moves_down:
            return "push it in"
        # It is put onto the piece that lies flat, or else into the car.
        return "put it on" if self.host is not None else "put it in"

    def _is_layer(self, added: AddedPart) -> bool:
        """Return whether a piece of the step becomes a layer on another piece."""
        return added.kind == "piece" and any(join.piece_a == added.name for join in self._laminates())

    def _laminates(self) -> list[Join]:
        return [join for join in self.state.car.joins if join.number in self.step.joins and join.kind == "laminate"]

    def _layer(self, added: AddedPart) -> str:
        """Return words on how a layer is laid: onto which side of which piece, and with which of its own sides up."""
        (layer,) = (part for part in self.state.parts_of(added) if isinstance(part, PlacedPiece))
        candidates: list[_LayerPlace] = []
        for join in self._laminates():
            if join.piece_a != added.name:
                continue
            for placed in self.state.car.placed:
                if placed.piece == join.piece_b:
                    candidates.append(self._layer_place(layer, placed, join))
        # Several copies of the piece may be in the car, as in its wheels. The layer touches those whose film is nearest.
        # One of these is the copy that it lies on: that whose middle is nearest.
        nearest_mm = min(place.height_mm for place in candidates) + self.state.car.parts.film_mm / 2
        touching = [place for place in candidates if place.height_mm <= nearest_mm]
        place = min(touching, key=lambda place: place.distance_mm)
        label = NUMBER.sub("", self.state.pieces[place.piece].label)
        side = "printed" if place.is_on_print else "unprinted"
        return f"lay it onto the {side} side of the {label}, its own printed side {place.own_print}"

    def _layer_place(self, layer: PlacedPiece, under: PlacedPiece, join: Join) -> "_LayerPlace":
        """Return how a layer lies on a placed piece, if ``join`` joins both."""
        stage = self.state.stage
        # The poses of the two faces that lie on each other. The fourth column of a pose is the origin of the face's
        # frame, and the third one its z, which points to the printed side.
        own_pose = np.array(stage.faces(layer)[join.a.face])
        other_pose = np.array(stage.faces(under)[join.b.face])
        own_origin, own_z = own_pose[:3, 3], own_pose[:3, 2]
        other_origin, other_z = other_pose[:3, 3], other_pose[:3, 2]
        height_mm = float(other_z @ (own_origin - other_origin))
        own_middle = self.state.face_centres(layer, stage)[join.a.face]
        other_middle = self.state.face_centres(under, stage)[join.b.face]
        return _LayerPlace(
            piece=join.piece_b,
            height_mm=abs(height_mm),
            distance_mm=float(np.linalg.norm(own_middle - other_middle)),
            is_on_print=height_mm > 0,
            prints_agree=float(own_z @ other_z) > 0,
        )

    def _normal(self, placed: PlacedPiece) -> Vector:
        """Return the direction (3,) to which the printed side of a piece's first face points now."""
        x, y, z = (float(row[2]) for row in self.state.pose(placed)[:3])
        return x, y, z

    def _film_side(self, added: AddedPart) -> str:
        """Return from which side of the host's film a part comes: "printed side" or "unprinted side"."""
        if self.host is None:
            return "printed side"
        return "printed side" if np.dot(added.way_mm[-1], self._normal(self.host)) < 0 else "unprinted side"

    def _printed_side(self, added: AddedPart) -> str:
        """Return words on where the printed side of an added piece points; "" if the part is not a piece.

        For a *unit*, which is several parts that were put together before, this is the piece with the unit's name.
        """
        pieces = [part for part in self.state.parts_of(added) if isinstance(part, PlacedPiece)]
        named_piece = next((part for part in pieces if part.piece == added.name), None)
        if named_piece is None:
            return ""
        normal = np.array(self._normal(named_piece))
        if abs(normal[2]) > PARALLEL:
            return f", its printed side {'up' if normal[2] > 0 else 'down'}"
        # The piece stands upright. Its printed side is inside if it points towards the middle of its body.
        centres_mm = []
        for part in self.state.car.placed:
            if part.body == added.body:
                face_centres_mm = [*self.state.face_centres(part, self.state.stage).values()]
                centres_mm.append(np.mean(face_centres_mm, axis=0))
        piece_mm = np.array(self.state.pose(named_piece))[:3, 3]
        to_middle_mm = np.mean(centres_mm, axis=0) - piece_mm
        points_inwards = float(normal @ to_middle_mm) > 0
        return f", its printed side {'inside' if points_inwards else 'outside'}"

    def _screw(self, screw: AddedPart) -> str:
        """Return words on how a screw is put in: from which side, through which parts, and what holds it.

        It is held by its nut or, if it has none, by the last part that it passes.
        """
        state = self.state
        labels = {("mount", name): mount.part for name, mount in state.mounts.items()}
        labels |= {("piece", name): NUMBER.sub("", piece.label) for name, piece in state.pieces.items()}
        passed = [labels[kind, name] for kind, name, _ in screw.passes]
        held_by = ""
        if screw.nut_mm:
            last_move = screw.nut_mm[-1:]
            held_by = f", and put its nut on {self._directions(screw, last_move)}"
        elif passed:
            *passed, holder = passed
            held_by = f" into the {holder}"
        through = ""
        if passed:
            names = [f"the {name}" for name in passed]
            through = f" through {join_words(names)}"
        return f"push it in {self._directions(screw, screw.way_mm)}{through}{held_by}"

    def _directions(self, added: AddedPart, moves: Sequence[Vector]) -> str:
        """Return from which sides a part comes, such as ``from above, then from the left``.

        ``moves`` are vectors (3,): x points forwards, y to the left, z up. A part on the left or the right of the car
        comes from outside if it moves towards the middle plane of the car, y = 0, and otherwise from inside. If it goes
        into a unit, such as a wheel, these are the outer and the inner side of the unit.
        """
        # y of the part's wheel, or of the part itself.
        y_mm = 0.0
        axle = next((axle for axle in self.state.car.axles if axle.wheel == added.body), None)
        if axle is not None:
            y_mm = axle.center_mm[1]
        elif added.kind == "mount":
            # The last column of a pose is the position.
            _, y_row, *_ = self.state.mounts[added.name].pose
            y_mm = y_row[3]
        is_in_middle = abs(y_mm) < MIDDLE_MM
        sides = []
        for move in moves:
            # The axis along which the part mainly moves.
            axis = int(np.argmax(np.abs(move)))
            moves_sideways = axis == 1
            comes_from_outside = move[1] * y_mm < 0
            if is_in_middle or not moves_sideways:
                # A part that moves backwards comes from the front, and so on.
                side_if_negative, side_if_positive = SIDES[axis]
                sides.append(side_if_negative if move[axis] < 0 else side_if_positive)
            elif self.step.unit:
                sides.append("its outer side" if comes_from_outside else "its inner side")
            else:
                sides.append("outside" if comes_from_outside else "inside")
        return "from " + ", then from ".join(dict.fromkeys(sides))


# What the hand does with a tyre, by its form.
TYRES = {
    "band": "stretch it over the rim",
    "tape": "stick it around the rim",
    "tube": "push it over the rim",
}


def join_words(names: Sequence[str]) -> str:
    """Join names to a list in words: ``a, b and c``."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def number_ranges(numbers: Iterable[int]) -> str:
    """Format numbers with ranges shortened: ``2 to 5, 11``."""
    # A run is a list of numbers that follow each other.
    runs: list[list[int]] = []
    for number in sorted(numbers):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    texts = []
    for run in runs:
        if len(run) > 2:
            texts.append(f"{run[0]} to {run[-1]}")
        else:
            texts += [str(number) for number in run]
    return ", ".join(texts)
