"""What a step of the guide says: what to take, to fold, to put in, to join, to screw and to plug, in this order.

Input: an AssemblyStep and the State before it. Output: lines of text. Numbers are those printed on the sheets.
"""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from foldcar.car.assembly.step import Added, AssemblyStep
from foldcar.car.components.hub_ring import turn_rad
from foldcar.car.components.wheel_size import WheelSize
from foldcar.car.folded.model import FoldedCar, Join, Mount
from foldcar.car.parts.fasteners import Spacer
from foldcar.fabrication.assembly.guide_state import State
from foldcar.fabrication.assembly.guide_step import listed, numbers
from foldcar.fabrication.assembly.operations import closing, is_screw, is_wound, plugs_in, turned

DRIVER = "PH0 screwdriver"
SIDES = (("the front", "the rear"), ("the left", "the right"), ("above", "below"))


def tools(car: FoldedCar) -> tuple[str, ...]:
    """Tools and materials of all steps, beside the parts."""
    screws = {mount.part for mount in car.mounts if is_screw(car.parts, mount)}
    return (
        "knife or cutting machine, ruler, blunt needle or bone folder",
        f"{DRIVER}, its shaft at most {car.parts.tools.driver_mm[0]:g} mm thick, for {listed(sorted(screws))}",
        "small pliers for nuts",
        "double-sided tape for PET, thin (0.1 mm or less) and 6 to 8 mm wide",
        "felt pen to mark the servos' leads; hook-and-loop tape for the holder of cells",
        "soldering iron, once: headers of the two boards, leads of the switch",
        "computer with a USB cable that carries data",
    )


def step_lines(step: AssemblyStep, before: State) -> tuple[str, ...]:
    """The instructions."""
    car = before.car
    return (
        *_folds(step, before),
        *_put_in(step, before),
        *_joins(car, step),
        *_screws(step, before),
        *_plugs(car, step),
        *_care(car, step, before),
    )


def _folds(step: AssemblyStep, before: State) -> Iterator[str]:
    wound = [before.pieces[name] for name in step.folds if is_wound(before.pieces[name])]
    if wound:
        yield f"Curl {listed([f'the {piece.label}' for piece in wound])} evenly, without a crease, printed side inside."
    alike: dict[str, list[str]] = {}
    for name, creases in step.folds.items():
        made = closing(step, before.closed, before.pieces[name])
        shut = [crease for crease in made if creases[crease.name]]
        angles = [math.degrees(crease.angle_rad) for crease in shut]
        kinds = Counter(("valley" if angle > 0 else "mountain", round(abs(angle))) for angle in angles)
        texts = [f"{n} {kind} fold{'s' if n > 1 else ''} of {degrees}°" for (kind, degrees), n in kinds.items()]
        opened = [crease.name for crease in made if crease not in shut]
        left = f"; leave {listed(opened)} open" if opened else ""
        if made:
            alike.setdefault(f"{listed(texts)}{left}", []).append(f"the {before.pieces[name].label}")
    for text, labels in alike.items():
        yield f"Fold {listed(labels)}: {text}{', each' if len(labels) > 1 else ''}."


def _put_in(step: AssemblyStep, before: State) -> Iterator[str]:
    car = before.car
    on_screws = {part.name for _, part in car.parts if isinstance(part, Spacer)}
    outward = {axle.wheel: 1 if axle.side == "left" else -1 for axle in car.axles} if step.unit else {}
    groups: dict[str, Counter[str]] = {}
    for added in step.adds:
        screw = added.kind == "mount" and is_screw(car.parts, before.mounts[added.name])
        if added.way_mm and not screw and (not step.unit or added.body == step.adds[0].body):
            label = _label(added, before)
            place = "one on each screw" if label in on_screws else f"from {_from(added, outward.get(added.body, 0))}"
            groups.setdefault(place, Counter())[label] += 1
    for place, labels in groups.items():
        text = listed([f"{count} × {label}" if count > 1 else label for label, count in labels.items()])
        yield f"{text[0].upper()}{text[1:]}: {place}."


def _label(added: Added, before: State) -> str:
    if added.kind == "unit":
        return added.name
    if added.kind == "piece":
        return before.pieces[added.name].label
    return before.mounts[added.name].part


