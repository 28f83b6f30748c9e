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
    """The steps so far, the parts that are in place, and the joins that are made.

    A *unit* is several parts that are put together outside the car, and are then put in as one.
    """

    def __init__(self, roles: Roles) -> None:
        """Begin the assembly, in which nothing is in place yet."""
        self.roles = roles
        self.steps: list[AssemblyStep] = []
        # The names of the bought parts (mounts) in place, and the names and numbers of the copies of pieces in place.
        self.parts: set[str] = set()
        self._present: set[tuple[str, int]] = set()
        # The names of the pieces that are folded; a piece without creases needs no folding.
        self._folded = {piece.name for piece in roles.car.pieces if not piece.creases}
        self._made_joins: set[int] = set()
        # The names of the pieces in units that are still outside the car.
        self._outside: set[str] = set()
        # Joins that shut a lid are made last.
        self._lid_joins = {number for lid in roles.lids.values() for number in lid.joins}

    def step(
        self, title: str, pieces: Iterable[PlacedPiece] = (), mounts: Iterable[Mount] = (),
        units: Iterable[AddedPart] = (), folds: Folds | None = None, unit: str = "", flat: bool = False,
    ) -> None:  # fmt: skip
        """Append a step that adds pieces, bought parts (mounts) and finished units, unless it would be empty.

        If ``unit`` is given, the step assembles the unit of that name outside the car. ``units`` are finished units,
        which the step puts into the car. Pieces are folded in this step, unless it is ``flat``. ``folds`` are further
        folds that the step closes.
        """
        pieces, mounts, units = list(pieces), list(mounts), list(units)
        all_folds = dict(folds or {})
        if not flat:
            for piece in pieces:
                if fractions := self.roles.all_folded(piece.piece):
                    all_folds.setdefault(piece.piece, fractions)
        # What is in place, folded, and outside the car from now on.
        self._present |= {(piece.piece, piece.copy) for piece in pieces}
        self.parts |= {mount.name for mount in mounts}
        self._folded |= {name for name, fractions in all_folds.items() if any(fractions.values())}
        if unit:
            self._outside |= {piece.piece for piece in pieces}
        for finished_unit in units:
            self._outside -= self._names_in_unit(finished_unit.name)
        # The step itself.
        joins = self._joins(flat, unit)
        added_pieces = [AddedPart("piece", piece.piece, piece.copy, piece.body) for piece in pieces]
        added_mounts = [AddedPart("mount", mount.name, 0, mount.body) for mount in mounts]
        adds = (*added_pieces, *units, *added_mounts)
        if adds or joins or all_folds:
            self.steps.append(AssemblyStep(title, all_folds, adds, joins, self._driver_uses(mounts), unit))

    def _driver_uses(self, mounts: Iterable[Mount]) -> tuple[ToolUse, ...]:
        """Return the uses of a screwdriver, which turns each screw among the mounts."""
        uses = []
        for mount in mounts:
            if self.roles.is_fastener(mount):
                for index, clearance in enumerate(mount.clearances):
                    if clearance.tool == "driver":
                        uses.append(ToolUse(mount.name, index))
        return tuple(uses)

    def _names_in_unit(self, unit: str) -> set[str]:
        """Return the names of the pieces and parts that were added to a unit."""
        return {added.name for step in self.steps if step.unit == unit for added in step.adds}

    def with_screws(self, mounts: Sequence[Mount]) -> list[Mount]:
        """Return those of the ``mounts`` that are not in place yet, with the screws that hold them.

        If a screw holds several of them, it comes after the last of these.
        """
        missing = [mount for mount in mounts if mount.name not in self.parts]
        screws_after: dict[str, list[Mount]] = {}
        for screw in self.roles.car.mounts:
            if not self.roles.is_fastener(screw) or screw.name in self.parts:
                continue
            held = [mount for mount in missing if mount.body == screw.body and mount in self.roles.held_by(screw)]
            if held:
                screws_after.setdefault(held[-1].name, []).append(screw)
        with_screws = []
        for mount in missing:
            with_screws += [mount, *screws_after.get(mount.name, ())]
        return with_screws

    def _joins(self, flat: bool, unit: str) -> tuple[int, ...]:
        """Return the joins that can be made in a step, and count them as made.

        A join can be made if all copies of its two pieces are in place and folded. If the step is ``flat``, layers are
        also laminated onto pieces that are not folded. If the step assembles a ``unit`` outside the car, both pieces must
        be outside; otherwise, both must be in the car. The joins that shut a lid come last of all, in a step of their
        own.
        """
        complete_pieces = set()
        for piece in self.roles.car.pieces:
            if all((piece.name, copy) in self._present for copy in range(piece.count)):
                complete_pieces.add(piece.name)
        excluded_joins = self._made_joins | self._lid_joins
        new_joins = set()
        for join in self.roles.car.joins:
            pieces = {join.piece_a, join.piece_b}
            are_complete = pieces.issubset(complete_pieces)
            are_folded = pieces.issubset(self._folded)
            is_laminated_flat = flat and join.kind == "laminate"
            are_together = pieces.issubset(self._outside) if unit else pieces.isdisjoint(self._outside)
            can_be_made = are_complete and are_together and (are_folded or is_laminated_flat)
            if can_be_made and join.number not in excluded_joins:
                new_joins.add(join.number)
        self._made_joins |= new_joins
        return tuple(sorted(new_joins))


