"""The sequence of assembly and service steps; prove.py adds the insertion paths.

Input: a FoldedCar. Output: steps. Layers are glued onto flat pieces. Walls are folded up, lids stay open. Servos follow,
and a battery on the lid, whose leads pass the lid before they are soldered to the switch in its cap; then caps and hinge
strips. Boards are screwed onto their carrier outside the car, while it is flat; carrier and other parts go in from above.
Wheels are assembled outside the car; horns and wheels go on. Lids are shut, before the wheels if a battery is on them. In
service USB and switch are used with the lid shut, plugs and reset with it open; the battery is changed.
"""

from collections.abc import Iterable, Sequence
from functools import lru_cache

from foldcar.car.folded.model import FoldedCar, Mount, PlacedPiece
from foldcar.car.proof.roles import Roles, roles_of
from foldcar.car.proof.step import AddedPart, AssemblyStep, Folds, ToolUse

# Endings of the names of the disc on the horn and of the layer glued to it (components/wheel.py).
INNER = ("wheel inner disc", "wheel hub")
# Parts closer than this along the car are on the same axle.
SAME_MM = 1e-6
SHUT = "Shut the lid"
OPEN = "Push the levers outwards and lift the lid by its pull tab"
USES = {"plug": "Plug a cable into", "finger": "Press", "driver": "Press, with a screwdriver,"}


class Building:
    """The steps so far, the parts that are in place, and the joins that are made."""

    def __init__(self, roles: Roles) -> None:
        self.roles = roles
        self.steps: list[AssemblyStep] = []
        self.parts: set[str] = set()
        self._present: set[tuple[str, int]] = set()
        self._folded = {piece.name for piece in roles.car.pieces if not piece.creases}
        self._made_joins: set[int] = set()
        self._in_units: set[str] = set()
        # Joins that shut a lid are made last.
        self._lid_joins = {number for lid in roles.lids.values() for number in lid.joins}

    def step(
        self, title: str, pieces: Iterable[PlacedPiece] = (), mounts: Iterable[Mount] = (),
        units: Iterable[AddedPart] = (), folds: Folds | None = None, unit: str = "", flat: bool = False,
    ) -> None:  # fmt: skip
        """Append a step, unless it would be empty. Pieces come in folded, unless the step is ``flat``."""
        pieces, mounts, units, folds = list(pieces), list(mounts), list(units), dict(folds or {})
        for piece in pieces:
            fractions = self.roles.all_folded(piece.piece)
            if not flat and fractions:
                folds.setdefault(piece.piece, fractions)
        self._present |= {(piece.piece, piece.copy) for piece in pieces}
        self.parts |= {mount.name for mount in mounts}
        self._folded |= {name for name, fractions in folds.items() if any(fractions.values())}
        if unit:
            self._in_units |= {piece.piece for piece in pieces}
        # The pieces of a unit that is put in are no longer apart from the car.
        for added_unit in units:
            self._in_units -= {added.name for step in self.steps if step.unit == added_unit.name for added in step.adds}
        joins = self._joins(flat, unit)
        adds = (
            *(AddedPart("piece", piece.piece, piece.copy, piece.body) for piece in pieces),
            *units,
            *(AddedPart("mount", mount.name, 0, mount.body) for mount in mounts),
        )
        screws = [mount for mount in mounts if self.roles.is_fastener(mount)]
        drivers = ((m.name, i) for m in screws for i, clearance in enumerate(m.clearances) if clearance.tool == "driver")
        tool_uses = tuple(ToolUse(*place) for place in drivers)
        if adds or joins or folds:
            self.steps.append(AssemblyStep(title, folds, adds, joins, tool_uses, unit))

    def with_screws(self, mounts: Sequence[Mount]) -> list[Mount]:
        """Return the mounts that are not in place yet. A screw follows the last of the parts that it holds."""
        remaining = [mount for mount in mounts if mount.name not in self.parts]
        screws: dict[str, list[Mount]] = {}
        for screw in (m for m in self.roles.car.mounts if self.roles.is_fastener(m) and m.name not in self.parts):
            held_mounts = [m for m in remaining if m.body == screw.body and m in self.roles.held_by(screw)]
            if held_mounts:
                screws.setdefault(held_mounts[-1].name, []).append(screw)
        return [part for mount in remaining for part in (mount, *screws.get(mount.name, ()))]

    def _joins(self, flat: bool, unit: str) -> tuple[int, ...]:
        """Return the joins that can be made now: all copies of both pieces are in place and folded.

        Layers are laminated while they are flat. Joins of the lid are made later.
        """
        pieces = self.roles.car.pieces
        complete = {piece.name for piece in pieces if all((piece.name, i) in self._present for i in range(piece.count))}
        numbers = set()
        for join in self.roles.car.joins:
            ends = {join.piece_a, join.piece_b}
            are_folded = ends <= self._folded or (join.kind == "laminate" and flat)
            are_together = ends <= self._in_units if unit else not ends & self._in_units
            if join.number not in self._made_joins | self._lid_joins and ends <= complete and are_folded and are_together:
                numbers.add(join.number)
        self._made_joins |= numbers
        return tuple(sorted(numbers))


