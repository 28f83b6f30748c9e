"""Counts what a person does by hand to build a car, and estimates how long that takes.

Input: a FoldedCar, and the CutCar of its sheets. Output: Operations. Film is held by tape, which needs no time to
dry. Cutting is the machine's work and is not counted, nor are soldering the boards' headers and loading the firmware.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from pydantic import TypeAdapter

from foldcar.car.folded.model import Crease, FoldedCar, Join, Mount, Piece, Wire
from foldcar.car.parts.bought import Screw
from foldcar.car.parts.catalogue import Catalogue
from foldcar.car.parts.quantity import Quantity
from foldcar.car.proof.prove import assembly_steps
from foldcar.car.proof.step import AssemblyStep
from foldcar.fabrication.patterns.sheets import CutCar

TAPED = ("lap", "tab", "laminate")
PUSHED = ("tab_slot", "lock", "rim")
# A servo's lead, a lead in a terminal, one board on another; the computer's cable belongs to driving.
PLUGGED = ("signal", "supply", "stack")


class Kind(Quantity):
    """A kind of operation: seconds of practised work for one; its name in singular and plural."""

    one: str = ""
    many: str = ""


@cache
def kinds() -> dict[str, Kind]:
    """The kinds by the fields of Operations, and ``pace``: the time of a first build over that of practised work."""
    text = files("foldcar.fabrication.assembly").joinpath("operations.json").read_text(encoding="utf-8")
    return TypeAdapter(dict[str, Kind]).validate_json(text)


@dataclass(frozen=True, slots=True)
class Operations:
    """How many of each kind, as operations.json describes them."""

    piece: int = 0
    fold: int = 0
    wind: int = 0
    tape: int = 0
    tongue: int = 0
    turn: int = 0
    part: int = 0
    screw: int = 0
    nut: int = 0
    plug: int = 0
    weed: int = 0

    @property
    def counts(self) -> dict[str, int]:
        """The number of each kind, by its name."""
        return {kind: getattr(self, kind) for kind in self.__dataclass_fields__}

    @property
    def total(self) -> int:
        """All of them but weeding, which is told apart: a laser's openings fall out."""
        return sum(self.counts.values()) - self.weed

    def __add__(self, other: "Operations") -> "Operations":
        return Operations(**{kind: count + other.counts[kind] for kind, count in self.counts.items()})

    def named(self, *but: str) -> list[tuple[str, int]]:
        """Name and number of each kind that there is, ``but`` some."""
        there = {kind: count for kind, count in self.counts.items() if count and kind not in but}
        return [(kinds()[kind].one if count == 1 else kinds()[kind].many, count) for kind, count in there.items()]

    @property
    def _seconds(self) -> float:
        return sum(count * kinds()[kind].value for kind, count in self.counts.items())

    @property
    def minutes(self) -> float:
        """The estimate."""
        return self._seconds * kinds()["pace"].value / 60

    @property
    def minutes_between(self) -> tuple[float, float]:
        """The estimate's interval: the tolerances of pace and of every kind's seconds as independent errors."""
        pace, seconds = kinds()["pace"], self._seconds or math.inf
        errors = math.hypot(*(count * kinds()[kind].tolerance for kind, count in self.counts.items()))
        share = math.hypot(pace.tolerance / pace.value, errors / seconds)
        return self.minutes * (1 - share), self.minutes * (1 + share)


def operations(car: FoldedCar, cut: CutCar) -> Operations:
    """All operations of the car: pieces out of the sheets, parts of pieces joined, all steps of the assembly."""
    return sum((done for _, done in by_step(car)), of_sheets(cut) + of_parting(car, cut))


def of_sheets(cut: CutCar) -> Operations:
    """Every piece, and every part of one, is taken out of its sheet, and the waste out of all its openings."""
    openings = sum(piece.count * (len(piece.outline.interiors) + len(piece.circles)) for piece in cut.pieces)
    return Operations(piece=sum(piece.count for piece in cut.pieces), weed=openings)


def of_parting(car: FoldedCar, cut: CutCar) -> Operations:
    """What joins pieces that the sheets have in parts: tabs along folds, with their folds."""
    known = {join.number for join in car.joins}
    new = [join for join in cut.car.joins if join.number not in known]
    more = sum(p.count * len(_by_hand(p)) for p in cut.car.pieces) - sum(p.count * len(_by_hand(p)) for p in car.pieces)
    return Operations(fold=max(more, 0), tape=sum(_times(cut.car, join) for join in new if join.kind in TAPED))


