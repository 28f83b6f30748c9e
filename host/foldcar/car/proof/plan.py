"""The sequence of the assembly and of the service, without the ways on which things come in: see prove.py.

Input: a FoldedCar. Output: steps. Layers are glued onto flat pieces; walls are folded up, lids open; servos, caps and
what joins segments follow; boards are screwed to their carrier apart, while it is flat; it and other parts go in from
above; wheels are put together apart, horns and wheels go on; lids are shut, and what lies on them is put on. In service
USB and switch are used with the lid shut, plugs and reset with it open, the battery is changed.
"""

from collections.abc import Iterable, Sequence
from functools import lru_cache

from foldcar.car.folded.model import FoldedCar, Mount, PlacedPiece
from foldcar.car.proof.roles import Roles, roles_of
from foldcar.car.proof.step import Added, AssemblyStep, Folds, Reach

# How the names of the disc on the horn and of the layer glued to it end (components/wheel.py).
INNER = ("wheel inner disc", "wheel hub")
# Parts on one axle are no farther apart along the car.
SAME_MM = 1e-6
OPEN = "Push the levers outwards and lift the lid by its pull tab"
USES = {"plug": "Plug a cable into", "finger": "Press", "driver": "Press, with a screwdriver,"}


class Building:
    """The steps so far, what is there and which joins are made."""

    def __init__(self, roles: Roles) -> None:
        self.roles = roles
        self.steps: list[AssemblyStep] = []
        self.parts: set[str] = set()
        self._there: set[tuple[str, int]] = set()
        self._shaped = {piece.name for piece in roles.car.pieces if not piece.creases}
        self._made: set[int] = set()
        self._apart: set[str] = set()
        # Joins that shut a lid are made last.
        self._last = {number for lid in roles.lids.values() for number in lid.joins}

    def step(
        self, title: str, pieces: Iterable[PlacedPiece] = (), mounts: Iterable[Mount] = (),
        units: Iterable[Added] = (), folds: Folds | None = None, unit: str = "", flat: bool = False,
    ) -> None:  # fmt: skip
        """Append a step; pieces come in folded, unless it is ``flat``. A step that does nothing is left out."""
        pieces, mounts, units, closed = list(pieces), list(mounts), list(units), dict(folds or {})
        for piece in pieces:
            whole = self.roles.whole(piece.piece)
            if not flat and whole:
                closed.setdefault(piece.piece, whole)
        self._there |= {(piece.piece, piece.copy) for piece in pieces}
        self.parts |= {mount.name for mount in mounts}
        self._shaped |= {name for name, fractions in closed.items() if any(fractions.values())}
        if unit:
            self._apart |= {piece.piece for piece in pieces}
        for came in units:
            self._apart -= {added.name for step in self.steps if step.unit == came.name for added in step.adds}
        joins = self._joins(flat, unit)
        adds = (
            *(Added("piece", piece.piece, piece.copy, piece.body) for piece in pieces),
            *units,
            *(Added("mount", mount.name, 0, mount.body) for mount in mounts),
        )
        screws = [mount for mount in mounts if self.roles.is_fastener(mount)]
        drivers = ((m.name, i) for m in screws for i, access in enumerate(m.accesses) if access.tool == "driver")
        reaches = tuple(Reach(*place) for place in drivers)
        if adds or joins or closed:
            self.steps.append(AssemblyStep(title, closed, adds, joins, reaches, unit))

    def with_screws(self, mounts: Sequence[Mount]) -> list[Mount]:
        """The mounts that are not in yet, each screw after the last one of them that it holds."""
        left = [mount for mount in mounts if mount.name not in self.parts]
        screws: dict[str, list[Mount]] = {}
        for screw in (m for m in self.roles.car.mounts if self.roles.is_fastener(m) and m.name not in self.parts):
            held = [m for m in left if m.body == screw.body and m in self.roles.held_by(screw)]
            if held:
                screws.setdefault(held[-1].name, []).append(screw)
        return [one for mount in left for one in (mount, *screws.get(mount.name, ()))]

    def _joins(self, flat: bool, unit: str) -> tuple[int, ...]:
        """The joins that can be made now: all copies of both pieces are there, not apart and, but for layers, folded."""
        pieces = self.roles.car.pieces
        whole = {piece.name for piece in pieces if all((piece.name, i) in self._there for i in range(piece.count))}
        found = set()
        for join in self.roles.car.joins:
            ends = {join.piece_a, join.piece_b}
            shaped = ends <= self._shaped or (join.kind == "laminate" and flat)
            together = ends <= self._apart if unit else not ends & self._apart
            if join.number not in self._made | self._last and ends <= whole and shaped and together:
                found.add(join.number)
        self._made |= found
        return tuple(sorted(found))


