"""The instructions of a step of the guide: what to fold, insert, screw (in the order of the proof), join and plug.

Input: an AssemblyStep and the AssemblyState before it. Output: lines of text. Numbers are those printed on the sheets.
"""

import itertools
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from foldcar.car.components.hooked_strip import WheelSize, turn_rad
from foldcar.car.components.mounts import BOARD_SWITCH, SERVO_SWITCH
from foldcar.car.folded.model import FoldedCar, Join
from foldcar.car.leads import leads
from foldcar.car.parts.catalogue import Catalogue
from foldcar.car.proof.plan import SHUT
from foldcar.car.proof.step import AddedPart, AssemblyStep, Vector
from foldcar.fabrication.assembly.guide_state import AssemblyState
from foldcar.fabrication.assembly.operations import disc_turns, folds_of_step, is_screw, is_wound, plugs_in
from foldcar.fabrication.assembly.parts_list import tyre_cut
from foldcar.fabrication.assembly.switch_words import switch_lines

DRIVER = "PH0 screwdriver"
# A part is on the left or right of the car if its distance from the middle plane is larger.
MIDDLE_MM = 10.0
# The number of a beam is left out: a screw passes through its own beam.
NUMBER = re.compile(r" \d+$")
SIDES = (("the front", "the rear"), ("the left", "the right"), ("above", "below"))


def step_lines(step: AssemblyStep, state: AssemblyState) -> tuple[str, ...]:
    """Return the instructions of a step."""
    car = state.car
    return (
        *_preparation(step, state),
        *_fold_lines(step, state),
        *_insertion_lines(step, state),
        *_join_lines(car, step),
        *switch_lines(car, step),
        *_plug_lines(car, step),
        *_cautions(car, step, state),
    )


def _fold_lines(step: AssemblyStep, state: AssemblyState) -> Iterator[str]:
    """Yield the instructions for folding: which pieces, how many folds, in which direction.

    Pieces with the same folds share one line.
    """
    wound_pieces = [state.pieces[name] for name in step.folds if is_wound(state.pieces[name])]
    if wound_pieces:
        labels = join_words([f"the {piece.label}" for piece in wound_pieces])
        yield f"Curl {labels} evenly, without a crease, printed side inside."
    labels_by_text: dict[str, list[str]] = {}
    for name, fractions in step.folds.items():
        piece = state.pieces[name]
        creases = folds_of_step(step, state.fold_fractions, piece)
        if not creases:
            continue
        closed = [crease for crease in creases if fractions[crease.name]]
        angles_deg = [math.degrees(crease.angle_rad) for crease in closed]
        kinds = Counter(("valley" if angle > 0 else "mountain", round(abs(angle))) for angle in angles_deg)
        counts = [f"{n} {kind} fold{'s' if n > 1 else ''} of {degrees}°" for (kind, degrees), n in kinds.items()]
        # A piece that has folds already: name those of this step.
        names = f" ({join_words([crease.name for crease in closed])})" if state.fold_fractions.get(name) else ""
        reopened = [crease.name for crease in creases if crease not in closed]
        reopen = f"; fold {join_words(reopened)} too, and open them again" if reopened else ""
        labels_by_text.setdefault(f"{join_words(counts)}{names}{reopen}", []).append(f"the {piece.label}")
    for text, piece_labels in labels_by_text.items():
        yield f"Fold {join_words(piece_labels)}: {text}{', each' if len(piece_labels) > 1 else ''}."