@lru_cache(maxsize=16)
def plan_assembly(car: FoldedCar) -> tuple[AssemblyStep, ...]:
    """Return the steps in which a car is assembled, in order.

    The steps do not say yet on which paths their parts are put in; the proof (prove.py) adds these paths.
    """
    roles = roles_of(car)
    building = Building(roles)
    _plan_segments(roles, building)
    _plan_inside(roles, building)
    # In general the lids are shut last. But if a lid carries a part, such as a battery, it is shut before the wheels are
    # added: while it is open, this part would meet the wheels.
    a_lid_carries_a_part = any(roles.is_on_lid(mount) for mount in car.mounts)
    if a_lid_carries_a_part:
        _plan_shutting(roles, building)
    for unit, wheels in roles.wheel_units.items():
        _plan_wheels(roles, building, unit, wheels)
    if not a_lid_carries_a_part:
        _plan_shutting(roles, building)
    return tuple(building.steps)


def _plan_shutting(roles: Roles, building: Building) -> None:
    """Add the step in which the lids are folded shut and locked, if there are lids."""
    folds = {name: dict.fromkeys(lid.creases, 1.0) for name, lid in sorted(roles.lids.items()) if lid.creases}
    if folds:
        shutting = sorted({number for lid in roles.lids.values() for number in lid.joins})
        building.steps.append(AssemblyStep(SHUT, folds, (), tuple(shutting)))


def _plan_segments(roles: Roles, building: Building) -> None:
    """Add the steps that build the segments, the rigid parts of the car.

    A *beam* is the box of a segment, and a *layer* is a piece that lies flat on another one and makes it thicker. Layers
    are taped onto the flat beams, whose walls are then folded up. Servos or rods follow, and a battery on a lid. Then the
    *caps* close the ends of the beams, and the *connectors*, which belong to the hinges, join the segments.
    """
    car = roles.car
    # The beams.
    beams = [roles.beams[body] for body in roles.segments]
    layers = _layers_on(roles, beams)
    title = "Tape the layers onto the flat beam" if layers else "Lay out the beam"
    building.step(title, [*beams, *layers], flat=True)
    # All folds are closed, except those of the lids, which stay open.
    folds = {}
    for name in sorted(roles.beam_names):
        open_lid = dict.fromkeys(roles.lids[name].creases, 0.0)
        folds[name] = roles.all_folded(name) | open_lid
    building.step("Fold the walls up", folds=folds)
    # Parts in the walls and on the lids.
    servos = [mount for mount in car.mounts if mount.part == car.parts.servo.name]
    building.step("Screw the servos in from outside", mounts=building.with_screws(servos))
    rods = [mount for mount in car.mounts if mount.part == car.parts.axle_rod.name]
    building.step("Push the rods through the walls", mounts=rods)
    for mount in car.mounts:
        if roles.is_on_lid(mount):
            building.step(f"Put the {mount.name} on the open lid", mounts=building.with_screws([mount]))
    # Caps and connectors. Pieces that carry boards are *carriers*. They come later, with the parts inside.
    others = [copy for copy in roles.non_beam_copies() if not roles.is_layer(copy)]
    connectors = [copy for copy in others if roles.is_connector(copy)]
    caps = [copy for copy in others if copy not in connectors and not roles.is_carrier(copy)]
    _plan_taped(roles, building, "Close the ends", caps)
    _plan_taped(roles, building, "Join the segments", connectors)
    # Layers whose host, the piece on which they lie, is none of the pieces.
    loose_layers = [copy for copy in roles.non_beam_copies() if roles.is_layer(copy) and roles.host(copy) is None]
    building.step("Glue the other layers on", loose_layers)


