"""The instructions that put parts in: what the hand does, on which side of the film, and with which tool.

Input: a step and the AssemblyState before it. Output: lines of text, in the order of the proof.
"""

import itertools
import re
from collections.abc import Iterable, Sequence

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
    words, screws = _InsertionWords(step, state), _screws(parts, state)
    instructions = [(f"{words.label(part)}: {words.insertion(part)}", part in screws) for part in parts]
    counted = [(text, turned, len(list(group))) for (text, turned), group in itertools.groupby(instructions)]
    texts = [f"{count} × {text}" if count > 1 else text for text, _, count in counted]
    # The length of the shortest sequence of instructions that, repeated, gives all of them.
    period = next((p for p in range(1, len(texts) + 1) if texts == texts[:p] * (len(texts) // p)), 1)
    turn_line = [_turn_line(screws)] if screws else []
    if 1 < period < len(texts):
        return [f"{len(texts) // period} times: {'; then '.join(texts[:period])}.", *turn_line]
    # Screws are turned before the parts that cover them go in.
    end = max((number for number, (_, turned, _) in enumerate(counted, 1) if turned), default=0)
    lines = [f"{text[0].upper()}{text[1:]}." for text in texts]
    return [*lines[:end], *turn_line, *lines[end:]]


def _screws(parts: Sequence[AddedPart], state: AssemblyState) -> list[AddedPart]:
    return [part for part in parts if part.kind == "mount" and is_screw(state.car.parts, state.mounts[part.name])]


def _turn_line(screws: Sequence[AddedPart]) -> str:
    """Return how screws are turned, and how their nuts are held."""
    nuts = any(screw.nut_mm for screw in screws)
    return f"Turn the screws with the {DRIVER}{', and hold their nuts with pliers' if nuts else ''}."


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
        """Return what the hand does with a part, and from which side it comes."""
        if added.kind == "mount" and is_screw(self.state.car.parts, self.state.mounts[added.name]):
            return self._screw(added)
        on_wheel = added.body in {axle.wheel for axle in self.state.car.axles}
        if not added.way_mm:
            if self._is_laid(added):
                return "lay it down, its printed side up"
            if added.kind == "piece":
                return "wind it around the discs"
            return TYRES[self._tyre_form()] if on_wheel else "lay it down"
        if self._is_layer(added):
            return self._layer(added)
        side = self._printed_side(added)
        # A flat piece that stands upright in the car has no above and below in the hand: its sides are named.
        upright = self.host is not None and added.kind == "mount" and abs(self._normal(self.host)[2]) < PARALLEL
        if upright and self.step.unit and not on_wheel:
            return f"push it in from the {self._film_side(added)}{side}"
        return f"{self._verb(added, on_wheel)} {self._directions(added, added.way_mm)}{side}"

    def _is_laid(self, added: AddedPart) -> bool:
        return added.kind == "piece" and not added.way_mm and not is_wound(self.state.pieces[added.name])

    def _tyre_form(self) -> str:
        tyre = self.state.car.parts.tyre
        return "tube" if tyre.form == "tube" else "tape" if tyre.stretch is None else "band"

    def _verb(self, added: AddedPart, on_wheel: bool) -> str:
        """Return what the hand does with a part.

        The last move decides: it goes down into the car, on top of others, or sideways.
        """
        last = added.way_mm[-1]
        axis = int(np.argmax(np.abs(last)))
        if len(added.way_mm) > 1:
            return "move it in"
        if on_wheel:
            return "push it on"
        if added.kind == "mount" and self.state.roles.is_on_lid(self.state.mounts[added.name]):
            return "put it on"
        if axis != 2:
            return "push it in"
        return "put it on" if self.host is not None else "put it in"

    def _is_layer(self, added: AddedPart) -> bool:
        """Return whether a piece of the step becomes a layer on another piece."""
        return added.kind == "piece" and any(join.piece_a == added.name for join in self._laminates())

    def _laminates(self) -> list[Join]:
        return [join for join in self.state.car.joins if join.number in self.step.joins and join.kind == "laminate"]

    def _layer(self, added: AddedPart) -> str:
        """Return onto which side of which piece a layer is laid, and which side of the layer is up then."""
        (copy,) = (part for part in self.state.parts_of(added) if isinstance(part, PlacedPiece))
        meetings = []
        for join in (join for join in self._laminates() if join.piece_a == added.name):
            own = np.array(self.state.stage.faces(copy)[join.a.face])
            middle = self.state.face_centres(copy, self.state.stage)[join.a.face]
            for under in (part for part in self.state.car.placed if part.piece == join.piece_b):
                other = np.array(self.state.stage.faces(under)[join.b.face])
                distance = float(np.linalg.norm(middle - self.state.face_centres(under, self.state.stage)[join.b.face]))
                height = float(other[:3, 2] @ (own[:3, 3] - other[:3, 3]))
                aligned = float(own[:3, 2] @ other[:3, 2])
                meetings.append((abs(height), distance, height > 0, aligned > 0, join.piece_b))
        # The layer's own film is the nearest parallel one.
        nearest = min(height for height, *_ in meetings) + self.state.car.parts.film_mm / 2
        _, _, on_print, aligned, host = min((m for m in meetings if m[0] <= nearest), key=lambda meeting: meeting[1])
        label = NUMBER.sub("", self.state.pieces[host].label)
        own_side = "up" if aligned == on_print else "down"
        return f"lay it onto the {'' if on_print else 'un'}printed side of the {label}, its own printed side {own_side}"

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
        """Return to which side the printed side of a piece, or of a unit on it, points; "" for other parts."""
        pieces = [part for part in self.state.parts_of(added) if isinstance(part, PlacedPiece)]
        own = next((part for part in pieces if part.piece == added.name), None)
        if own is None:
            return ""
        normal = np.array(self._normal(own))
        if abs(normal[2]) > PARALLEL:
            return f", its printed side {'up' if normal[2] > 0 else 'down'}"
        centres_mm = [
            np.mean([*self.state.face_centres(part, self.state.stage).values()], axis=0)
            for part in self.state.car.placed
            if part.body == added.body
        ]
        own_mm = np.array(self.state.pose(own))[:3, 3]
        inwards = float(normal @ (np.mean(centres_mm, axis=0) - own_mm))
        return f", its printed side {'inside' if inwards > 0 else 'outside'}"

    def _screw(self, screw: AddedPart) -> str:
        """Return from which side a screw comes and what it passes.

        Then name its nut or, without one, the part that holds it.
        """
        state = self.state
        labels = {("mount", name): mount.part for name, mount in state.mounts.items()}
        labels |= {("piece", name): NUMBER.sub("", piece.label) for name, piece in state.pieces.items()}
        passed = [labels[kind, name] for kind, name, _ in screw.passes]
        into = nut = ""
        if screw.nut_mm:
            nut = f", and put its nut on {self._directions(screw, screw.nut_mm[-1:])}"
        elif passed:
            *passed, last = passed
            into = f" into the {last}"
        through = f" through {join_words([f'the {name}' for name in passed])}" if passed else ""
        return f"push it in {self._directions(screw, screw.way_mm)}{through}{into}{nut}"

    def _directions(self, added: AddedPart, moves: Sequence[Vector]) -> str:
        """Return from which sides a part comes along its moves (3,).

        Along y the sides are those of the wheel if the part goes into a unit, such as a wheel, else those of the car.

        Example: ``from above, then from the left``
        """
        # y of the part's wheel, or of the mount: a part that moves towards y = 0 comes from outside.
        axle = next((axle for axle in self.state.car.axles if axle.wheel == added.body), None)
        mount_y_mm = self.state.mounts[added.name].pose[1][3] if added.kind == "mount" else 0.0
        y_mm = axle.center_mm[1] if axle else mount_y_mm
        sides = []
        for move in moves:
            axis = int(np.argmax(np.abs(move)))
            comes_from_outside = move[1] * y_mm < 0
            if axis != 1 or abs(y_mm) < MIDDLE_MM:
                sides.append(SIDES[axis][0 if move[axis] < 0 else 1])
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


def number_ranges(joins: Iterable[int]) -> str:
    """Format numbers with ranges shortened: ``2 to 5, 11``."""
    runs: list[list[int]] = []
    for number in sorted(joins):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs)
