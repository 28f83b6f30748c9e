"""The instructions of a step of the guide: what to fold, insert, screw (in the order of the proof), join and plug.

Input: an AssemblyStep and the State before it. Output: lines of text. Numbers are those printed on the sheets.
"""

import itertools
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from foldcar.car.components.hooked_strip import WheelSize, turn_rad
from foldcar.car.folded.model import FoldedCar, Join, Mount
from foldcar.car.leads import leads
from foldcar.car.parts.catalogue import Catalogue
from foldcar.car.proof.plan import SHUT
from foldcar.car.proof.step import Added, AssemblyStep, Vector
from foldcar.fabrication.assembly.guide_state import State
from foldcar.fabrication.assembly.operations import closing, disc_turns, is_screw, is_wound, plugs_in, soldered_in
from foldcar.fabrication.assembly.parts_list import tyre_cut
from foldcar.fabrication.assembly.wiring import lead_remedy

DRIVER = "PH0 screwdriver"
# Parts farther from the car's middle than this are on its left or right.
BESIDE_MM = 10.0
# The number of a beam is left out: a screw passes through its own beam.
NUMBER = re.compile(r" \d+$")
SIDES = (("the front", "the rear"), ("the left", "the right"), ("above", "below"))


def step_lines(step: AssemblyStep, before: State) -> tuple[str, ...]:
    """Return the instructions of a step."""
    car = before.car
    return (
        *_preparation(step, before),
        *_folds(step, before),
        *_put_in(step, before),
        *_joins(car, step),
        *_solder(car, step),
        *_plugs(car, step),
        *_cautions(car, step, before),
    )


def _folds(step: AssemblyStep, before: State) -> Iterator[str]:
    """Yield the sentences of a step on folding: which pieces, how many folds, in which direction."""
    wound = [before.pieces[name] for name in step.folds if is_wound(before.pieces[name])]
    if wound:
        labels = join_words([f"the {piece.label}" for piece in wound])
        yield f"Curl {labels} evenly, without a crease, printed side inside."
    pieces_by_text: dict[str, list[str]] = {}
    for name, creases in step.folds.items():
        piece = before.pieces[name]
        made = closing(step, before.closed, piece)
        shut = [crease for crease in made if creases[crease.name]]
        angles = [math.degrees(crease.angle_rad) for crease in shut]
        kinds = Counter(("valley" if angle > 0 else "mountain", round(abs(angle))) for angle in angles)
        texts = [f"{n} {kind} fold{'s' if n > 1 else ''} of {degrees}°" for (kind, degrees), n in kinds.items()]
        opened = [crease.name for crease in made if crease not in shut]
        left = f"; fold {join_words(opened)} too, and open them again" if opened else ""
        named = f" ({join_words([crease.name for crease in shut])})" if before.closed.get(name) else ""
        if made:
            pieces_by_text.setdefault(f"{join_words(texts)}{named}{left}", []).append(f"the {piece.label}")
    for text, pieces in pieces_by_text.items():
        yield f"Fold {join_words(pieces)}: {text}{', each' if len(pieces) > 1 else ''}."