def _layers_on(roles: Roles, hosts: Sequence[PlacedPiece]) -> list[PlacedPiece]:
    """Return the layers that lie on one of these pieces."""
    layers = []
    for copy in roles.non_beam_copies():
        host = roles.host(copy) if roles.is_layer(copy) else None
        if host is not None and host.piece in hosts:
            layers.append(copy)
    return layers


def _plan_taped(roles: Roles, building: Building, title: str, pieces: Sequence[PlacedPiece]) -> None:
    """Add the step ``title``, which tapes caps or connectors to the beams, and the steps that prepare it.

    Layers are pieces that make another piece thicker, and are taped onto it while it is flat. So a cap or connector
    with layers is first made into a *unit* outside the car: its layers are taped on, and the parts are mounted that
    belong into it, such as switches. The unit is folded when it is put into the car. A piece without layers is put in
    directly.
    """
    with_layers = [piece for piece in pieces if _layers_on(roles, [piece])]
    # The steps that make the units.
    for piece in with_layers:
        unit = _unit_name(roles, piece)
        layers = _layers_on(roles, [piece])
        building.step(f"Tape the layers onto the flat {piece.piece}", [piece, *layers], unit=unit, flat=True)
        for mount in roles.car.mounts:
            # The piece to which the part is mounted.
            host = roles.mount_host(mount)
            if host is not None and host.piece is piece:
                building.step(f"Put the {mount.name} into the flat {piece.piece}", mounts=[mount], unit=unit, flat=True)
    # The step that puts everything into the car.
    units, folds = [], {}
    for piece in with_layers:
        units.append(AddedPart(kind="unit", name=_unit_name(roles, piece), copy=0, body=piece.body))
        folds[piece.piece] = roles.all_folded(piece.piece)
    without_layers = [piece for piece in pieces if piece not in with_layers]
    building.step(title, without_layers, units=units, folds=folds)


def _unit_name(roles: Roles, piece: PlacedPiece) -> str:
    """Return the name of the unit that is assembled on a copy of a piece."""
    return piece.piece if roles.pieces[piece.piece].count == 1 else f"{piece.piece} {piece.copy + 1}"


def _plan_inside(roles: Roles, building: Building) -> None:
    """Add the steps of what comes into the segments, in this order.

    A *carrier* is a piece of film with boards on it, such as the bridge. Its boards are screwed on outside the car. Parts
    under a carrier go into the car, then the carriers, the other parts, the remaining screws and the wires.
    """
    car, wheels = roles.car, set(roles.wheels)
    # Each carrier with its boards becomes a *unit*, which is put together outside the car.
    carriers = [copy for copy in roles.non_beam_copies() if roles.is_carrier(copy)]
    for carrier in carriers:
        unit, fractions = _unit_name(roles, carrier), roles.all_folded(carrier.piece)
        boards_with_screws = building.with_screws(_boards_on(roles, carrier))
        title = f"Screw the boards onto the flat {carrier.piece}"
        building.step(title, [carrier], boards_with_screws, unit=unit, flat=True)
        folds = {carrier.piece: fractions} if fractions else {}
        building.step(f"Fold the {carrier.piece}", folds=folds, unit=unit)
    # The other parts. Those with steps of their own are left out: screws, wires, what is on a lid, and the tubes and caps
    # on rods, which come with the wheels.
    cable_names = [extension.name for extension in car.parts.extensions.sold]
    wire_names = [*cable_names, car.parts.wiring.name]
    axle_names = [car.parts.axle_tube.name, car.parts.axle_cap.name]
    inside = [mount for mount in car.mounts if mount.body not in wheels and mount.name not in building.parts]
    parts = []
    for mount in inside:
        has_own_step = mount.part in (*wire_names, *axle_names) or roles.is_on_lid(mount) or roles.is_fastener(mount)
        if not has_own_step:
            parts.append(mount)
    # The LiPo lies under the carrier, so it comes before it.
    first_parts = [mount for mount in parts if mount.part == car.parts.lipo.name and carriers]
    for mount in first_parts:
        building.step(f"Put the {mount.name} in", mounts=building.with_screws([mount]))
    for carrier in carriers:
        carrier_unit = AddedPart("unit", _unit_name(roles, carrier), 0, carrier.body)
        building.step(f"Put the {carrier.piece} with the boards in", units=[carrier_unit])
    for mount in parts:
        if mount not in first_parts:
            building.step(f"Put the {mount.name} in", mounts=building.with_screws([mount]))
    screws = [mount for mount in inside if roles.is_fastener(mount) and mount.name not in building.parts]
    building.step("Drive the other screws", mounts=screws)
    # Extension cables are plugged in before the other wires.
    wires = [mount for mount in inside if mount.part in wire_names]
    building.step("Plug all wires in", mounts=sorted(wires, key=lambda mount: mount.part not in cable_names))


