"""The sequence of the assembly, without the ways on which things come in: these are found in prove.py.

Input: a FoldedCar. Output: steps. Layers are glued onto flat pieces; walls are folded up, lids open; servos, caps and
what joins segments follow; boards are screwed to their carrier apart, while it is flat; it and other parts go in from
above; wheels are put together apart, horns and wheels go on; lids are shut, and what lies on them is put on.
"""

from collections.abc import Sequence
from functools import lru_cache

from foldcar.car.assembly_order.building import Building
from foldcar.car.assembly_order.roles import Roles, roles_of
from foldcar.car.assembly_order.step import Added, AssemblyStep
from foldcar.car.folded.model import FoldedCar, Mount, PlacedPiece

# The unit of every wheel; other units are named after their piece.
WHEEL = "wheel"


@lru_cache(maxsize=16)
def planned(car: FoldedCar) -> tuple[AssemblyStep, ...]:
    """All steps of a car, in order; the ways are empty."""
    roles = roles_of(car)
    building = Building(roles)
    _segments(roles, building)
    _inside(roles, building)
    if roles.wheels:
        _wheels(roles, building)
    _shut(roles, building)
    return tuple(building.steps)


def _segments(roles: Roles, building: Building) -> None:
    """Beams, their layers and walls, servos, caps, what joins segments."""
    others = list(roles.others())
    bases = [roles.base[body] for body in roles.bodies]
    layers = {(one.piece, one.copy): roles.host(one) for one in others if roles.is_layer(one)}
    on_beams = [one for one in others if (host := layers.get((one.piece, one.copy))) is not None and host[0] in bases]
    rest = [one for one in others if (one.piece, one.copy) not in layers]
    between = [one for one in rest if roles.is_between(one)]
    caps = [one for one in rest if one not in between and not roles.is_carrier(one)]
    title = "Tape the layers onto the flat beam" if on_beams else "Lay out the beam"
    building.step(title, [*bases, *on_beams], flat=True)
    folds = {}
    for name in sorted(roles.bases):
        opening = roles.lids[name].creases
        folds[name] = {c.name: 0.0 if c.name in opening else 1.0 for c in roles.pieces[name].creases}
    building.step("Fold the walls up", folds=folds)
    servos = [m for m in roles.car.mounts if m.part == roles.car.parts.servo.name]
    building.step("Screw the servos in from outside", mounts=building.with_screws(servos))
    for title, group in (("Close the ends", caps), ("Join the segments", between)):
        doubled = []
        for one in group:
            mine = [p for p in others if (host := layers.get((p.piece, p.copy))) is not None and host[0] is one]
            if mine:
                name = _unit(roles, one)
                doubled.append(Added("unit", name, 0, one.body))
                building.step(f"Tape the layers onto the flat {one.piece}", [one, *mine], unit=name, flat=True)
        units = {unit.name for unit in doubled}
        folded = {
            one.piece: {crease.name: 1.0 for crease in roles.pieces[one.piece].creases}
            for one in group
            if _unit(roles, one) in units
        }
        alone = [one for one in group if _unit(roles, one) not in units]
        building.step(title, alone, units=doubled, folds=folded)
    loose = [one for one in others if (one.piece, one.copy) in layers and layers[one.piece, one.copy] is None]
    building.step("Glue the other layers on", loose)


def _unit(roles: Roles, one: PlacedPiece) -> str:
    """The name of a piece's unit."""
    return one.piece if roles.pieces[one.piece].count == 1 else f"{one.piece} {one.copy + 1}"