def _put_in(step: AssemblyStep, before: State) -> list[str]:
    """Return the instructions for the parts that go in, in the order of the step.

    The first wheel stands for all; loose wires have lines of their own. Repeated instructions are written once.
    """
    shown = [a for a in step.adds if not step.unit or a.body == step.adds[0].body]
    wires = {mount.name for mount in before.car.mounts if mount.part == before.car.parts.wiring.name}
    placed = [added for added in shown if added.name not in wires]
    instructions = [f"{_label(added, before)}: {_origin(added, before, bool(step.unit))}" for added in placed]
    counted = [(text, len(list(group))) for text, group in itertools.groupby(instructions)]
    texts = [f"{count} × {text}" if count > 1 else text for text, count in counted]
    period = next((p for p in range(1, len(texts) + 1) if texts == texts[:p] * (len(texts) // p)), 1)
    if 1 < period < len(texts):
        return [f"{len(texts) // period} times: {'; then '.join(texts[:period])}."]
    return [f"{text[0].upper()}{text[1:]}." for text in texts]


def _label(added: Added, before: State) -> str:
    if added.kind == "unit":
        return added.name
    if added.kind == "piece":
        return before.pieces[added.name].label
    return before.mounts[added.name].part


def _origin(added: Added, before: State, is_apart: bool) -> str:
    """Return where a part comes from, move by move; for a screw also what it passes, its tool and its nut."""
    car = before.car
    if added.kind == "mount" and is_screw(car.parts, before.mounts[added.name]):
        labels = {("mount", name): mount.part for name, mount in before.mounts.items()}
        labels |= {("piece", name): NUMBER.sub("", piece.label) for name, piece in before.pieces.items()}
        passed = [labels[kind, name] for kind, name, _ in added.passes]
        into = ""
        if not added.nut_mm and passed:
            *passed, last = passed
            into = f" into the {last}"
        through = f" through {join_words([f'the {name}' for name in passed])}" if passed else ""
        nut = ""
        if added.nut_mm:
            nut = f", its nut {_directions(added, added.nut_mm[-1:], before, is_apart)}, held with pliers"
        return f"{_directions(added, added.way_mm, before, is_apart)}{through}{into}, with the {DRIVER}{nut}"
    if added.way_mm:
        return _directions(added, added.way_mm, before, is_apart)
    if added.kind == "piece" and is_wound(before.pieces[added.name]):
        return "wind it around the discs"
    if added.kind == "mount" and added.body in {axle.wheel for axle in car.axles}:
        return "stretch it over the rim"
    return "lay it down"


def _directions(added: Added, moves: Sequence[Vector], before: State, is_apart: bool) -> str:
    """Return from which sides a part moves in: a wheel's sides if ``is_apart``, else the outside or inside of the car."""
    axle = next((axle for axle in before.car.axles if axle.wheel == added.body), None)
    place = before.mounts[added.name].pose[1][3] if added.kind == "mount" else 0.0
    y = axle.center_mm[1] if axle else place
    places = []
    for move in moves:
        axis = int(np.argmax(np.abs(move)))
        if axis != 1 or abs(y) < BESIDE_MM:
            places.append(SIDES[axis][0 if move[axis] < 0 else 1])
        elif is_apart:
            places.append("its outer side" if move[1] * y < 0 else "its inner side")
        else:
            places.append("outside" if move[1] * y < 0 else "inside")
    return "from " + ", then from ".join(dict.fromkeys(places))


def _joins(car: FoldedCar, step: AssemblyStep) -> Iterator[str]:
    """Yield the sentences of a step on joins: tape, slots, locks."""
    joins = [join for join in car.joins if join.number in step.joins]
    layers = {join.number: join for join in joins if join.kind == "laminate"}
    labels = {piece.name: piece.label for piece in car.pieces}
    drilled = {face.name for piece in car.pieces for face in piece.faces if face.holes}
    for number, join in sorted(layers.items()):
        holes, name = join.a.face in drilled, join.piece_a
        how = "on, holes on each other" if holes else "where it lies on what has the same number"
        yield f"Tape the {labels[name]} {how}: join {number}."
    yield from _wheel_joins(car, step)
    own = {join.number for join in joins if join.kind == "rim" or _is_of_rim(car, join)}
    own |= {join.number for join in disc_turns(car, step)}
    for kinds, text in (
        (("tab", "lap"), "Tape the tabs to the inside of the panel with the same number: join {}."),
        (("tab_slot",), "Push the tongues through the slots with the same number: join {}."),
        (("lock",), "Hold the levers outwards, press the lid down, let go: the tongues go into their slots: join {}."),
        (("tuck",), "Lay the edges inside the walls, without tape: join {}."),
    ):
        joined = {join.number for join in joins if join.kind in kinds} - own
        if joined:
            yield text.format(number_ranges(joined))


def _is_of_rim(car: FoldedCar, join: Join) -> bool:
    """Whether a join is a lock of a wound strip."""
    return join.kind == "lock" and is_wound(next(piece for piece in car.pieces if piece.name == join.piece_a))


def _wheel_joins(car: FoldedCar, step: AssemblyStep) -> Iterator[str]:
    """Yield how the hub's hooks, the rim's hooks and its tongues are joined."""
    joins = [join for join in car.joins if join.number in step.joins]
    labels = {piece.name: piece.label for piece in car.pieces}
    units = {placed.piece: axle for axle in car.axles for placed in car.placed if placed.body == axle.wheel}
    for join in disc_turns(car, step):
        axle = units[join.piece_b]
        angle = math.degrees(turn_rad(WheelSize(axle.radius_mm, axle.tyre_width_mm, car.parts)))
        yield (
            f"Drop the hub's hooks into the slots of the {labels[join.piece_b]}, and turn the disc against the hub "
            f"until they hold: clockwise, as seen from its unprinted side, by about {angle:.0f}°: join {join.number}."
        )
    rims = {join.number for join in joins if join.kind == "rim"}
    if rims:
        yield f"Drop the strip's hooks from outside into the notches of both discs: join {number_ranges(rims)}."
    tongues = {join.number for join in joins if _is_of_rim(car, join)}
    if tongues:
        yield (
            "Put each tongue's head through the wide part of its slot and pull it into the narrow part; the last one "
            f"goes in before the hooks beside it drop into their notches: join {number_ranges(tongues)}."
        )


def _plugs(car: FoldedCar, step: AssemblyStep) -> Iterator[str]:
    """Yield the sentences of a step on plugs and wires."""
    wires = plugs_in(car, step)
    mounts = {mount.name: mount.part for mount in car.mounts}
    signals = [wire for wire in wires if wire.carries == "signal"]
    extended: dict[str, list[str]] = {}
    for wire in (wire for wire in signals if wire.a in mounts):
        extended.setdefault(mounts[wire.a], []).append(f"the {wire.b}")
    for extension, servos in extended.items():
        each_text = ", each" if len(servos) > 1 else ""
        yield f"Plug {join_words(servos)} into a {extension}{each_text}; tape the joints to the floor."
    if signals:
        count = sum(axle.driven for axle in car.axles)
        yield f"Plug {count} servos into the outputs that their leads are marked with; the brown lead is ground."
        if car.hinges:
            yield "Lead cables between segments through the openings of the caps, with a loop at each hinge."
    for wire in wires:
        if wire.carries != "signal":
            start = "The switch's free wire" if wire.a.startswith(car.parts.switch.name) else wire.a
            yield f"{start[0].upper()}{start[1:]} to {wire.b}: {wire.note}."


def _solder(car: FoldedCar, step: AssemblyStep) -> Iterator[str]:
    """Yield the sentences on soldering: all of it is done at the bench, in the step of the switch, far from the LiPo."""
    wires = soldered_in(car, step)
    if not wires:
        return
    remedies = {lead.start: lead_remedy(lead) for lead in leads(car)}
    yield "Press the switch in until its barbs hold behind the layers, its terminals on the printed side."
    yield (
        f"Solder now, before the {car.parts.lipo.name} is in the car and with no cells in the holder. Push heat-shrink "
        "tube over each wire first, and shrink it over the joint with a hot-air gun or a lighter, away from the film."
    )
    battery, switch = car.parts.battery.name, car.parts.switch.name
    longer = {sign: remedies.get(f"{battery} {sign}", "") for sign in "+-"}
    first = f", after you {longer['+']}" if longer["+"] else ""
    yield f"One terminal of the switch: the + lead of the {battery} (red){first}."
    if any(wire.a.startswith(switch) for wire in wires):
        yield f"The other terminal: {remedies[f'{switch} 2']}, solder one end to it, and leave the other end free."
    if longer["-"]:
        yield f"The - lead of the {battery} (black): {longer['-']}."


def _preparation(step: AssemblyStep, before: State) -> Iterator[str]:
    """Yield what is done to parts before they go in."""
    if before.car.parts.servo.name in {before.mounts[added.name].part for added in step.adds if added.kind == "mount"}:
        axles = sorted((axle for axle in before.car.axles if axle.driven), key=lambda axle: axle.channel)
        marks = "; ".join(f"{axle.servo} {axle.channel}" for axle in axles)
        yield (
            f"Before: mark the leads: {marks}. Leave the servos' potentiometers alone: their neutrals are measured when "
            "the car is complete."
        )
    if before.car.parts.feather.name in {before.mounts[a.name].part for a in step.adds if a.kind == "mount"}:
        yield from _board_preparation(before.car.parts)
    if step.title == SHUT and before.car.parts.battery_place == "floor":
        yield _put_cells_in(before.car.parts)
    yield from _cut_lengths(before.car, step, before)


def _put_cells_in(parts: Catalogue) -> str:
    """Return which cells are put into the holder."""
    return f"Turn the switch off, and put four charged cells of one kind into the holder: {parts.cells.cell}."


def _board_preparation(parts: Catalogue) -> Iterator[str]:
    """Yield how the boards are soldered and tried before they go in."""
    deep_mm = parts.headers.leg_mm.max_value - parts.feather.board_mm.value
    yield (
        f"Before: solder the {parts.headers.name} onto the {parts.feather.name}'s upper side, with which the "
        f"{parts.featherwing.name}'s pins mate. Their legs end at most {deep_mm:.1f} mm below the board. Never use "
        "stacking headers: their legs would reach the LiPo."
    )
    yield (
        f'Plug the {parts.feather.name} into the computer and load the firmware, as "Load the firmware" below says: a '
        "board that does not answer is easy to change now."
    )


def _cut_lengths(car: FoldedCar, step: AssemblyStep, before: State) -> Iterator[str]:
    """Yield the lengths to which rods and tubes are cut."""
    added = [before.mounts[thing.name] for thing in step.adds if thing.kind == "mount"]
    for part in (car.parts.axle_rod, car.parts.axle_tube):
        lengths = sorted({f"{mount.size_mm[2]:.1f}" for mount in added if mount.part == part.name}, key=float)
        if lengths:
            yield f"Before: cut the {part.name} to {join_words(lengths)} mm, and take the burr off its ends."


def _cautions(car: FoldedCar, step: AssemblyStep, before: State) -> Iterator[str]:
    """Yield notes on parts: orientation, fixing, checks."""
    parts = {before.mounts[added.name].part for added in step.adds if added.kind == "mount"}
    if car.parts.servo.name in parts:
        yield "The shaft is at the end of the servo that is nearer to the wheel's axle."
    if car.parts.tyre.name in parts:
        tyre = car.parts.tyre
        yield f"{tyre.note[0].upper()}{tyre.note[1:]}: {tyre_cut(car, step.unit)}."
    sides = {lead.start.removesuffix(" +"): lead.leaves for lead in leads(car)}
    if car.parts.lipo.name in parts:
        side = sides[car.parts.lipo.name]
        yield f"It lies in its outline on the film, its lead on the {side}, held by a strip of double-sided tape."
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
            "Press both feet onto the floor: push the bone folder under the boards, beside the cell, from the "
            "side of the bridge without a tongue."
        )
    if car.parts.board_pad.name in parts:
        yield "The pad, foam tape in two layers, sticks to film and board where the module covers the board's holes."
    if car.parts.horn_screw.name in parts:
        yield "Tighten them with the centre screw's head in the middle of the disc's hole: then the wheel runs true."
    strips = {p.name for p in car.pieces if any(crease.flexure for crease in p.creases)}
    if strips & {added.name for added in step.adds}:
        limits = [(-math.degrees(hinge.min_rad), math.degrees(hinge.max_rad)) for hinge in car.hinges]
        texts = [f"from {down:.0f}° nose down to {up:.0f}° nose up" for down, up in limits]
        all_equal = len(set(texts)) == 1
        ranges = texts[0] if all_equal else join_words([f"{text} at hinge {n}" for n, text in enumerate(texts, 1)])
        yield "The floors' ends lie along the orange marks of a hinge's strip, its sides flush with the walls."
        yield (
            f"A hinge's strip stays uncreased between the segments, which then pitch freely {ranges} against each other."
        )
    if any(added.kind == "unit" and added.body in {axle.wheel for axle in car.axles} for added in step.adds):
        yield "Turn every wheel by hand: it touches neither the wall nor its neighbour."


def service_lines(car: FoldedCar, steps: Sequence[AssemblyStep]) -> tuple[str, ...]:
    """Return how the finished car is opened, charged, connected and reset; ``steps`` are the proved service steps."""
    parts = car.parts
    mounts = {mount.name: mount for mount in car.mounts}
    lids = [number for number, step in enumerate(steps) if step.folds]
    reached: dict[bool, list[str]] = {False: [], True: []}
    for number, step in enumerate(steps):
        for reach in step.tool_uses:
            if not reach.piece:
                word = reached_part(car, mounts[reach.name], reach.index)
                reached[bool(lids) and number > lids[0]].append(word)
    shut, opened = (list(dict.fromkeys(reached[state])) for state in (False, True))
    opening = {name for step in steps for name in step.folds}
    locks = {join.number for join in car.joins if join.kind == "lock" and {join.piece_a, join.piece_b} & opening}
    lines = []
    if shut:
        lines.append(f"Reached from outside{', the lid shut' if lids else ''}: {join_words(shut)}.")
    if lids:
        lines.append(
            "To open the lid, one latch after the other: with a fingertip on the lid push the lever, "
            f"which stands at the right wall, outwards; that draws the tongue below it, join {number_ranges(locks)}, out "
            "of its slot. Then lift the lid by its pull tab."
        )
    if opened:
        lines.append(f"Reached with the lid open: {join_words(opened)}.")
    removed = {mounts[add.name].part for step in steps for add in step.adds}
    return (
        *lines,
        *(_change_cells(parts, name) for name in sorted(removed)),
        f"Charge the {parts.lipo.name} in the car: the {parts.feather.name} charges it from USB.",
        f"Reset: press the {parts.featherwing.name}'s button with the tip of a screwdriver"
        f"{', the lid open' if lids else ''}; the servos stop, and the car waits to be told to go.",
    )


def _change_cells(parts: Catalogue, name: str) -> str:
    """Return how a holder's cells are changed."""
    out = "off, as far as its leads reach" if parts.battery_place == "roof" else "out"
    return f"Change cells: switch off, take the {name} {out}, and charge its cells in their own charger."


def driving_steps(car: FoldedCar) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield titles and lines of the steps after the assembly: firmware, neutrals, one metre."""
    feather = car.parts.feather.name
    yield (
        "Load the firmware",
        (
            *([_put_cells_in(car.parts)] if car.parts.battery_place == "roof" else []),
            f"Connect the {feather} to the computer with a USB cable that carries data, and run `foldcar flash LISTING "
            "--experiment ID` with the listing and experiment of this car. It loads the firmware and the car's design.",
            "If no board is found, try another cable; `foldcar doctor` says what is missing.",
        ),
    )
    yield (
        "Find the neutrals",
        (
            "Stand the car on a box so that no wheel touches anything, and turn the switch on.",
            "Run `foldcar calibrate-servos`. It asks how each wheel turns, and saves each servo's neutral and dead band.",
            "A wheel turns backwards: look whether its plug is on the output that its lead is marked with. If it is, "
            "change the sign of that output's direction, as in `foldcar params set CH2_DIRECTION 1`.",
            "A wheel does not turn: is the switch on, are the cells charged, is the plug's brown lead at GND?",
        ),
    )
    yield (
        "Drive a metre",
        (
            "Put the car on a smooth floor with 2 m free in front of it, and keep a finger near the switch.",
            'Describe one metre of floor as the tutorial "A first car" does (docs/first_car.md), and run `foldcar log '
            "metre.json --experiment metre --store metre.db --car NAME`: it checks the car, counts down and drives.",
            "The car turns aside: repeat `foldcar calibrate-servos`, look for a wheel that rubs. It stops at once: the "
            "cells are empty or the log's last line says why.",
            "When it has driven its metre, it is ready for trials.",
        ),
    )


def reached_part(car: FoldedCar, mount: Mount, index: int) -> str:
    """Return a word for the part that a plug or finger reaches at clearance ``index`` of a mount."""
    parts, tool = car.parts, mount.clearances[index].tool
    if mount.part == parts.switch.name:
        return "switch"
    if tool in ("finger", "driver"):
        return "reset button" if mount.part in (parts.feather.name, parts.featherwing.name) else mount.name
    if mount.part == parts.feather.name:
        return "USB" if index == 0 else "LiPo's plug"
    return "servos' plugs" if mount.part == parts.featherwing.name else f"plug of {mount.name}"


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