@lru_cache(maxsize=16)
def plan_assembly(car: FoldedCar) -> tuple[AssemblyStep, ...]:
    """Return all assembly steps of a car, in order; the insertion paths are empty."""
    roles = roles_of(car)
    building = Building(roles)
    _plan_segments(roles, building)
    _plan_inside(roles, building)
    # Wheels would be in the way of a battery on an open lid.
    shut_first = any(roles.is_on_lid(mount) for mount in car.mounts)
    if shut_first:
        _plan_shutting(roles, building)
    for unit, wheels in roles.wheel_units.items():
        _plan_wheels(roles, building, unit, wheels)
    if not shut_first:
        _plan_shutting(roles, building)
    return tuple(building.steps)


def _plan_shutting(roles: Roles, building: Building) -> None:
    """Add the step in which the lids are folded shut and locked, if there are lids."""
    folds = {name: dict.fromkeys(lid.creases, 1.0) for name, lid in sorted(roles.lids.items()) if lid.creases}
    if folds:
        shutting = sorted({number for lid in roles.lids.values() for number in lid.joins})
        building.steps.append(AssemblyStep(SHUT, folds, (), tuple(shutting)))


def _plan_segments(roles: Roles, building: Building) -> None:
    """Add the steps that build the segments: beams with their layers and walls, servos, rods, caps and connectors.

    Layers are taped onto flat pieces. So a cap or a connector with layers is a unit, which is put together outside
    the car.
    """
    copies = list(roles.non_base_copies())
    bases = [roles.base[body] for body in roles.bodies]
    layers = [other for other in copies if roles.is_layer(other)]

    def layers_on(hosts: Sequence[PlacedPiece]) -> list[PlacedPiece]:
        return [layer for layer in layers if (host := roles.host(layer)) is not None and host.piece in hosts]

    other_pieces = [other for other in copies if other not in layers]
    connectors = [piece for piece in other_pieces if roles.is_connector(piece)]
    caps = [piece for piece in other_pieces if piece not in connectors and not roles.is_carrier(piece)]
    title = "Tape the layers onto the flat beam" if layers_on(bases) else "Lay out the beam"
    building.step(title, [*bases, *layers_on(bases)], flat=True)
    folds = {name: roles.all_folded(name) | dict.fromkeys(roles.lids[name].creases, 0.0) for name in sorted(roles.bases)}
    building.step("Fold the walls up", folds=folds)
    servos = [m for m in roles.car.mounts if m.part == roles.car.parts.servo.name]
    building.step("Screw the servos in from outside", mounts=building.with_screws(servos))
    rods = [m for m in roles.car.mounts if m.part == roles.car.parts.axle_rod.name]
    building.step("Push the rods through the walls", mounts=rods)
    for mount in (mount for mount in roles.car.mounts if roles.is_on_lid(mount)):
        building.step(f"Put the {mount.name} on the open lid", mounts=building.with_screws([mount]))
    for title, group in (("Close the ends", caps), ("Join the segments", connectors)):
        with_layers = [piece for piece in group if layers_on([piece])]
        for piece in with_layers:
            flat_title, unit = f"Tape the layers onto the flat {piece.piece}", _unit_name(roles, piece)
            building.step(flat_title, [piece, *layers_on([piece])], unit=unit, flat=True)
            hosts = ((mount, roles.mount_host(mount)) for mount in roles.car.mounts)
            for mount in (mount for mount, host in hosts if host is not None and host.piece is piece):
                building.step(f"Put the {mount.name} into the flat {piece.piece}", mounts=[mount], unit=unit, flat=True)
        units = [AddedPart("unit", _unit_name(roles, piece), 0, piece.body) for piece in with_layers]
        without_layers = [piece for piece in group if piece not in with_layers]
        folds = {piece.piece: roles.all_folded(piece.piece) for piece in with_layers}
        building.step(title, without_layers, units=units, folds=folds)
    building.step("Glue the other layers on", [layer for layer in layers if roles.host(layer) is None])


