"""Counts the manual operations that build a car, and estimates their time.

Input: a FoldedCar, and the CutCar of its sheets. Output: Operations. Film is held by tape, which needs no time to dry.
Not counted are cutting, which is the machine's work, and loading the firmware.
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from pydantic import TypeAdapter

from foldcar.car.components.bridge import DIVIDER_UPPER, option_resistors
from foldcar.car.components.mounts import BOARD_SWITCH, BUTTON, SERVO_SWITCH
from foldcar.car.folded.model import Crease, FoldedCar, Join, Mount, Piece, Wire
from foldcar.car.leads import leads
from foldcar.car.parts.bought import Screw
from foldcar.car.parts.catalogue import Catalogue
from foldcar.car.parts.quantity import Quantity
from foldcar.car.proof.prove import assembly_steps
from foldcar.car.proof.step import AssemblyStep
from foldcar.fabrication.patterns.sheets import CutCar

TAPED = ("lap", "tab", "laminate")
PUSHED = ("tab_slot", "lock", "rim")
# A servo's lead, a lead in a terminal, a board on another board; the computer's cable belongs to driving.
# Pins of an output, and of the terminal block.
SERVO_PINS, TERMINALS = 3, 2
# Two at the fuse, and one to the wire of the switch.
JOINTS_OF_POSITIVE_LEAD = 3
PLUGGED = ("signal", "supply", "stack")


class Kind(Quantity):
    """A kind of operation: how many seconds it takes with practice, and its name in singular and plural."""

    one: str = ""
    many: str = ""


@cache
def kinds() -> dict[str, Kind]:
    """Return the kinds by the fields of Operations, and ``pace``, the time of a first build divided by that with
    practice.
    """
    text = files("foldcar.fabrication.assembly").joinpath("operations.json").read_text(encoding="utf-8")
    return TypeAdapter(dict[str, Kind]).validate_json(text)


@dataclass(frozen=True, slots=True)
class Operations:
    """The number of operations of each kind; operations.json describes the kinds."""

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
    joint: int = 0
    weed: int = 0

    @property
    def counts(self) -> dict[str, int]:
        """The number of each kind, by its name."""
        return {kind: getattr(self, kind) for kind in self.__dataclass_fields__}

    @property
    def total(self) -> int:
        """The number of all operations, without weeding.

        Weeding is listed separately, because a laser's openings fall out.
        """
        return sum(self.counts.values()) - self.weed

    def __add__(self, other: "Operations") -> "Operations":
        return Operations(**{kind: count + other.counts[kind] for kind, count in self.counts.items()})

    def named(self, *excluded: str) -> list[tuple[str, int]]:
        """Return (name, count) of each kind that occurs, without the ``excluded`` kinds.

        The name is in the plural if needed.
        """
        present = {kind: count for kind, count in self.counts.items() if count and kind not in excluded}
        return [(kinds()[kind].one if count == 1 else kinds()[kind].many, count) for kind, count in present.items()]

    @property
    def _seconds(self) -> float:
        return sum(count * kinds()[kind].value for kind, count in self.counts.items())

    @property
    def minutes(self) -> float:
        """The estimated time of a first build (min)."""
        return self._seconds * kinds()["pace"].value / 60

    @property
    def minutes_between(self) -> tuple[float, float]:
        """The shortest and the longest time that a first build may take (min).

        The pace of a person and the seconds of each kind of operation have tolerances. They are independent errors, so
        their squares add up.
        """
        pace = kinds()["pace"]
        errors_s = math.hypot(*(count * kinds()[kind].tolerance for kind, count in self.counts.items()))
        relative_error_of_seconds = errors_s / self._seconds if self._seconds else 0.0
        relative_error = math.hypot(pace.tolerance / pace.value, relative_error_of_seconds)
        return self.minutes * (1 - relative_error), self.minutes * (1 + relative_error)


def operations(car: FoldedCar, cut: CutCar) -> Operations:
    """Return all operations of the car: taking pieces out of sheets, joining split pieces, all assembly steps."""
    others = operations_of_sheets(cut) + operations_of_splices(car, cut) + operations_of_boards(car)
    return sum((done for _, done in operations_by_step(car)), others)


def operations_of_boards(car: FoldedCar) -> Operations:
    """Return the soldered joints of the boards, as operations.

    They are the rows of pins on both boards, the blocks of servo pins and the terminals of the wing, and the ends of
    wires on the boards. A car without both boards has none.
    """
    parts, boards = car.parts, {mount.part for mount in car.mounts}
    if not {parts.feather.name, parts.featherwing.name} <= boards:
        return Operations()
    rows = len(parts.feather.pins.long_row) + len(parts.feather.pins.short_row)
    controls = [wire for wire in car.wires if wire.carries == "control"]
    # One end is soldered to a board if the wire comes from a switch or the button, or if its other end is in a terminal.
    one_end = sum(wire.b.startswith(parts.feather.name) or wire.b.endswith("terminal +") for wire in controls)
    # The wire to #OE and the resistors have both ends on the boards.
    both_ends = sum(wire.b.endswith("#OE") for wire in controls) + len(option_resistors(parts))
    servo_pins = SERVO_PINS * len(parts.featherwing.outputs.at_mm)
    return Operations(joint=2 * rows + servo_pins + TERMINALS + one_end + 2 * both_ends)


def joints_at_wires(car: FoldedCar) -> int:
    """Return the number of joints from a wire to a wire, a switch or a resistor, which are insulated with tube."""
    at_switches = sum(_joints_of(car, step) for step in assembly_steps(car))
    return at_switches + any(wire.a == DIVIDER_UPPER for wire in car.wires)


def joints(car: FoldedCar) -> int:
    """Return the number of all joints that are soldered."""
    return operations_of_boards(car).joint + sum(_joints_of(car, step) for step in assembly_steps(car))


def repetitions(car: FoldedCar, join: Join) -> int:
    """Return how often a join is made: once, or once for each wheel that has its piece."""
    wheels = {axle.wheel for axle in car.axles}
    return len({placed.body for placed in car.placed if placed.piece == join.piece_a and placed.body in wheels}) or 1


def operations_of_sheets(cut: CutCar) -> Operations:
    """Return the operations that take every piece out of its sheet, and the waste out of all openings."""
    openings = sum(piece.count * (len(piece.outline.interiors) + len(piece.circles)) for piece in cut.pieces)
    return Operations(piece=sum(piece.count for piece in cut.pieces), weed=openings)


def operations_of_splices(car: FoldedCar, cut: CutCar) -> Operations:
    """Return the operations that join the parts of pieces that were too large for a sheet.

    ``cut`` is ``car`` with these pieces split. Their parts are taped together at tabs, and the tabs must be folded first.
    """
    unsplit_numbers = {join.number for join in car.joins}
    new_joins = [join for join in cut.car.joins if join.number not in unsplit_numbers]

    def count_folds(pieces: Sequence[Piece]) -> int:
        """Return how many folds are made by hand in all copies of these pieces."""
        return sum(piece.count * len(_hand_folds(piece)) for piece in pieces)

    # A piece that was split at its folds may have fewer folds than before. This change counts as 0.
    extra_folds = max(0, count_folds(cut.car.pieces) - count_folds(car.pieces))
    taped_tabs = sum(repetitions(cut.car, join) for join in new_joins if join.kind in TAPED)
    return Operations(fold=extra_folds, tape=taped_tabs)


def operations_by_step(car: FoldedCar) -> list[tuple[AssemblyStep, Operations]]:
    """Return the steps of the assembly, each with its operations."""
    # How far each fold is closed before a step, by piece and crease.
    fold_fractions: dict[str, dict[str, float]] = {}
    result = []
    for step in assembly_steps(car):
        result.append((step, _operations_of_step(car, step, fold_fractions)))
        for name, creases in step.folds.items():
            fold_fractions.setdefault(name, {}).update(creases)
    return result


def _operations_of_step(
    car: FoldedCar, step: AssemblyStep, fractions_before: Mapping[str, Mapping[str, float]]
) -> Operations:
    """Return the operations of a step. ``fractions_before`` has how far each fold was closed before it."""
    mounts = {mount.name: mount for mount in car.mounts}
    parts = [mounts[added.name] for added in step.adds if added.kind == "mount"]
    screws = [mount for mount in parts if is_screw(car.parts, mount)]
    screws_with_nuts = {part.name for _, part in car.parts if isinstance(part, Screw) and part.nut_width_mm}
    # Wires count as plugs, not as parts.
    wires = [mount for mount in parts if mount.part == car.parts.wiring.name]
    # Only the LiPo is taped; pads are adhesive themselves.
    lipos = [mount for mount in parts if mount.part == car.parts.lipo.name]
    folded_pieces = [piece for piece in car.pieces if piece.name in step.folds]
    # How often joins of each kind are made. A join of a wheel is made once for each wheel.
    joins: Counter[str] = Counter()
    for join in car.joins:
        if join.number in step.joins:
            joins[join.kind] += repetitions(car, join)
    return Operations(
        fold=sum(piece.count * len(folds_of_step(step, fractions_before, piece)) for piece in folded_pieces),
        wind=sum(piece.count for piece in folded_pieces if is_wound(piece)),
        tape=sum(joins[kind] for kind in TAPED) + len(lipos),
        tongue=sum(joins[kind] for kind in PUSHED),
        turn=sum(repetitions(car, join) for join in disc_turns(car, step)),
        part=len(parts) - len(screws) - len(wires) + _untaped_units(car, step),
        screw=len(screws),
        nut=sum(mount.part in screws_with_nuts for mount in parts),
        plug=len(plugs_in(car, step)),
        joint=_joints_of(car, step),
    )


def _untaped_units(car: FoldedCar, step: AssemblyStep) -> int:
    """Return how many units a step puts in that are not taped, such as wheels.

    A cap with a switch is put in as a unit. Taping its tabs is its only operation, as for a cap without a switch.
    """
    taped_pieces: set[str] = set()
    for join in car.joins:
        if join.number in step.joins and join.kind == "tab":
            taped_pieces.update((join.piece_a, join.piece_b))
    return sum(added.kind == "unit" and added.name not in taped_pieces for added in step.adds)


def folds_of_step(step: AssemblyStep, fractions_before: Mapping[str, Mapping[str, float]], piece: Piece) -> list[Crease]:
    """Return the creases of one copy of ``piece`` that a step folds by hand.

    ``fractions_before`` has how far each fold was closed before the step, by piece and crease. A crease that the step
    sets to 0 is folded once and left open.
    """
    current, wanted = fractions_before.get(piece.name, {}), step.folds.get(piece.name, {})
    return [c for c in _hand_folds(piece) if c.name in wanted and wanted[c.name] != current.get(c.name)]


def plugs_in(car: FoldedCar, step: AssemblyStep) -> list[Wire]:
    """Return the wires that are plugged in during a step.

    Those between the boards are plugged in with the upper board, all others with the wiring. Wires that end at a
    switch are left out, because they are soldered (see ``soldered_in``).
    """
    added_parts = _added_parts(car, step)
    plugged = []
    for wire in car.wires:
        is_between_boards = wire.carries == "stack"
        plugged_with = car.parts.featherwing.name if is_between_boards else car.parts.wiring.name
        is_plug = wire.carries in PLUGGED and not wire.b.startswith(SERVO_SWITCH)
        if is_plug and plugged_with in added_parts:
            plugged.append(wire)
    return plugged


def soldered_in(car: FoldedCar, step: AssemblyStep) -> list[Wire]:
    """Return the wires that are soldered during a step: those of a switch or the button, in the step that adds it."""
    switches = tuple({SERVO_SWITCH, BOARD_SWITCH, BUTTON} & {added.name for added in step.adds})
    return [wire for wire in car.wires if wire.a.startswith(switches) or wire.b.startswith(switches)]


def _joints_of(car: FoldedCar, step: AssemblyStep) -> int:
    """Return how many joints are soldered in a step that puts a switch in.

    Each wire of the switch has one joint. In the step of the servos' switch, the leads of the battery are soldered, too:
    the positive lead has two joints at the fuse, and one to the wire of the switch. The negative lead has one joint if it
    is too short and must be lengthened.
    """
    wires = soldered_in(car, step)
    if not any(wire.a.startswith(SERVO_SWITCH) for wire in wires):
        return len(wires)
    negative_leads = [lead for lead in leads(car) if lead.kind == "solder" and lead.start.endswith("-")]
    is_lengthened = any(lead.missing_mm > 0 for lead in negative_leads)
    return len(wires) + JOINTS_OF_POSITIVE_LEAD + int(is_lengthened)


def _added_parts(car: FoldedCar, step: AssemblyStep) -> set[str]:
    parts = {mount.name: mount.part for mount in car.mounts}
    return {parts[add.name] for add in step.adds if add.kind == "mount"}


def is_wound(piece: Piece) -> bool:
    """Return whether the piece is a strip that is wound into a ring."""
    return any(crease.bend for crease in piece.creases)


def disc_turns(car: FoldedCar, step: AssemblyStep) -> list[Join]:
    """Return one join for each disc that is turned in a step.

    The hooks of a wheel's hub are put through the slots of a disc, and then the disc is turned, which locks all hooks
    at once. The discs are the pieces of a wheel without creases.
    """
    discs = {piece.name for piece in car.pieces if not piece.creases} & _on_wheels(car)
    joins: dict[str, Join] = {}
    for join in car.joins:
        if join.number in step.joins and join.kind == "lock" and join.piece_b in discs:
            joins.setdefault(join.piece_b, join)
    return list(joins.values())


def is_screw(parts: Catalogue, mount: Mount) -> bool:
    """Return whether the part is a screw, with or without a nut."""
    return mount.part in {part.name for _, part in parts if isinstance(part, Screw)}


def _hand_folds(piece: Piece) -> list[Crease]:
    return [c for c in piece.creases if c.angle_rad and not c.flexure and not c.bend]


def _on_wheels(car: FoldedCar) -> set[str]:
    """Return the names of the pieces that belong to wheels."""
    wheels = {axle.wheel for axle in car.axles}
    return {placed.piece for placed in car.placed if placed.body in wheels}


def minutes(value: float) -> str:
    """Format a duration in minutes."""
    return f"{value:.0f} min" if value >= 1 else "1 min"