def _inside(roles: Roles, building: Building) -> None:
    """The carriers with their boards, what lies under them, other parts."""
    car, wheels = roles.car, set(roles.wheels)
    carriers = [one for one in roles.others() if roles.is_carrier(one)]
    carried = [m for one in carriers for m in roles.carried(one) if not roles.is_fastener(m)]
    parts = [m for m in car.mounts if m.body not in wheels and not roles.is_fastener(m) and m.name not in building.parts]
    soft = [m for m in parts if m.part == car.parts.wiring.name]
    sold = {extension.name for extension in car.parts.extensions.sold}
    extensions = [m for m in parts if m.part in sold]
    parts = [m for m in parts if m not in (*soft, *extensions, *carried) and not roles.is_on_lid(m)]
    under = [m for m in parts if any(_under(m, board) for board in carried)]
    for one in carriers:
        boards = sorted((m for m in roles.carried(one) if not roles.is_fastener(m)), key=lambda m: m.pose[2][3])
        name, parts_on = _unit(roles, one), building.with_screws(boards)
        building.step(f"Screw the boards onto the flat {one.piece}", [one], parts_on, unit=name, flat=True)
        whole = {crease.name: 1.0 for crease in roles.pieces[one.piece].creases}
        building.step(f"Fold the {one.piece}", folds={one.piece: whole} if whole else {}, unit=name)
    for mount in under:
        building.step(f"Put the {mount.name} in", mounts=building.with_screws([mount]))
    for one in carriers:
        units = [Added("unit", _unit(roles, one), 0, one.body)]
        building.step(f"Put the {one.piece} with the boards in", units=units)
    for mount in parts:
        if mount not in under:
            building.step(f"Put the {mount.name} in", mounts=building.with_screws([mount]))
    left = [m for m in car.mounts if m.name not in building.parts and m.body not in wheels and m not in soft]
    left = [m for m in left if roles.is_fastener(m)]
    building.step("Drive the other screws", mounts=left)
    building.step("Plug all wires in", mounts=[*extensions, *soft])


def _under(mount: Mount, board: Mount) -> bool:
    """Whether a mount lies below a board that is above it."""
    if mount.body != board.body or mount.pose[2][3] >= board.pose[2][3]:
        return False
    for axis in (0, 1):
        reach = sum(
            sum(abs(one.pose[axis][k]) * one.size_mm[k] for k in range(3)) / 2 for one in (mount, board)
        )
        if abs(mount.pose[axis][3] - board.pose[axis][3]) >= reach:
            return False
    return True


def _wheels(roles: Roles, building: Building) -> None:
    """Wheels are put together apart; horns go onto the servos, wheels onto the horns."""
    car, wheels = roles.car, roles.wheels
    placed = [one for wheel in wheels for one in roles.placed(wheel)]
    mounts = [m for m in car.mounts if m.body in wheels]
    horns = [m for m in mounts if m.part == car.parts.horn.name]
    screws = [m for m in mounts if roles.is_fastener(m)]
    central = [m for m in screws if roles.on_axis(m)]
    strips = [one for one in placed if roles.is_wound(one.piece)]
    first = _first_discs(roles, horns)
    inner = [one for one in placed if one.piece in first]
    building.step("Tape the hubs onto the inner discs", inner, unit=WHEEL)
    others = [one for one in placed if one not in strips and one not in inner]
    building.step("Put the outer discs on", others, unit=WHEEL)
    building.step("Wind the rims around the discs", strips, unit=WHEEL)
    building.step("Stretch the tyres over the rims", mounts=[m for m in mounts if roles.is_tyre(m)], unit=WHEEL)
    building.step("Screw the horns onto the servos", mounts=[*horns, *central])
    units = [Added("unit", WHEEL, n, wheel) for n, wheel in enumerate(wheels)]
    building.step("Screw the wheels onto the horns", units=units, mounts=[m for m in screws if m not in central])


def _first_discs(roles: Roles, horns: Sequence[Mount]) -> set[str]:
    """The disc on the horn and the layers glued to it."""
    faces = {horn.face for horn in horns}
    on_wheels = {one.piece for wheel in roles.wheels for one in roles.placed(wheel)}
    found = {name for name in on_wheels if any(face.name in faces for face in roles.pieces[name].faces)}
    for join in roles.car.joins:
        ends = {join.piece_a, join.piece_b}
        if join.kind == "laminate" and ends & found and ends <= on_wheels:
            found |= ends
    return found


def _shut(roles: Roles, building: Building) -> None:
    """The lids are folded shut and locked; what lies on them is put on."""
    lids = roles.lids
    folds = {name: dict.fromkeys(lids[name].creases, 1.0) for name in sorted(lids) if lids[name].creases}
    if folds:
        building.shut("Shut the lid", folds)
    for mount in roles.car.mounts:
        if roles.is_on_lid(mount):
            building.step(f"Put the {mount.name} on", mounts=building.with_screws([mount]))