def _from(added: Added, outward: int) -> str:
    """Where a thing comes from, move by move; ``outward`` is the sign of y on a wheel's outer side, 0 for the car."""
    places = []
    for move in added.way_mm:
        axis = int(np.argmax(np.abs(move)))
        if outward and axis == 1:
            places.append("the outer side" if move[axis] * outward < 0 else "the inner side")
        else:
            places.append(SIDES[axis][0 if move[axis] < 0 else 1])
    return ", then from ".join(dict.fromkeys(places))


def _joins(car: FoldedCar, step: AssemblyStep) -> Iterator[str]:
    joins = [join for join in car.joins if join.number in step.joins]
    layers = {join.number: join.piece_a for join in joins if join.kind == "laminate"}
    labels = {piece.name: piece.label for piece in car.pieces}
    flat = {piece.name for piece in car.pieces if not piece.creases}
    for number, name in sorted(layers.items()):
        how = "on, edges and holes on each other" if name in flat else "where it lies on what has the same number"
        yield f"Tape the {labels[name]} {how}: join {number}."
    yield from _wheel_joins(car, step)
    own = {join.number for join in joins if join.kind == "rim" or _is_of_wheel(car, join)}
    for kinds, text in (
        (("tab", "lap"), "Tape the tabs to the inside of the panel with the same number: join {}."),
        (("tab_slot",), "Push the tongues through the slots with the same number: join {}."),
        (("lock",), "Hold the levers outwards, press the lid down, let go: the tongues go into their slots: join {}."),
        (("tuck",), "Lay the edges inside the walls, without tape: join {}."),
    ):
        found = {join.number for join in joins if join.kind in kinds} - own
        if found:
            yield text.format(numbers(found))


def _is_of_wheel(car: FoldedCar, join: Join) -> bool:
    """Whether a wound strip locks."""
    return join.kind == "lock" and is_wound(next(piece for piece in car.pieces if piece.name == join.piece_a))


def _wheel_joins(car: FoldedCar, step: AssemblyStep) -> Iterator[str]:
    """How the hub ring's hooks, the rim's hooks and its tongues are joined."""
    joins = [join for join in car.joins if join.number in step.joins]
    labels = {piece.name: piece.label for piece in car.pieces}
    for join in turned(car, step):
        radius, width = car.axles[0].radius_mm, car.axles[0].tyre_width_mm
        angle = math.degrees(turn_rad(WheelSize(radius, width, car.parts)))
        yield (
            f"Drop the ring's hooks into the slots of the {labels[join.piece_b]}, and turn the disc against the ring "
            f"until they hold: clockwise, as seen from its unprinted side, by about {angle:.0f}°: join {join.number}."
        )
    rims = {join.number for join in joins if join.kind == "rim"}
    if rims:
        yield f"Drop the strip's hooks from outside into the notches of both discs: join {numbers(rims)}."
    tongues = {join.number for join in joins if _is_of_wheel(car, join)} - {join.number for join in turned(car, step)}
    if tongues:
        yield (
            "Put each tongue's head through the wide part of its slot and pull it into the narrow part; the last one "
            f"goes in before the hooks beside it drop into their notches: join {numbers(tongues)}."
        )


def _screws(step: AssemblyStep, before: State) -> Iterator[str]:
    car = before.car
    screws = [before.mounts[added.name] for added in step.adds if added.kind == "mount"]
    screws = [mount for mount in screws if is_screw(car.parts, mount)]
    of_axles = {axle.wheel for axle in car.axles}
    for part, found in _by_part(screws).items():
        wheels = {mount.body for mount in found} & of_axles
        each = f", {len(found) // len(wheels)} a wheel" if wheels and len(found) % len(wheels) == 0 else ""
        nut = "; hold the nut with pliers" if "nut" in part else ""
        yield f"{len(found)} × {part}{each}: {DRIVER}{nut}."


def _by_part(mounts: Iterable[Mount]) -> dict[str, list[Mount]]:
    found: dict[str, list[Mount]] = {}
    for mount in mounts:
        found.setdefault(mount.part, []).append(mount)
    return found


def _plugs(car: FoldedCar, step: AssemblyStep) -> Iterator[str]:
    wires = plugs_in(car, step)
    signals = [wire for wire in wires if wire.carries == "signal"]
    if signals:
        yield f"Plug {len(signals)} servos into the outputs that their leads are marked with; the brown lead is ground."
        if car.hinges:
            yield "Lead cables between segments through the openings of the caps, with a loop at each hinge."
    for wire in wires:
        if wire.carries != "signal":
            yield f"{wire.a[0].upper()}{wire.a[1:]} to {wire.b}: {wire.note}."