def _insertion_lines(step: AssemblyStep, state: AssemblyState) -> list[str]:
    """Return the instructions for inserting the step's parts, in their order; repetitions are counted, not written.

    In a step that builds a unit for several bodies, the first body stands for all. Wires have lines of their own.
    """
    of_first_body = [added for added in step.adds if not step.unit or added.body == step.adds[0].body]
    wires = {mount.name for mount in state.car.mounts if mount.part == state.car.parts.wiring.name}
    parts = [added for added in of_first_body if added.name not in wires]
    instructions = [f"{_part_label(part, state)}: {_insertion(part, state, bool(step.unit))}" for part in parts]
    counted = [(text, len(list(group))) for text, group in itertools.groupby(instructions)]
    texts = [f"{count} × {text}" if count > 1 else text for text, count in counted]
    # The length of the shortest sequence of instructions that, repeated, gives all of them.
    period = next((p for p in range(1, len(texts) + 1) if texts == texts[:p] * (len(texts) // p)), 1)
    if 1 < period < len(texts):
        return [f"{len(texts) // period} times: {'; then '.join(texts[:period])}."]
    return [f"{text[0].upper()}{text[1:]}." for text in texts]


def _part_label(added: AddedPart, state: AssemblyState) -> str:
    """Return the name of an added unit, piece or bought part as the guide prints it."""
    if added.kind == "unit":
        return added.name
    if added.kind == "piece":
        return state.pieces[added.name].label
    return state.mounts[added.name].part


def _insertion(added: AddedPart, state: AssemblyState, in_unit: bool) -> str:
    """Return how a part goes in: the sides it comes from, or how it is wound, stretched or laid.

    ``in_unit``: it goes into a unit that is assembled apart from the car, such as a wheel.
    """
    if added.kind == "mount" and is_screw(state.car.parts, state.mounts[added.name]):
        return _screw_insertion(added, state, in_unit)
    if added.way_mm:
        return _directions(added, added.way_mm, state, in_unit)
    if added.kind == "piece" and is_wound(state.pieces[added.name]):
        return "wind it around the discs"
    if added.kind == "mount" and added.body in {axle.wheel for axle in state.car.axles}:
        return "stretch it over the rim"
    return "lay it down"


def _screw_insertion(screw: AddedPart, state: AssemblyState, in_unit: bool) -> str:
    """Return from which side a screw comes, what it passes, and its tool; then its nut, or else the part that holds it.

    ``in_unit``: the screw goes into a unit that is assembled apart from the car, such as a wheel.
    """
    labels = {("mount", name): mount.part for name, mount in state.mounts.items()}
    labels |= {("piece", name): NUMBER.sub("", piece.label) for name, piece in state.pieces.items()}
    passed = [labels[kind, name] for kind, name, _ in screw.passes]
    into = nut = ""
    if screw.nut_mm:
        nut = f", its nut {_directions(screw, screw.nut_mm[-1:], state, in_unit)}, held with pliers"
    elif passed:
        *passed, last = passed
        into = f" into the {last}"
    through = f" through {join_words([f'the {name}' for name in passed])}" if passed else ""
    return f"{_directions(screw, screw.way_mm, state, in_unit)}{through}{into}, with the {DRIVER}{nut}"


def _directions(added: AddedPart, moves: Sequence[Vector], state: AssemblyState, in_unit: bool) -> str:
    """Return from which sides a part comes along its moves (3,), as in ``from above, then from the left``.

    Along y the sides are those of the wheel if it goes into a unit (``in_unit``), else of the car.
    """
    # y of the part's wheel, or of the mount: a part that moves towards y = 0 comes from outside.
    axle = next((axle for axle in state.car.axles if axle.wheel == added.body), None)
    mount_y_mm = state.mounts[added.name].pose[1][3] if added.kind == "mount" else 0.0
    y_mm = axle.center_mm[1] if axle else mount_y_mm
    sides = []
    for move in moves:
        axis = int(np.argmax(np.abs(move)))
        comes_from_outside = move[1] * y_mm < 0
        if axis != 1 or abs(y_mm) < MIDDLE_MM:
            sides.append(SIDES[axis][0 if move[axis] < 0 else 1])
        elif in_unit:
            sides.append("its outer side" if comes_from_outside else "its inner side")
        else:
            sides.append("outside" if comes_from_outside else "inside")
    return "from " + ", then from ".join(dict.fromkeys(sides))


def _join_lines(car: FoldedCar, step: AssemblyStep) -> Iterator[str]:
    """Yield the instructions for the step's joins: tape, slots, locks."""
    joins = [join for join in car.joins if join.number in step.joins]
    laminates = {join.number: join for join in joins if join.kind == "laminate"}
    labels = {piece.name: piece.label for piece in car.pieces}
    faces_with_holes = {face.name for piece in car.pieces for face in piece.faces if face.holes}
    tongues = {join.number for join in joins if join.kind == "tab_slot"}
    if tongues and laminates:
        # What is taped sticks at once: its tongue goes in first.
        yield (
            "Tape goes under the feet first, the end of its liner sticking out. Push the tongues through the slots with "
            f"the same number: join {number_ranges(tongues)}."
        )
    for number, join in sorted(laminates.items()):
        aligned_by_holes = join.a.face in faces_with_holes
        where = "on, holes on each other" if aligned_by_holes else "where it lies on what has the same number"
        pull = "Pull the liners off. " if tongues else ""
        yield f"{pull}Tape the {labels[join.piece_a]} {where}: join {number}."
    yield from _wheel_join_lines(car, step)
    wheel_joins = {join.number for join in joins if join.kind == "rim" or _is_rim_lock(car, join)}
    wheel_joins |= {join.number for join in disc_turns(car, step)}
    for kinds, text in (
        (("tab", "lap"), "Tape the tabs to the inside of the panel with the same number: join {}."),
        (("tab_slot",), "Push the tongues through the slots with the same number: join {}."),
        (("lock",), "Hold the levers outwards, press the lid down, let go: the tongues go into their slots: join {}."),
        (("tuck",), "The lid lies on the flanges of the caps, its flap inside the right wall, without tape: join {}."),
    ):
        numbers = {join.number for join in joins if join.kind in kinds} - wheel_joins
        numbers -= tongues if laminates else set()
        if numbers:
            yield text.format(number_ranges(numbers))


def _is_rim_lock(car: FoldedCar, join: Join) -> bool:
    """Whether a join is a lock of a wound strip."""
    return join.kind == "lock" and is_wound(next(piece for piece in car.pieces if piece.name == join.piece_a))


def _wheel_join_lines(car: FoldedCar, step: AssemblyStep) -> Iterator[str]:
    """Yield the instructions for a wheel's joins: the hub's hooks, the rim's hooks and the rim's tongues."""
    joins = [join for join in car.joins if join.number in step.joins]
    labels = {piece.name: piece.label for piece in car.pieces}
    axle_of_piece = {placed.piece: axle for axle in car.axles for placed in car.placed if placed.body == axle.wheel}
    for join in disc_turns(car, step):
        axle = axle_of_piece[join.piece_b]
        angle_deg = math.degrees(turn_rad(WheelSize(axle.radius_mm, axle.tyre_width_mm, car.parts)))
        yield (
            f"Drop the hub's hooks into the slots of the {labels[join.piece_b]}, and turn the disc against the hub "
            f"until they hold: clockwise, as seen from its unprinted side, by about {angle_deg:.0f}°: join {join.number}."
        )
        yield "Of its positions take that in which, when it holds, the notches of both discs are in line."
    hooks = {join.number for join in joins if join.kind == "rim"}
    if hooks:
        yield (
            f"Drop the strip's hooks from outside into the notches of both discs: join {number_ranges(hooks)}. The "
            "notches of a disc are alike: begin at any of them, whatever its number."
        )
    tongues = {join.number for join in joins if _is_rim_lock(car, join)}
    if tongues:
        yield (
            "Put each tongue's head from outside through the wide part of its slot and pull it into the narrow part; the "
            f"last one goes in before the hooks beside it drop into their notches: join {number_ranges(tongues)}."
        )


def _plug_lines(car: FoldedCar, step: AssemblyStep) -> Iterator[str]:
    """Yield the instructions for the step's plugs and wires; extension cables of servos come first."""
    wires = plugs_in(car, step)
    part_of_mount = {mount.name: mount.part for mount in car.mounts}
    signals = [wire for wire in wires if wire.carries == "signal"]
    servos_by_extension: dict[str, list[str]] = {}
    for wire in (wire for wire in signals if wire.a in part_of_mount):
        servos_by_extension.setdefault(part_of_mount[wire.a], []).append(f"the {wire.b}")
    for extension, servos in servos_by_extension.items():
        each_text = ", each" if len(servos) > 1 else ""
        yield f"Plug {join_words(servos)} into a {extension}{each_text}; tape the joints to the floor."
    if signals:
        servo_count = sum(axle.driven for axle in car.axles)
        yield (
            f"Plug {servo_count} servos into the outputs that their leads are marked with; the brown lead is ground, at "
            "the pin beside which GND is printed."
        )
        if car.hinges:
            yield "Lead cables between segments through the openings of the caps, with a loop at each hinge."
    if any(wire.a == car.parts.lipo.name for wire in wires):
        yield (
            f"Before you plug the {car.parts.lipo.name} in: turn the {BOARD_SWITCH} off, and compare the lead's red wire "
            "with the + on the board. The plugs of some sellers are crossed: never plug such a one in."
        )
    for wire in wires:
        if wire.carries != "signal":
            start = "The servo switch's free wire" if wire.a.startswith(SERVO_SWITCH) else wire.a
            yield f"{start[0].upper()}{start[1:]} to {wire.b}: {wire.note}."
    if any(wire.b.startswith(f"{car.parts.featherwing.name} terminal") for wire in wires):
        yield (
            "+ and - are printed beside the terminal block. Bare 5 mm of each wire, tighten the screw, and tug at the "
            "wire."
        )


def _shaft_lines(state: AssemblyState) -> Iterator[str]:
    """Yield to which end of the car the servos' shafts, each at one end of its servo, lie, and how their leads go."""
    ends: dict[str, list[str]] = {}
    for axle in (axle for axle in state.car.axles if axle.driven):
        towards = "front" if axle.center_mm[0] > state.mounts[axle.servo].pose[0][3] else "rear"
        ends.setdefault(towards, []).append(axle.servo)
    for towards, servos in ends.items():
        yield f"With the shaft towards the {towards} of the car: {join_words(servos)}."


def _away_from_boards(state: AssemblyState) -> str:
    """Return to which end of the car the LiPo lies beside the boards."""
    parts = state.car.parts
    x_of = {mount.part: mount.pose[0][3] for mount in state.mounts.values()}
    return "towards the front" if x_of[parts.lipo.name] > x_of[parts.feather.name] else "towards the rear"


def _preparation(step: AssemblyStep, state: AssemblyState) -> Iterator[str]:
    """Yield what is done to parts before they go in."""
    added_parts = {state.mounts[added.name].part for added in step.adds if added.kind == "mount"}
    if state.car.parts.servo.name in added_parts:
        axles = sorted((axle for axle in state.car.axles if axle.driven), key=lambda axle: axle.channel)
        marks = "; ".join(f"{axle.servo} {axle.channel}" for axle in axles)
        yield (
            f"Before: mark the leads: {marks}. Leave the servos' potentiometers alone: their neutrals are measured when "
            "the car is complete. Push a servo's lead through its opening first."
        )
    if any(added.kind == "unit" and added.name == "bridge" for added in step.adds):
        yield "Before: push a cable tie through the two slots of the left wall, its head outside, and leave it open."
        yield "USB goes to the large hole of the left wall: look through it, and see the socket when the bridge is in."
    if step.title == SHUT and state.car.parts.battery_place == "floor":
        yield insert_cells_line(state.car.parts)
    yield from _cut_lengths(state.car, step, state)


def insert_cells_line(parts: Catalogue) -> str:
    """Return the instruction to put cells into the holder, with their kind."""
    return (
        "Measure with a multimeter that + and - of the terminal block are not connected. Turn both switches off, and put "
        f"four charged cells of one kind into the holder: {parts.cells.cell}."
    )


def _cut_lengths(car: FoldedCar, step: AssemblyStep, state: AssemblyState) -> Iterator[str]:
    """Yield the lengths to which rods and tubes are cut."""
    mounts = [state.mounts[added.name] for added in step.adds if added.kind == "mount"]
    for part in (car.parts.axle_rod, car.parts.axle_tube):
        lengths = sorted({f"{mount.size_mm[2]:.1f}" for mount in mounts if mount.part == part.name}, key=float)
        if lengths:
            yield f"Before: cut the {part.name} to {join_words(lengths)} mm, and take the burr off its ends."


def _cautions(car: FoldedCar, step: AssemblyStep, state: AssemblyState) -> Iterator[str]:
    """Yield notes on parts: orientation, fixing, checks."""
    parts = {state.mounts[added.name].part for added in step.adds if added.kind == "mount"}
    if car.parts.servo.name in parts:
        yield from _shaft_lines(state)
    if car.parts.tyre.name in parts:
        tyre = car.parts.tyre
        yield f"{tyre.note[0].upper()}{tyre.note[1:]}: {tyre_cut(car, step.unit)}."
    sides = {lead.start.removesuffix(" +"): lead.leaves for lead in leads(car)}
    if car.parts.lipo.name in parts:
        side = sides[car.parts.lipo.name]
        yield f"It lies in its outline on the film, its lead on the {side}, held by a strip of double-sided tape."
        yield (
            f"Bend the lead along the cell's end {_away_from_boards(state)}: a foot of the bridge comes down beside the "
            "cell."
        )
    if car.parts.battery.name in parts:
        side = sides[car.parts.battery.name]
        if car.parts.battery_place == "roof":
            yield (
                "It stands outside, on the side without print, on the hook-and-loop tape, between the small holes at its "
                f"corners; its leads are on the {side}. Push both leads through the lid's round hole, "
                f"{car.parts.assembly.lead_hole_mm.value:g} mm wide, before anything is soldered to them."
            )
        else:
            yield f"It stands on hook-and-loop tape in its outline, its leads on the {side}; it comes out for its cells."
    if car.parts.pad.name in parts and car.parts.battery_place == "roof":
        yield "It sticks to the outside of the lid, the side without print, between the small holes at its corners."
    if any(added.kind == "unit" and added.name == "bridge" for added in step.adds):
        yield (
            "Press both feet onto the floor: push the blunt end of a pencil under the boards, beside the cell and never "
            "onto it, from the side of the bridge without a tongue."
        )
    if car.parts.board_pad.name in parts:
        yield "The pad, foam tape in two layers, sticks to film and board where the module covers the board's holes."
    if car.parts.horn_screw.name in parts:
        yield "They go into the horn's holes that lie in the slots; widen a hole that is too small to 1.5 mm."
        yield "Tighten them with the centre screw's head in the middle of the disc's hole: then the wheel runs true."
    hinge_strips = {piece.name for piece in car.pieces if any(crease.flexure for crease in piece.creases)}
    if hinge_strips & {added.name for added in step.adds}:
        limits_deg = [(-math.degrees(hinge.min_rad), math.degrees(hinge.max_rad)) for hinge in car.hinges]
        texts = [f"from {down:.0f}° nose down to {up:.0f}° nose up" for down, up in limits_deg]
        all_equal = len(set(texts)) == 1
        ranges = texts[0] if all_equal else join_words([f"{text} at hinge {n}" for n, text in enumerate(texts, 1)])
        yield "The floors' ends lie along the orange marks of a hinge's strip, its sides flush with the walls."
        yield (
            f"A hinge's strip stays uncreased between the segments, which then pitch freely {ranges} against each other."
        )
    if any(added.kind == "unit" and added.body in {axle.wheel for axle in car.axles} for added in step.adds):
        yield "Turn every wheel by hand: it touches neither the wall nor its neighbour."


def number_ranges(joins: Iterable[int]) -> str:
    """Format numbers with ranges shortened: ``2 to 5, 11``."""
    runs: list[list[int]] = []
    for number in sorted(joins):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs)


def join_words(names: Sequence[str]) -> str:
    """Join names to a list in words: ``a, b and c``."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