def _unit_name(roles: Roles, piece: PlacedPiece) -> str:
    """Return the name of the unit that is assembled on a copy of a piece."""
    return piece.piece if roles.pieces[piece.piece].count == 1 else f"{piece.piece} {piece.copy + 1}"


def _plan_inside(roles: Roles, building: Building) -> None:
    """Add the steps of the carriers with their boards, of the parts under them, and of other parts inside."""
    car, wheels = roles.car, set(roles.wheels)
    carriers = [other for other in roles.non_base_copies() if roles.is_carrier(other)]
    carried = [m for carrier in carriers for m in roles.carried(carrier) if not roles.is_fastener(m)]
    parts = [m for m in car.mounts if m.body not in wheels and not roles.is_fastener(m) and m.name not in building.parts]
    wires = [extension.name for extension in car.parts.extensions.sold] + [car.parts.wiring.name]
    # Extension cables come before the other wires.
    plugged_parts = sorted((m for m in parts if m.part in wires), key=lambda m: m.part == wires[-1])
    axle_parts = (car.parts.axle_tube.name, car.parts.axle_cap.name)
    # Parts that come in with their carrier, last of all, with the lid or with the axles are not put in one by one.
    later = (*plugged_parts, *carried)
    parts = [m for m in parts if m not in later and not roles.is_on_lid(m) and m.part not in axle_parts]
    under_carrier = [m for m in parts if m.part == car.parts.lipo.name and carriers]
    for carrier in carriers:
        boards = sorted((m for m in roles.carried(carrier) if not roles.is_fastener(m)), key=lambda m: m.pose[2][3])
        name, parts_on = _unit_name(roles, carrier), building.with_screws(boards)
        all_folds = roles.all_folded(carrier.piece)
        building.step(f"Screw the boards onto the flat {carrier.piece}", [carrier], parts_on, unit=name, flat=True)
        building.step(f"Fold the {carrier.piece}", folds={carrier.piece: all_folds} if all_folds else {}, unit=name)
    for mount in under_carrier:
        building.step(f"Put the {mount.name} in", mounts=building.with_screws([mount]))
    for carrier in carriers:
        units = [AddedPart("unit", _unit_name(roles, carrier), 0, carrier.body)]
        building.step(f"Put the {carrier.piece} with the boards in", units=units)
    for mount in (mount for mount in parts if mount not in under_carrier):
        building.step(f"Put the {mount.name} in", mounts=building.with_screws([mount]))
    screws = [m for m in car.mounts if roles.is_fastener(m) and m.name not in building.parts and m.body not in wheels]
    building.step("Drive the other screws", mounts=screws)
    building.step("Plug all wires in", mounts=plugged_parts)