def _care(car: FoldedCar, step: AssemblyStep, before: State) -> Iterator[str]:
    """What a part asks for beside its place."""
    parts = {before.mounts[added.name].part for added in step.adds if added.kind == "mount"}
    if car.parts.servo.name in parts:
        yield (
            "Before: give each servo pulses of 1500 µs and turn its potentiometer until it stands still. Mark the leads: "
            + "; ".join(f"{axle.servo} {axle.channel}" for axle in sorted(car.axles, key=lambda axle: axle.channel)) + "."
        )
        yield "The shaft is at the end of the servo that is nearer to the wheel's axle."
    if car.parts.tyre.name in parts:
        yield f"{car.parts.tyre.name[0].upper()}{car.parts.tyre.name[1:]}: {car.parts.tyre.note}."
    if car.parts.lipo.name in parts:
        yield "It lies in its outline on the film, held by a strip of double-sided tape."
    if car.parts.battery.name in parts:
        yield "It stands on hook-and-loop tape in its outline, so that it comes out for its cells."
    if car.parts.board_pad.name in parts:
        yield "The pad, foam tape in two layers, sticks to film and board where the module covers the board's holes."
    if car.parts.horn_screw.name in parts:
        yield "Tighten them with the centre screw's head in the middle of the disc's hole: then the wheel runs true."
    strips = {p.name for p in car.pieces if any(crease.flexure for crease in p.creases)}
    if strips & {added.name for added in step.adds}:
        low, high = (math.degrees(limit) for limit in (car.hinges[0].min_rad, car.hinges[0].max_rad))
        yield (
            "A hinge's strip stays uncreased between the segments, which then pitch freely from "
            f"{low:.0f}° (nose down) to {high:.0f}° (nose up) against each other."
        )
    if any(added.kind == "unit" and added.body in {axle.wheel for axle in car.axles} for added in step.adds):
        yield "Turn every wheel by hand: it touches neither the wall nor its neighbour."


def service_lines(car: FoldedCar, steps: Sequence[AssemblyStep]) -> tuple[str, ...]:
    """How the finished car is opened, charged, connected and reset; ``steps`` are those that are proved."""
    parts = car.parts
    mounts = {mount.name: mount for mount in car.mounts}
    lids = [number for number, step in enumerate(steps) if step.folds]
    reached: dict[bool, list[str]] = {False: [], True: []}
    for number, step in enumerate(steps):
        for reach in step.reaches:
            if not reach.piece:
                word = reached_word(car, mounts[reach.name], reach.index)
                reached[bool(lids) and number > lids[0]].append(word)
    shut, opened = (list(dict.fromkeys(reached[state])) for state in (False, True))
    opening = {name for step in steps for name in step.folds}
    locks = {join.number for join in car.joins if join.kind == "lock" and {join.piece_a, join.piece_b} & opening}
    lines = []
    if shut:
        lines.append(f"Reached from outside{', the lid shut' if lids else ''}: {listed(shut)}.")
    if lids:
        lines.append(
            "To open the lid, one latch after the other: with a fingertip between lever and pull tab push the lever, "
            f"which stands at the right wall, outwards; that draws the tongue below it, join {numbers(locks)}, out of "
            "its slot. Then lift the lid by the pull tab."
        )
    if opened:
        lines.append(f"Reached with the lid open: {listed(opened)}.")
    taken = {mounts[one.name].part for step in steps for one in step.adds}
    return (
        *lines,
        *(f"Change cells: take the {name} out, and charge its cells in their own charger." for name in sorted(taken)),
        f"Charge the {parts.lipo.name} in the car: the {parts.feather.name} charges it from USB.",
        f"Reset: press the {parts.featherwing.name}'s button with the tip of a screwdriver"
        f"{', the lid open' if lids else ''}; the servos stop, and the car waits to be told to go.",
    )


def reached_word(car: FoldedCar, mount: Mount, index: int) -> str:
    """What a plug or finger reaches at access ``index`` of a mount, in a word."""
    parts, tool = car.parts, mount.accesses[index].tool
    if mount.part == parts.switch.name:
        return "switch"
    if tool in ("finger", "driver"):
        return "reset button" if mount.part in (parts.feather.name, parts.featherwing.name) else mount.name
    if mount.part == parts.feather.name:
        return "USB" if index == 0 else "LiPo's plug"
    return "servos' plugs" if mount.part == parts.featherwing.name else f"plug of {mount.name}"