@lru_cache(maxsize=16)
def planned(car: FoldedCar) -> tuple[AssemblyStep, ...]:
    """All steps of a car, in order; the ways are empty."""
    roles = roles_of(car)
    building = Building(roles)
    _segments(roles, building)
    _inside(roles, building)
    for unit, wheels in roles.wheel_units.items():
        _wheels(roles, building, unit, wheels)
    # The lids are folded shut and locked; what lies on them is put on.
    folds = {name: dict.fromkeys(lid.creases, 1.0) for name, lid in sorted(roles.lids.items()) if lid.creases}
    if folds:
        shutting = sorted({number for lid in roles.lids.values() for number in lid.joins})
        building.steps.append(AssemblyStep("Shut the lid", folds, (), tuple(shutting)))
    for mount in (mount for mount in car.mounts if roles.is_on_lid(mount)):
        building.step(f"Put the {mount.name} on", mounts=building.with_screws([mount]))
    return tuple(building.steps)


def _segments(roles: Roles, building: Building) -> None:
    """Beams, their layers and walls, servos, caps, what joins segments."""
    others = list(roles.others())
    bases = [roles.base[body] for body in roles.bodies]
    layers = [other for other in others if roles.is_layer(other)]

    def on(several: Sequence[PlacedPiece]) -> list[PlacedPiece]:
        return [layer for layer in layers if (host := roles.host(layer)) is not None and host[0] in several]

    rest = [other for other in others if other not in layers]
    between = [one for one in rest if roles.is_between(one)]
    caps = [one for one in rest if one not in between and not roles.is_carrier(one)]
    title = "Tape the layers onto the flat beam" if on(bases) else "Lay out the beam"
    building.step(title, [*bases, *on(bases)], flat=True)
    folds = {name: roles.whole(name) | dict.fromkeys(roles.lids[name].creases, 0.0) for name in sorted(roles.bases)}
    building.step("Fold the walls up", folds=folds)
    servos = [m for m in roles.car.mounts if m.part == roles.car.parts.servo.name]
    building.step("Screw the servos in from outside", mounts=building.with_screws(servos))
    rods = [m for m in roles.car.mounts if m.part == roles.car.parts.axle_rod.name]
    building.step("Push the rods through the walls", mounts=rods)
    for title, group in (("Close the ends", caps), ("Join the segments", between)):
        doubled = [one for one in group if on([one])]
        for one in doubled:
            flat = f"Tape the layers onto the flat {one.piece}"
            building.step(flat, [one, *on([one])], unit=_unit(roles, one), flat=True)
        units = [Added("unit", _unit(roles, one), 0, one.body) for one in doubled]
        alone = [one for one in group if one not in doubled]
        building.step(title, alone, units=units, folds={one.piece: roles.whole(one.piece) for one in doubled})
    building.step("Glue the other layers on", [layer for layer in layers if roles.host(layer) is None])


def _unit(roles: Roles, one: PlacedPiece) -> str:
    """The name of a piece's unit."""
    return one.piece if roles.pieces[one.piece].count == 1 else f"{one.piece} {one.copy + 1}"


def _inside(roles: Roles, building: Building) -> None:
    """The carriers with their boards, what lies under them, other parts."""
    car, wheels = roles.car, set(roles.wheels)
    carriers = [other for other in roles.others() if roles.is_carrier(other)]
    carried = [m for carrier in carriers for m in roles.carried(carrier) if not roles.is_fastener(m)]
    parts = [m for m in car.mounts if m.body not in wheels and not roles.is_fastener(m) and m.name not in building.parts]
    wires = [extension.name for extension in car.parts.extensions.sold] + [car.parts.wiring.name]
    plugged = sorted((m for m in parts if m.part in wires), key=lambda m: m.part == wires[-1])
    with_wheels = (car.parts.axle_tube.name, car.parts.axle_cap.name)
    parts = [m for m in parts if m not in (*plugged, *carried) and not roles.is_on_lid(m) and m.part not in with_wheels]
    under = [m for m in parts if m.part == car.parts.lipo.name and carriers]
    for carrier in carriers:
        boards = sorted((m for m in roles.carried(carrier) if not roles.is_fastener(m)), key=lambda m: m.pose[2][3])
        name, parts_on, whole = _unit(roles, carrier), building.with_screws(boards), roles.whole(carrier.piece)
        building.step(f"Screw the boards onto the flat {carrier.piece}", [carrier], parts_on, unit=name, flat=True)
        building.step(f"Fold the {carrier.piece}", folds={carrier.piece: whole} if whole else {}, unit=name)
    for mount in under:
        building.step(f"Put the {mount.name} in", mounts=building.with_screws([mount]))
    for carrier in carriers:
        units = [Added("unit", _unit(roles, carrier), 0, carrier.body)]
        building.step(f"Put the {carrier.piece} with the boards in", units=units)
    for mount in (mount for mount in parts if mount not in under):
        building.step(f"Put the {mount.name} in", mounts=building.with_screws([mount]))
    screws = [m for m in car.mounts if roles.is_fastener(m) and m.name not in building.parts and m.body not in wheels]
    building.step("Drive the other screws", mounts=screws)
    building.step("Plug all wires in", mounts=plugged)