def _plan_wheels(roles: Roles, building: Building, unit: str, wheels: Sequence[str]) -> None:
    """Add the steps of a unit's wheels: assembled outside the car, then put onto horns or onto their rod."""
    car = roles.car
    placed = [piece for wheel in wheels for piece in roles.placed(wheel)]
    mounts = [m for m in car.mounts if m.body in wheels]
    horns = [m for m in mounts if m.part == car.parts.horn.name]
    screws = [m for m in mounts if roles.is_fastener(m)]
    centre_screws = [m for m in screws if m.part == car.parts.centre_screw.name]
    strips = [piece for piece in placed if roles.is_wound(piece.piece)]
    inner = [piece for piece in placed if piece.piece.endswith(INNER)]
    # Wheels of several units are named.
    suffix = "" if len(roles.wheel_units) == 1 else f" ({unit}s)"
    building.step(f"Tape the hubs onto the inner discs{suffix}", inner, unit=unit)
    others = [piece for piece in placed if piece not in strips and piece not in inner]
    building.step(f"Put the outer discs on{suffix}", others, unit=unit)
    building.step(f"Wind the rims around the discs{suffix}", strips, unit=unit)
    tyres = [m for m in mounts if m.part == car.parts.tyre.name]
    building.step(f"Stretch the tyres over the rims{suffix}", mounts=tyres, unit=unit)
    units = [AddedPart("unit", unit, n, wheel) for n, wheel in enumerate(wheels)]
    if not horns:
        axles = {axle.center_mm[0] for axle in car.axles if axle.unit == unit}
        on_rods = [m for m in car.mounts if any(abs(m.pose[0][3] - x) < SAME_MM for x in axles)]
        tubes, caps = ([m for m in on_rods if m.part == part.name] for part in (car.parts.axle_tube, car.parts.axle_cap))
        building.step(f"Slide the spacer tubes onto the rods{suffix}", mounts=tubes)
        building.step(f"Slide the wheels onto the rods{suffix}", units=units)
        building.step(f"Press the caps onto the rods{suffix}", mounts=caps)
        return
    building.step(f"Screw the horns onto the servos{suffix}", mounts=[*horns, *centre_screws])
    wheel_screws = [m for m in screws if m not in centre_screws]
    building.step(f"Screw the wheels onto the horns{suffix}", units=units, mounts=wheel_screws)


@lru_cache(maxsize=16)
def plan_service(car: FoldedCar) -> tuple[AssemblyStep, ...]:
    """Return the steps of service: first those with the lid shut, then the one that opens it, then those with the
    lid open.

    ``adds`` of a step are the parts that are taken out of the car. Their paths are not computed yet.
    """
    roles = roles_of(car)
    with_lid_shut: list[AssemblyStep] = []
    with_lid_open: list[AssemblyStep] = []
    for mount in car.mounts:
        if roles.is_fastener(mount):
            continue
        for index, clearance in enumerate(mount.clearances):
            action = f"{USES[clearance.tool]} {mount.name}"
            tool_uses = (ToolUse(mount.name, index),)
            if roles.from_outside(mount, clearance):
                title = f"{action}, the lid shut"
                with_lid_shut.append(AssemblyStep(title, folds={}, adds=(), joins=(), tool_uses=tool_uses))
            else:
                title = f"{action}, the lid open"
                with_lid_open.append(AssemblyStep(title, folds={}, adds=(), joins=(), tool_uses=tool_uses))
    for mount in car.mounts:
        if mount.part != car.parts.battery.name:
            continue
        battery = (AddedPart("mount", mount.name, 0, mount.body),)
        if roles.is_on_lid(mount):
            with_lid_shut.append(AssemblyStep(f"Take {mount.name} off", folds={}, adds=battery, joins=()))
        else:
            with_lid_open.append(AssemblyStep(f"Take {mount.name} out", folds={}, adds=battery, joins=()))
    return (*with_lid_shut, *_plan_opening(roles), *with_lid_open)


def _plan_opening(roles: Roles) -> list[AssemblyStep]:
    """Return the step in which fingers open the lids; no step for a car without lids."""
    open_folds: dict[str, dict[str, float]] = {}
    grips: list[ToolUse] = []
    for name, lid in sorted(roles.lids.items()):
        if lid.creases:
            open_folds[name] = dict.fromkeys(lid.creases, 0.0)
            for face in lid.gripped:
                grips += [ToolUse(face.name, index, name) for index in range(len(face.clearances))]
    if not open_folds:
        return []
    return [AssemblyStep(OPEN, open_folds, adds=(), joins=(), tool_uses=tuple(grips))]
