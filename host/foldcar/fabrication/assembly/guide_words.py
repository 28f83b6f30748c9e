"""The instructions of a step of the guide: what to fold, insert, screw (in the order of the proof), join and plug.

Input: an AssemblyStep and the AssemblyState before it. Output: lines of text. Numbers are those printed on the sheets.
"""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from foldcar.car.folded.model import Crease, FoldedCar, Join
from foldcar.car.leads import leads
from foldcar.car.parts.catalogue import Catalogue
from foldcar.car.proof.plan import SHUT
from foldcar.car.proof.step import AssemblyStep
from foldcar.fabrication.assembly.guide_state import AssemblyState
from foldcar.fabrication.assembly.insertion_words import insertion_lines, join_words, number_ranges
from foldcar.fabrication.assembly.operations import disc_turns, folds_of_step, is_wound
from foldcar.fabrication.assembly.plug_words import plug_lines
from foldcar.fabrication.assembly.switch_words import LinesAround, switch_lines
from foldcar.fabrication.assembly.wheel_words import is_rim_lock, tyre_lines, wheel_join_lines


def step_lines(step: AssemblyStep, state: AssemblyState) -> tuple[str, ...]:
    """Return the instructions of a step."""
    car = state.car
    around_bridge, around_switch = _bridge_lines(step), switch_lines(car, step)
    return (
        *_preparation(step, state),
        *around_bridge.before,
        *_fold_lines(step, state),
        *around_switch.before,
        *insertion_lines(step, state),
        *_join_lines(car, step),
        *around_switch.after,
        *plug_lines(car, step),
        *around_bridge.after,
        *_cautions(car, step, state),
    )


def _bridge_lines(step: AssemblyStep) -> LinesAround:
    """Return what is done before the bridge goes in, and what is done after; nothing for a step without the bridge."""
    if not any(added.kind == "unit" and added.name == "bridge" for added in step.adds):
        return LinesAround()
    before = (
        "Push a cable tie through the two slots of the left wall first. Its head is outside. Leave it open.",
        "Turn the bridge so that USB looks to the large hole of the left wall. When the bridge is in, look through the "
        "hole: you see the socket.",
        "Stick tape under both feet. Leave its liner on, and let the liner's end stick out.",
    )
    after = (
        "Press both feet onto the floor: push the blunt end of a pencil under the boards, beside the cell and never onto "
        "it, from the side of the bridge without a tongue.",
    )
    return LinesAround(before, after)