def _boards_on(roles: Roles, carrier: PlacedPiece) -> list[Mount]:
    """Return the parts on a carrier without their screws, the lowest first."""
    mounts = [mount for mount in roles.carried(carrier) if not roles.is_fastener(mount)]
    return sorted(mounts, key=lambda mount: mount.center_mm[2])


def _plan_wheels(roles: Roles, building: Building, unit: str, wheels: Sequence[str]) -> None:
    """Add the steps of the wheels of one ``unit``, which are alike.

    They are assembled outside the car, and then put onto the horns of their servos or onto a rod.
    """
    car, parts = roles.car, roles.car.parts
    pieces = [piece for wheel in wheels for piece in roles.placed(wheel)]
    strips = [piece for piece in pieces if roles.is_wound(piece.piece)]
    inner = [piece for piece in pieces if piece.piece.endswith(INNER)]
    outer = [piece for piece in pieces if piece not in strips and piece not in inner]
    mounts = [mount for mount in car.mounts if mount.body in wheels]
    # Wheels of several units are named.
    suffix = "" if len(roles.wheel_units) == 1 else f" ({unit}s)"
    building.step(f"Tape the hubs onto the inner discs{suffix}", inner, unit=unit)
    building.step(f"Put the outer discs on{suffix}", outer, unit=unit)
    building.step(f"Wind the rims around the discs{suffix}", strips, unit=unit)
    tyres = [mount for mount in mounts if mount.part == parts.tyre.name]
    building.step(f"Stretch the tyres over the rims{suffix}", mounts=tyres, unit=unit)
    finished_wheels = [AddedPart("unit", unit, number, wheel) for number, wheel in enumerate(wheels)]
    horns = [mount for mount in mounts if mount.part == parts.horn.name]
    if horns:
        screws = [mount for mount in mounts if roles.is_fastener(mount)]
        centre_screws = [screw for screw in screws if screw.part == parts.centre_screw.name]
        wheel_screws = [screw for screw in screws if screw not in centre_screws]
        building.step(f"Screw the horns onto the servos{suffix}", mounts=[*horns, *centre_screws])
        building.step(f"Screw the wheels onto the horns{suffix}", units=finished_wheels, mounts=wheel_screws)
        return
    tubes = _mounts_on_axles(car, unit, parts.axle_tube.name)
    caps = _mounts_on_axles(car, unit, parts.axle_cap.name)
    building.step(f"Slide the spacer tubes onto the rods{suffix}", mounts=tubes)
    building.step(f"Slide the wheels onto the rods{suffix}", units=finished_wheels)
    building.step(f"Press the caps onto the rods{suffix}", mounts=caps)


def _mounts_on_axles(car: FoldedCar, unit: str, part: str) -> list[Mount]:
    """Return the mounts of a part that are on the axles of a unit's wheels."""
    axle_xs = {axle.center_mm[0] for axle in car.axles if axle.unit == unit}
    mounts = []
    for mount in car.mounts:
        x = mount.center_mm[0]
        if mount.part == part and any(abs(x - axle_x) < SAME_MM for axle_x in axle_xs):
            mounts.append(mount)
    return mounts


@lru_cache(maxsize=16)
def plan_service(car: FoldedCar) -> tuple[AssemblyStep, ...]:
    """Return the steps of service, in which a user uses tools on a finished car and takes its battery out.

    The first steps are those with the lid shut. Then comes the one that opens the lid, and then those with the lid open.
    In steps of assembly, the field ``adds`` has the parts that are put in. In these steps, it has the parts that are
    taken out. On which path they come out is not computed yet.
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
    """Return the step in which fingers open the lids; no step for a car without lids.

    A lid opens when its creases unfold to the angle 0. Each face that fingers press or hold has *clearances*, the places
    that must be free for a finger. The step uses all of them.
    """
    open_folds: dict[str, dict[str, float]] = {}
    finger_uses: list[ToolUse] = []
    for name, lid in sorted(roles.lids.items()):
        if lid.creases:
            open_folds[name] = dict.fromkeys(lid.creases, 0.0)
            for face in lid.gripped:
                for clearance_index in range(len(face.clearances)):
                    finger_uses.append(ToolUse(face.name, clearance_index, name))
    if not open_folds:
        return []
    return [AssemblyStep(OPEN, open_folds, adds=(), joins=(), tool_uses=tuple(finger_uses))]