def by_step(car: FoldedCar) -> list[tuple[AssemblyStep, Operations]]:
    """The steps of the assembly and what is done in each."""
    before: dict[str, dict[str, float]] = {}
    pieces = {piece.name: piece for piece in car.pieces}
    mounts = {mount.name: mount for mount in car.mounts}
    nutted = {part.name for _, part in car.parts if isinstance(part, Screw) and part.nut_width_mm}
    result = []
    for step in assembly_steps(car):
        folded = [pieces[name] for name in step.folds]
        joins = [join for join in car.joins if join.number in step.joins for _ in range(_times(car, join))]
        parts = [mounts[added.name] for added in step.adds if added.kind == "mount"]
        # The LiPo alone is laid onto tape: pads are sticky themselves. The wires are plugs.
        done = Operations(
            fold=sum(piece.count * len(closing(step, before, piece)) for piece in folded),
            wind=sum(piece.count for piece in folded if is_wound(piece)),
            tape=sum(join.kind in TAPED for join in joins) + sum(mount.part == car.parts.lipo.name for mount in parts),
            tongue=sum(join.kind in PUSHED for join in joins),
            turn=sum(_times(car, join) for join in turned(car, step)),
            part=sum(not is_screw(car.parts, mount) and mount.part != car.parts.wiring.name for mount in parts)
            + sum(added.kind == "unit" for added in step.adds),
            screw=sum(is_screw(car.parts, mount) for mount in parts),
            nut=sum(mount.part in nutted for mount in parts),
            plug=len(plugs_in(car, step)),
        )
        for name, creases in step.folds.items():
            before.setdefault(name, {}).update(creases)
        result.append((step, done))
    return result


def closing(step: AssemblyStep, before: Mapping[str, Mapping[str, float]], piece: Piece) -> list[Crease]:
    """The folds of one copy of ``piece`` that a step makes or closes by hand; ``before`` are those closed so far.

    A fold named with 0 is made, and left open.
    """
    done, named = before.get(piece.name, {}), step.folds.get(piece.name, {})
    return [c for c in _by_hand(piece) if c.name in named and named[c.name] != done.get(c.name)]


def plugs_in(car: FoldedCar, step: AssemblyStep) -> list[Wire]:
    """The wires plugged in a step: those of the boards' stack with the upper board, all others with the wires."""
    parts = {mount.name: mount.part for mount in car.mounts}
    added = {parts[add.name] for add in step.adds if add.kind == "mount"}
    steps = {"stack": car.parts.featherwing.name}
    wires = [wire for wire in car.wires if wire.carries in PLUGGED]
    return [wire for wire in wires if steps.get(wire.carries, car.parts.wiring.name) in added]


def is_wound(piece: Piece) -> bool:
    """Whether the piece is a strip that is wound to a ring."""
    return any(crease.bend for crease in piece.creases)


def turned(car: FoldedCar, step: AssemblyStep) -> list[Join]:
    """One join for each disc that a step turns against a wheel's hub until its hooks hold."""
    discs = {piece.name for piece in car.pieces if not piece.creases} & _on_wheels(car)
    found: dict[str, Join] = {}
    for join in car.joins:
        if join.number in step.joins and join.kind == "lock" and join.piece_b in discs:
            found.setdefault(join.piece_b, join)
    return list(found.values())


def is_screw(parts: Catalogue, mount: Mount) -> bool:
    """Whether the part is a screw, with or without a nut."""
    return mount.part in {part.name for _, part in parts if isinstance(part, Screw)}


def _by_hand(piece: Piece) -> list[Crease]:
    return [c for c in piece.creases if c.angle_rad and not c.flexure and not c.bend]


def _times(car: FoldedCar, join: Join) -> int:
    """How often a join is made: the joins of one wheel stand for all of its unit."""
    wheels = {axle.wheel for axle in car.axles}
    return len({one.body for one in car.placed if one.piece == join.piece_a and one.body in wheels}) or 1


def _on_wheels(car: FoldedCar) -> set[str]:
    """The pieces of wheels."""
    wheels = {axle.wheel for axle in car.axles}
    return {placed.piece for placed in car.placed if placed.body in wheels}


def minutes(value: float) -> str:
    """Minutes as text."""
    return f"{value:.0f} min" if value >= 1 else "1 min"