def _fold_lines(step: AssemblyStep, state: AssemblyState) -> Iterator[str]:
    """Yield the instructions for folding: which pieces, how many folds, and in which direction.

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
        # Some folds are only folded once and then opened again.
        closed = [crease for crease in creases if fractions[crease.name]]
        reopened = [crease.name for crease in creases if crease not in closed]
        text = _fold_counts(closed)
        if state.fold_fractions.get(name):
            # The piece has folds already, so those of this step are named.
            text += f" ({join_words([crease.name for crease in closed])})"
        if reopened:
            text += f"; fold {join_words(reopened)} too, and open them again"
        labels_by_text.setdefault(text, []).append(f"the {piece.label}")
    for text, piece_labels in labels_by_text.items():
        each = ", each" if len(piece_labels) > 1 else ""
        yield f"Fold {join_words(piece_labels)}: {text}{each}."


def _fold_counts(creases: Sequence[Crease]) -> str:
    """Return how many folds of which kind and angle these are, such as "4 valley folds of 90°"."""
    counts: Counter[tuple[str, int]] = Counter()
    for crease in creases:
        angle_deg = math.degrees(crease.angle_rad)
        kind = "valley" if angle_deg > 0 else "mountain"
        counts[kind, round(abs(angle_deg))] += 1
    texts = []
    for (kind, degrees), number in counts.items():
        plural = "s" if number > 1 else ""
        texts.append(f"{number} {kind} fold{plural} of {degrees}°")
    return join_words(texts)


class JoinInstruction(NamedTuple):
    """The instruction for joins of these kinds; the numbers of the joins follow it."""

    kinds: tuple[str, ...]
    text: str


JOIN_INSTRUCTIONS = (
    JoinInstruction(("tab", "lap"), "Tape the tabs to the inside of the panel with the same number, its printed side"),
    JoinInstruction(("tab_slot",), "Push the tongues through the slots with the same number"),
    JoinInstruction(("lock",), "Hold the levers outwards, press the lid down, let go: the tongues go into their slots"),
    JoinInstruction(("tuck",), "The lid lies on the flanges of the caps, its flap inside the right wall, without tape"),
)


def _join_lines(car: FoldedCar, step: AssemblyStep) -> Iterator[str]:
    """Yield the instructions for the joins of a step: what is taped, and which tongues go through which slots.

    A *laminate* is a layer of film that is taped onto another piece. Joins of wheels have lines of their own.
    """
    joins = [join for join in car.joins if join.number in step.joins]
    wheel_joins = {join.number for join in joins if join.kind == "rim" or is_rim_lock(car, join)}
    wheel_joins |= {join.number for join in disc_turns(car, step)}
    has_layers = any(join.kind == "laminate" for join in joins)
    yield from _layer_lines(car, joins)
    yield from wheel_join_lines(car, step)
    for instruction in JOIN_INSTRUCTIONS:
        if has_layers and instruction.kinds == ("tab_slot",):
            # The lines of the layers say how the tongues go in.
            continue
        numbers = {join.number for join in joins if join.kind in instruction.kinds} - wheel_joins
        if numbers:
            yield f"{instruction.text}: join {number_ranges(numbers)}."


def _layer_lines(car: FoldedCar, joins: Sequence[Join]) -> Iterator[str]:
    """Yield the instructions for the layers that are taped onto other pieces in a step, if there are any.

    ``joins`` are those of the step. A taped layer sticks at once and cannot be moved any more. So if the step has
    tongues, they go through their slots first, while the liners are still on the tape.
    """
    layers = {join.number: join for join in joins if join.kind == "laminate"}
    tongues = {join.number for join in joins if join.kind == "tab_slot"}
    labels = {piece.name: piece.label for piece in car.pieces}
    faces_with_holes = {face.name for piece in car.pieces for face in piece.faces if face.holes}
    if tongues and layers:
        yield f"Push the tongues through the slots with the same number: join {number_ranges(tongues)}."
    for number, join in sorted(layers.items()):
        aligned_by_holes = join.a.face in faces_with_holes
        where = "on, holes on each other" if aligned_by_holes else "where it lies on what has the same number"
        if tongues:
            yield f"Pull the liners off. The {labels[join.piece_a]} sticks to what has the same number: join {number}."
        else:
            yield f"Tape the {labels[join.piece_a]} {where}: join {number}."


def _shaft_lines(state: AssemblyState) -> Iterator[str]:
    """Yield a line that says which servos have their shaft towards the front of the car, and one for the rear.

    The shaft is near one end of a servo, so a servo can be put in the wrong way round.
    """
    servos_by_end: dict[str, list[str]] = {}
    for axle in state.car.axles:
        if not axle.driven:
            continue
        middle_of_servo_mm = state.mounts[axle.servo].pose[0][3]
        end = "front" if axle.center_mm[0] > middle_of_servo_mm else "rear"
        servos_by_end.setdefault(end, []).append(axle.servo)
    for end, servos in servos_by_end.items():
        yield f"Turn each servo so that its shaft is towards the {end} of the car: {join_words(servos)}."


def _away_from_boards(state: AssemblyState) -> str:
    """Return to which end of the car the LiPo lies beside the boards."""
    parts = state.car.parts
    x_of = {mount.part: mount.pose[0][3] for mount in state.mounts.values()}
    return "towards the front" if x_of[parts.lipo.name] > x_of[parts.feather.name] else "towards the rear"


def _preparation(step: AssemblyStep, state: AssemblyState) -> Iterator[str]:
    """Yield instructions for preparing the parts that a step adds, before they are put in.

    ``state`` is the state of the car before the step.
    """
    # The names of the bought parts among them.
    added_parts = {state.mounts[added.name].part for added in step.adds if added.kind == "mount"}
    if state.car.parts.servo.name in added_parts:
        axles = sorted((axle for axle in state.car.axles if axle.driven), key=lambda axle: axle.channel)
        marks = "; ".join(f"{axle.servo} {axle.channel}" for axle in axles)
        yield f"Mark the servos' leads first, near the plug: {marks}."
        yield (
            "Push a servo's lead through its opening, then the servo. Leave the potentiometers of the servos alone: "
            "their neutrals are measured when the car is complete."
        )
        yield from _shaft_lines(state)
    if state.car.parts.horn_screw.name in added_parts:
        yield "Use those holes of the horn that lie in the slots. Widen a hole that is too small to 1.5 mm."
        yield (
            "Tighten a wheel's screws only when the centre screw's head is in the middle of the disc's hole: then the "
            "wheel runs true."
        )
    if state.car.parts.tyre.name in added_parts:
        yield from tyre_lines(state.car, step.unit)
    if state.car.parts.lipo.name in added_parts:
        yield f"Stick a strip of double-sided tape under the {state.car.parts.lipo.name}."
    if state.car.parts.board_pad.name in added_parts:
        yield f"Lay two layers of foam tape on each other: they are the {state.car.parts.board_pad.name}."
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
            yield f"Cut the {part.name} to {join_words(lengths)} mm first, and take the burr off its ends."


def _cautions(car: FoldedCar, step: AssemblyStep, state: AssemblyState) -> Iterator[str]:
    """Yield what a person must know about the parts of a step: which way round they go, how they hold, what to check."""
    parts = {state.mounts[added.name].part for added in step.adds if added.kind == "mount"}
    # The side on which the leads, the wires of a battery, come out of it. A lead starts at "BATTERY +", for example.
    sides = {lead.start.removesuffix(" +"): lead.leaves for lead in leads(car)}
    if car.parts.lipo.name in parts:
        side = sides[car.parts.lipo.name]
        yield f"It lies in its outline on the film, its lead on the {side}."
        yield (
            f"Bend the lead along the cell's end {_away_from_boards(state)}: a foot of the bridge comes down beside the "
            "cell."
        )
    if car.parts.battery.name in parts:
        side = sides[car.parts.battery.name]
        if car.parts.battery_place == "roof":
            yield (
                "Press it onto the hook-and-loop tape, on the outside of the lid, between the small holes at its "
                f"corners. Its leads are on the {side}. Push both leads through the lid's round hole, "
                f"{car.parts.assembly.lead_hole_mm.value:g} mm wide, before anything is soldered to them."
            )
        else:
            yield (
                f"Press the {car.parts.battery.name} onto the hook-and-loop tape in its outline, its leads on the "
                f"{side}. You can take it out to change its cells."
            )
    if car.parts.pad.name in parts and car.parts.battery_place == "roof":
        yield "Stick it to the outside of the lid, the side without print, between the small holes at its corners."
    if car.parts.board_pad.name in parts:
        yield f"The {car.parts.board_pad.name} sticks to film and board, where the radio module covers the board's holes."
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
    # A unit is assembled outside the car and then added as a whole, such as a wheel.
    wheels = {axle.wheel for axle in car.axles}
    if any(added.kind == "unit" and added.body in wheels for added in step.adds):
        yield "Turn every wheel by hand: it touches neither the wall nor its neighbour."