def _wheels(roles: Roles, building: Building, unit: str, wheels: Sequence[str]) -> None:
    """Wheels of a unit are put together apart; horns go onto the servos, wheels onto the horns, or onto their rod."""
    car = roles.car
    placed = [one for wheel in wheels for one in roles.placed(wheel)]
    mounts = [m for m in car.mounts if m.body in wheels]
    horns = [m for m in mounts if m.part == car.parts.horn.name]
    screws = [m for m in mounts if roles.is_fastener(m)]
    central = [m for m in screws if m.part == car.parts.centre_screw.name]
    strips = [one for one in placed if roles.is_wound(one.piece)]
    inner = [one for one in placed if one.piece.endswith(INNER)]
    # Wheels of several units are named.
    of = "" if len(roles.wheel_units) == 1 else f" ({unit}s)"
    building.step(f"Tape the hubs onto the inner discs{of}", inner, unit=unit)
    others = [one for one in placed if one not in strips and one not in inner]
    building.step(f"Put the outer discs on{of}", others, unit=unit)
    building.step(f"Wind the rims around the discs{of}", strips, unit=unit)
    tyres = [m for m in mounts if m.part == car.parts.tyre.name]
    building.step(f"Stretch the tyres over the rims{of}", mounts=tyres, unit=unit)
    units = [Added("unit", unit, n, wheel) for n, wheel in enumerate(wheels)]
    if not horns:
        axles = {axle.center_mm[0] for axle in car.axles if axle.unit == unit}
        on_rods = [m for m in car.mounts if any(abs(m.pose[0][3] - x) < SAME_MM for x in axles)]
        tubes, caps = ([m for m in on_rods if m.part == part.name] for part in (car.parts.axle_tube, car.parts.axle_cap))
        building.step(f"Slide the spacer tubes onto the rods{of}", mounts=tubes)
        building.step(f"Slide the wheels onto the rods{of}", units=units)
        building.step(f"Press the caps onto the rods{of}", mounts=caps)
        return
    building.step(f"Screw the horns onto the servos{of}", mounts=[*horns, *central])
    rest = [m for m in screws if m not in central]
    building.step(f"Screw the wheels onto the horns{of}", units=units, mounts=rest)


@lru_cache(maxsize=16)
def service(car: FoldedCar) -> tuple[AssemblyStep, ...]:
    """The steps of service, from the finished car to that with its lid open; ``adds`` are taken out, their ways empty."""
    roles = roles_of(car)
    shut: list[AssemblyStep] = []
    opened: list[AssemblyStep] = []
    for mount in (m for m in car.mounts if not roles.is_fastener(m)):
        for i, access in enumerate(mount.accesses):
            outside = roles.from_outside(mount, access)
            what = f"{USES[access.tool]} {mount.name}, the lid {'shut' if outside else 'open'}"
            (shut if outside else opened).append(AssemblyStep(what, {}, (), (), (Reach(mount.name, i),)))
    folds = {name: dict.fromkeys(lid.creases, 0.0) for name, lid in sorted(roles.lids.items()) if lid.creases}
    for mount in (m for m in car.mounts if m.part == car.parts.battery.name):
        on_lid = roles.is_on_lid(mount)
        out = f"Take {mount.name} {'off' if on_lid else 'out'}"
        (shut if on_lid else opened).append(AssemblyStep(out, {}, (Added("mount", mount.name, 0, mount.body),), ()))
    gripped = [(name, face) for name in folds for face in roles.lids[name].gripped]
    grips = tuple(Reach(face.name, i, name) for name, face in gripped for i in range(len(face.accesses)))
    lifted = [AssemblyStep(OPEN, folds, (), (), grips)] if folds else []
    return (*shut, *lifted, *opened)
