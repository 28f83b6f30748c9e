"""The proof that a car can be put together: everything has a way in, every tool, plug and finger has room.

Input: a FoldedCar. Output: its steps with the ways found, and findings that name the step and the parts. Fixed film
bends, tongues snap, rims are wound, tyres stretched: these have no way to find.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from foldcar.car.folded.model import FoldedCar, Mount
from foldcar.car.folded.placed import Finding
from foldcar.car.folded.pose import compose, translation
from foldcar.car.proof.blocks import Blocks, Way, hit, swept, together, vector, way_out
from foldcar.car.proof.plan import planned, service
from foldcar.car.proof.roles import Lid, roles_of
from foldcar.car.proof.scene import Scene, Stage, title
from foldcar.car.proof.step import Added, AssemblyStep, Folds, Reach, Thing, Vector

CAR = ("", "")
# A lid turns in steps so small that film 100 mm from its fold leaves the hull of two of its places by 0.02 mm.
SWING_STEPS = 40


@dataclass(frozen=True)
class Proof:
    """The steps of assembly and of service with the ways that were found, and what does not go."""

    steps: tuple[AssemblyStep, ...]
    service: tuple[AssemblyStep, ...]
    findings: tuple[Finding, ...]


@lru_cache(maxsize=16)
def prove(car: FoldedCar) -> Proof:
    """The proof of a car."""
    return prove_steps(car, planned(car))


def prove_steps(car: FoldedCar, several: Sequence[AssemblyStep]) -> Proof:
    """The proof of a car that is put together in these steps."""
    prover = _Prover(car)
    steps = tuple(prover.step(f"step {n}", one) for n, one in enumerate(several, 1))
    serviced = tuple(prover.service_step(f"service {n}", one) for n, one in enumerate(service(car), 1))
    return Proof(steps, serviced, tuple(prover.findings))


class _Prover:
    """The assembly as it is: what stands where."""

    def __init__(self, car: FoldedCar) -> None:
        self.car, self.roles = car, roles_of(car)
        self.scene = Scene(self.roles)
        self.joined = self.scene.ignored()
        self.stage = Stage(self.roles, {})
        # What stands in the car (no unit), and in units by name and body.
        self.standing: dict[tuple[str, str], dict[Thing, Blocks]] = {CAR: {}}
        self.findings: list[Finding] = []

    def step(self, number: str, step: AssemblyStep) -> AssemblyStep:
        """Prove one step and carry it out; returns it with the ways found."""
        place = f"{number}, {step.title}"
        self._fold(place, step)
        found: list[Added] = []
        for added in step.adds:
            group = (step.unit, added.body) if step.unit else CAR
            first = step.adds[0].body
            if step.unit in self.roles.wheel_units and added.body != first:
                # Wheels are alike: the way of the first one's, turned with the wheel.
                mine = [add for add in step.adds if add.body == added.body]
                twin = [one for one in found if one.body == first][mine.index(added)]
                came = replace(added, way_mm=tuple(self._turned(move, first, added.body) for move in twin.way_mm))
            else:
                came, before = added, self.standing.get(group, {})
                if before and not self._is_bent(added):
                    came = self._way(place, added, before)
            self.standing.setdefault(group, {}).update({key: self._solid(key) for key in self._keys(added)})
            if came.body == first or step.unit not in self.roles.wheel_units:
                self._reach(place, [reach for reach in step.reaches if reach.name == added.name], group)
            found.append(came)
        return replace(step, adds=tuple(found))

    def service_step(self, number: str, step: AssemblyStep) -> AssemblyStep:
        """Prove one step of service: what opens a lid is reached while it is shut; it opens on the way that it shut.

        What is taken out stays out.
        """
        place = f"{number}, {step.title}"
        self._reach(place, step.reaches, CAR)
        self._close(step.folds)
        found = []
        for added in step.adds:
            for key in self._keys(added):
                self.standing[CAR].pop(key, None)
            found.append(self._way(place, added, self.standing[CAR]))
        return replace(step, adds=tuple(found))

    def _find(self, place: str, message: str) -> None:
        self.findings.append(Finding("assembly", place, message))

    def _turned(self, move: Vector, first: str, other: str) -> Vector:
        a, b = (np.array(self.roles.placed(body)[0].pose)[:3, :3] for body in (first, other))
        return vector(b @ a.T @ np.array(move))

    def _fold(self, place: str, step: AssemblyStep) -> None:
        """Close folds; what swings meets nothing of its own piece or of what stands there."""
        for name, fractions in step.folds.items():
            before = self.stage.folds.get(name, {})
            lid = self.roles.lids.get(name)
            if lid is not None and lid.creases and set(fractions) == set(lid.creases):
                angles = {crease.name: crease.angle_rad for crease in self.roles.pieces[name].creases}
                self._swing(place, name, f"the lid of {name} does not shut", list(_closing(lid, angles)))
            elif any(key[1] == name for standing in self.standing.values() for key in standing):
                shares = [i / SWING_STEPS for i in range(SWING_STEPS + 1)]
                path = [{c: before.get(c, 0.0) * (1 - s) + f * s for c, f in fractions.items()} for s in shares]
                self._swing(place, name, f"{name} does not fold", path)
        self._close(step.folds)

    def _close(self, folds: Folds) -> None:
        if not folds:
            return
        self.stage = self.stage.closed(folds)
        for standing in self.standing.values():
            standing.update({key: self._solid(key) for key in standing})

    def _solid(self, key: Thing) -> Blocks:
        return self.scene.solid(key, self.stage)

    def _keys(self, added: Added) -> list[Thing]:
        if added.kind == "unit":
            return list(self.standing.get((added.name, added.body), {}))
        return [(added.kind, added.name, added.copy)]

    def _is_bent(self, added: Added) -> bool:
        """Whether something is laid out, wound or stretched, so that it has no straight way."""
        if added.kind == "piece":
            return added.name in self.roles.bases or self.roles.is_wound(added.name)
        if added.kind == "unit":
            return False
        return self.roles.mounts[added.name].part in (self.car.parts.wiring.name, self.car.parts.tyre.name)

    def _way(self, place: str, added: Added, there: Mapping[Thing, Blocks]) -> Added:
        """With the way in, found as a way out; a finding if there is none."""
        moving, standing = together(self._solid(key) for key in self._keys(added)), together(there.values())
        own: list[Vector] = []
        mount = self.roles.mounts[added.name] if added.kind == "mount" else None
        if mount is not None:
            axes = np.array(mount.pose)[:3, :3].T
            own = [vector(sign * axis) for axis in axes for sign in (1.0, -1.0)]
        nut: Way | None = None
        if mount is not None and self.roles.is_fastener(mount):
            way, nut = self._screw_ways(mount, standing, own)
            added = replace(added, passes=self.roles.passed_by(mount))
            for thing in (thing for thing in added.passes if thing not in there):
                self._find(place, f"{self._name(added)} passes {thing[1]}, which is not there yet")
        elif mount is not None and self._plugs_onto(mount, there):
            # Pins go straight into their sockets.
            way = way_out(moving, standing, own[4:], self.joined, only_own=True)
        else:
            way = way_out(moving, standing, own, self.joined)
        ways_in = []
        for what, one in (("", way), ("the nut of ", nut)):
            if one is not None and one.moves_mm is None:
                self._find(place, f"{what}{self._name(added)} {_why(one)}")
            moves = (one.moves_mm or ()) if one is not None else ()
            ways_in.append(tuple(vector(-np.array(move)) for move in reversed(moves)))
        return replace(added, way_mm=ways_in[0], nut_mm=ways_in[1])

    def _plugs_onto(self, mount: Mount, there: Mapping[Thing, Blocks]) -> bool:
        """Whether a mount is a board that is plugged onto one that is there, header on header."""
        boards = self.roles.board_names
        names = {self.roles.mounts[name].part for kind, name, _ in there if kind == "mount"}
        return mount.part in boards and bool(names & (boards - {mount.part}))

    def _screw_ways(self, screw: Mount, standing: Blocks, own: Sequence[Vector]) -> tuple[Way, Way | None]:
        """The ways out of head and shank, along the driver, and of the nut: off the shank with what holds it, then on."""
        head, *nuts = self.scene.screw(screw, self.stage)
        axis = np.array(compose(self.stage.mount(screw), screw.accesses[0].pose))[:3, 2]
        way = way_out(head, standing, [vector(axis)], only_own=True)
        if not nuts:
            return way, None
        nut, off = together(nuts), vector(-axis * self.car.parts.tools.nut_room_mm.value)
        obstacle = hit(nut, standing, off)
        if obstacle is not None:
            return way, Way(None, ((vector(-axis), obstacle),))
        rest = way_out(nut.moved(translation(*off)), standing, own)
        return way, rest if rest.moves_mm is None else Way((off, *rest.moves_mm))

    def _name(self, added: Added) -> str:
        if added.kind == "unit" and added.name not in self.roles.wheel_units:
            return " with ".join(key[1] for key in self._keys(added)[:2])
        return added.body if added.kind == "unit" else added.name

    def _reach(self, place: str, reaches: Sequence[Reach], group: tuple[str, str]) -> None:
        """A finding for each access that is not free."""
        standing = together(self.standing[group].values()) if reaches else together(())
        for reach in reaches:
            access, room = self.scene.access(reach, self.stage)
            name = room.titles[0]
            # What is pressed or gripped gives way with the face that it hangs on: a tongue with flap and lever.
            own = {name}
            if reach.piece:
                creases = self.roles.pieces[reach.piece].creases
                own |= {title(reach.piece, c.parent.face) for c in creases if c.child.face == reach.name}
            obstacle = hit(room, standing, ignored=frozenset((name, one) for one in own))
            if obstacle is not None:
                self._find(place, f"{name} has no room for its {access.tool}: {obstacle} is in the way")

    def _swing(self, place: str, name: str, failure: str, path: Sequence[Mapping[str, float]]) -> None:
        """A finding if a piece, or what it carries, meets something while its folds take the fractions of ``path``."""
        stages = [self.stage.closed({name: one}) for one in path]
        first, last = stages[0], stages[-1]
        for standing in self.standing.values():
            keys = [key for key in standing if first.poses(key) != last.poses(key)]
            mine = [key for key in keys if key[:2] == ("piece", name)]
            faces: set[str] = set()
            for key in mine:
                ends = last.poses(key)
                faces |= {title(name, face) for face, pose in first.poses(key).items() if pose != ends[face]}
            still = [standing[key].where(faces, among=False) for key in mine]
            rest = together([*still, *(one for key, one in standing.items() if key not in keys)])
            start: Blocks | None = None
            for share, stage in zip(path, stages, strict=True):
                swung = [self.scene.solid(key, stage).where(faces) for key in mine]
                end = together([*swung, *(self.scene.solid(key, stage) for key in keys if key not in mine)])
                obstacle = None if start is None else swept(start, end, rest, self.joined)
                if obstacle is not None:
                    self._find(place, f"{failure}: {next(iter(share.values())):.0%} closed, it meets {obstacle}")
                    break
                start = end


def _closing(lid: Lid, angles_rad: Mapping[str, float]) -> Iterator[dict[str, float]]:
    """Fractions of the lid's folds while it closes: the flap is bent inwards first and is upright in the second half."""
    hinge, *flaps = lid.creases
    if not flaps:
        yield from ({hinge: i / SWING_STEPS} for i in range(SWING_STEPS + 1))
        return
    flap, *others = flaps
    whole = dict.fromkeys(others, 1.0)
    yield from ({hinge: 0.0, flap: i / SWING_STEPS, **whole} for i in range(SWING_STEPS))
    ratio = angles_rad[hinge] / angles_rad[flap]
    for i in range(SWING_STEPS + 1):
        closed = i / SWING_STEPS
        yield {hinge: closed, flap: 1.0 + ratio * min(closed, 1.0 - closed), **whole}


def _why(way: Way) -> str:
    if way.stuck:
        return f"does not fit: at its place it runs into {way.stuck}"
    met = []
    for move, what in way.met:
        axis = int(np.argmax(np.abs(move)))
        direction = "(" + ", ".join(f"{value:.2f}" for value in move) + ")"
        if abs(move[axis]) > 0.999:
            direction = f"{'+' if move[axis] > 0 else '-'}{'xyz'[axis]}"
        met.append(f"along {direction} it meets {what}")
    return "has no way out: " + ", ".join(met)


def assembly_steps(car: FoldedCar) -> tuple[AssemblyStep, ...]:
    """All steps from the cut pieces to the car with its lid shut."""
    return prove(car).steps


def service_steps(car: FoldedCar) -> tuple[AssemblyStep, ...]:
    """What is done to the finished car: plugs and buttons reached, the lid opened, the battery changed."""
    return prove(car).service
