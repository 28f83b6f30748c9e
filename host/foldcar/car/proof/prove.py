"""The proof that a car can be assembled: every part has an insertion path, every tool, plug and finger has clearance.

Input: a FoldedCar. Output: its steps with the insertion paths, and findings that name the step and the parts. Fixed film
bends, tongues snap, rims are wound, tyres stretched: for these no path is searched.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from foldcar.car.folded.model import FoldedCar, Mount
from foldcar.car.folded.placed import Finding
from foldcar.car.folded.pose import compose, translation
from foldcar.car.proof.blocks import (
    Blocks,
    ExitPath,
    find_exit_path,
    first_obstacle,
    merge_blocks,
    swept_obstacle,
    vector,
)
from foldcar.car.proof.plan import plan_assembly, plan_service
from foldcar.car.proof.roles import roles_of
from foldcar.car.proof.scene import CarSolids, Stage, title
from foldcar.car.proof.step import AddedPart, AssemblyStep, Folds, PartKey, ToolUse, Vector
from foldcar.car.proof.swing import even_path, lid_path, swing_of


class Group(NamedTuple):
    """Parts that are together: those in the car, or those of a unit of a body that is assembled outside the car."""

    unit: str = ""
    body: str = ""


CAR = Group()


@dataclass(frozen=True)
class Proof:
    """The steps of assembly and of service with their insertion paths, and the findings."""

    steps: tuple[AssemblyStep, ...]
    service: tuple[AssemblyStep, ...]
    findings: tuple[Finding, ...]


@lru_cache(maxsize=16)
def prove(car: FoldedCar) -> Proof:
    """Prove the planned assembly of a car."""
    return prove_steps(car, plan_assembly(car))


def prove_steps(car: FoldedCar, planned_steps: Sequence[AssemblyStep]) -> Proof:
    """Prove the assembly of a car in these steps."""
    prover = _Prover(car)
    prover.check_lead_order(planned_steps)
    steps = tuple(prover.prove_step(f"step {n}", step) for n, step in enumerate(planned_steps, 1))
    serviced = tuple(prover.prove_service(f"service {n}", step) for n, step in enumerate(plan_service(car), 1))
    return Proof(steps, serviced, tuple(prover.findings))


class ScrewPaths(NamedTuple):
    """The way out of a screw, and that of its nut, or None if it has no nut."""

    screw: ExitPath
    nut: ExitPath | None


class _Prover:
    """The state of the assembly, which is empty at first, and the findings.

    ``stage`` says which folds are closed. ``standing`` has, for each group, the parts that are in place with their
    solids at this stage. ``joined`` are the pairs of joined faces, which may overlap.
    """

    def __init__(self, car: FoldedCar) -> None:
        self.car, self.roles = car, roles_of(car)
        self.scene = CarSolids(self.roles)
        self.joined = self.scene.ignored()
        self.stage = Stage(self.roles, folds={})
        self.standing: dict[Group, dict[PartKey, Blocks]] = {CAR: {}}
        self.findings: list[Finding] = []

    def prove_step(self, number: str, step: AssemblyStep) -> AssemblyStep:
        """Carry out one step of the assembly, and return it with the insertion paths of its parts.

        ``number`` is the name of the step in findings, such as "step 3". First the folds of the step are closed. Then its
        parts are added one by one: to the car, or to the *unit* that the step assembles outside the car.
        """
        place = f"{number}, {step.title}"
        self._fold(place, step)
        parts_with_paths: list[AddedPart] = []
        for added in step.adds:
            group = Group(step.unit, added.body) if step.unit else CAR
            present = self.standing.setdefault(group, {})
            # The wheels of a unit are alike, so the first one is checked, and the others have its paths.
            is_repeated_wheel = step.unit in self.roles.wheel_units and added.body != step.adds[0].body
            needs_path = bool(present) and not self._is_bent(added)
            if is_repeated_wheel:
                parts_with_paths.append(self._like_first_wheel(step, added, parts_with_paths))
            elif needs_path:
                parts_with_paths.append(self._with_insertion_path(place, added, present))
            else:
                parts_with_paths.append(added)
            present.update({key: self._solid(key) for key in self._part_keys(added)})
            if not is_repeated_wheel:
                tool_uses = [use for use in step.tool_uses if use.name == added.name]
                self._check_tool_uses(place, tool_uses, group)
        return replace(step, adds=tuple(parts_with_paths))

    def _like_first_wheel(self, step: AssemblyStep, added: AddedPart, proved: Sequence[AddedPart]) -> AddedPart:
        """Return a part of a wheel with the insertion path of the same part of the first wheel, turned with the wheel."""
        first_body = step.adds[0].body
        first_parts = [part for part in proved if part.body == first_body]
        own_parts = [part for part in step.adds if part.body == added.body]
        first_part = first_parts[own_parts.index(added)]
        moves = tuple(self._rotated(move, first_body, added.body) for move in first_part.way_mm)
        return replace(added, way_mm=moves)

    def check_lead_order(self, planned_steps: Sequence[AssemblyStep]) -> None:
        """Add a finding if the leads of a battery on the lid are soldered too early: before they pass a hole of the lid.

        The leads are soldered to the switch and to wires. So these must be added in a later step than the battery, or in
        the same step.
        """
        parts = self.car.parts
        soldered_parts = (parts.switch.name, parts.wiring.name)
        soldered_names = [mount.name for mount in self.car.mounts if mount.part in soldered_parts]
        # The names of the soldered parts that were added in earlier steps.
        soldered_so_far: set[str] = set()
        for number, step in enumerate(planned_steps, 1):
            for added in step.adds:
                mount = self.roles.mounts.get(added.name)
                is_battery = mount is not None and mount.part == parts.battery.name and self.roles.is_on_lid(mount)
                if is_battery and soldered_so_far:
                    first = next(name for name in soldered_names if name in soldered_so_far)
                    message = f"leads of {added.name} must pass the lid, but are joined to {first} already"
                    self._add_finding(f"step {number}, {step.title}", message)
            soldered_so_far.update(added.name for added in step.adds if added.name in soldered_names)

    def prove_service(self, number: str, step: AssemblyStep) -> AssemblyStep:
        """Carry out one step of service on the finished car, and return it with the paths of its parts.

        Service is what a user does to a finished car, such as taking its battery out. ``step.adds`` are the parts that
        come out. A finding is noted if a tool does not reach a part, a lid does not open, or a part does not come out.
        It begins with ``number``, the number of the step. Parts that are taken out stay out in later steps.
        """
        place = f"{number}, {step.title}"
        self._check_tool_uses(place, step.tool_uses, CAR)
        # A lid opens on the same path on which it was shut, which is proved. But a part on the lid might now meet the
        # wheels, which were added after the lid was shut.
        if any(self.roles.is_on_lid(mount) for mount in self.car.mounts):
            for name in step.folds:
                self._check_lid(place, name, "open")
        self._set_folds(step.folds)
        parts_in_place = self.standing[CAR]
        removed_parts = []
        for removed in step.adds:
            for key in self._part_keys(removed):
                parts_in_place.pop(key, None)
            removed_parts.append(self._with_insertion_path(place, removed, parts_in_place))
        return replace(step, adds=tuple(removed_parts))

    def _add_finding(self, place: str, message: str) -> None:
        self.findings.append(Finding("assembly", place, message))

    def _rotated(self, move: Vector, first: str, other: str) -> Vector:
        """Return a move relative to the wheel ``first`` turned as the wheel ``other`` is."""
        a, b = (np.array(self.roles.placed(body)[0].pose)[:3, :3] for body in (first, other))
        return vector(b @ a.T @ np.array(move))

    def _fold(self, place: str, step: AssemblyStep) -> None:
        """Close the folds of a step. Add a finding if a face hits its own piece or other parts as it swings."""
        names_in_place: set[str] = set()
        for solids_by_part in self.standing.values():
            names_in_place.update(key.name for key in solids_by_part)
        for name, fractions in step.folds.items():
            # A step either closes the lid of a beam, or other folds.
            lid = self.roles.lids.get(name)
            closes_lid = lid is not None and bool(lid.creases) and set(lid.creases) == set(fractions)
            if closes_lid:
                self._check_lid(place, name, "shut")
            elif name in names_in_place:
                path = even_path(start=self.stage.folds.get(name, {}), end=fractions)
                self._check_swing(place, name, f"{name} does not fold", path)
        self._set_folds(step.folds)

    def _check_lid(self, place: str, name: str, action: str) -> None:
        """Add a finding if the lid of a beam, or a part on it, meets other parts on its way between open and shut."""
        angles = {crease.name: crease.angle_rad for crease in self.roles.pieces[name].creases}
        path = lid_path(self.roles.lids[name], angles)
        self._check_swing(place, name, f"the lid of {name} does not {action}", path)

    def _set_folds(self, folds: Folds) -> None:
        """Set the fractions by which folds are closed, and move all parts in place along with them."""
        if not folds:
            return
        self.stage = self.stage.closed(folds)
        for standing in self.standing.values():
            standing.update({key: self._solid(key) for key in standing})

    def _solid(self, key: PartKey) -> Blocks:
        return self.scene.solid(key, self.stage)

    def _part_keys(self, added: AddedPart) -> list[PartKey]:
        """Return the keys of a part, or of all parts of a unit."""
        if added.kind == "unit":
            return list(self.standing.get(Group(added.name, added.body), {}))
        return [PartKey(added.kind, added.name, added.copy)]

    def _is_bent(self, added: AddedPart) -> bool:
        """Return whether a part is laid out, wound or stretched, so that it has no straight insertion path."""
        if added.kind == "piece":
            return added.name in self.roles.beam_names or self.roles.is_wound(added.name)
        if added.kind == "unit":
            return False
        return self.roles.mounts[added.name].part in (self.car.parts.wiring.name, self.car.parts.tyre.name)

    def _with_insertion_path(self, place: str, added: AddedPart, present: Mapping[PartKey, Blocks]) -> AddedPart:
        """Return the part with its insertion path: its path out of the ``present`` parts, reversed.

        A board that is plugged onto another board, and a screw, may only move along their own axes. If there is no path
        out, a finding is added, and the insertion path stays empty.
        """
        mount = self.roles.mounts[added.name] if added.kind == "mount" else None
        if mount is not None and self.roles.is_fastener(mount):
            return self._with_screw_paths(place, added, mount, present)
        moving = merge_blocks(self._solid(key) for key in self._part_keys(added))
        standing = merge_blocks(present.values())
        if mount is None:
            exit_path = find_exit_path(moving, standing, ignored=self.joined)
        elif self._plugs_onto(mount, present):
            # Pins go straight into their sockets, along the part's z.
            exit_path = find_exit_path(moving, standing, _axes(mount, "z"), ignored=self.joined, only_own=True)
        else:
            exit_path = find_exit_path(moving, standing, _axes(mount), ignored=self.joined)
        return replace(added, way_mm=self._insertion_path(place, self._name(added), exit_path))

    def _with_screw_paths(
        self, place: str, added: AddedPart, screw: Mount, present: Mapping[PartKey, Blocks]
    ) -> AddedPart:
        """Return the screw with its insertion path, that of its nut, and the parts that its shank passes through.

        ``present`` are the parts that the car has before this step. A finding, which reports an error of the building
        plan, is added for each part around the shank that is not present yet, and for the screw or nut if it has no
        path. In the result, ``way_mm`` is the path of the screw and ``nut_mm`` that of the nut.
        """
        name, passed_parts = self._name(added), self.roles.passed_by(screw)
        exit_paths = self._screw_paths(screw, merge_blocks(present.values()))
        for key in passed_parts:
            if key not in present:
                self._add_finding(place, f"{name} passes {key.name}, which is not there yet")
        way_mm = self._insertion_path(place, name, exit_paths.screw)
        nut_mm: tuple[Vector, ...] = ()
        if exit_paths.nut is not None:
            nut_mm = self._insertion_path(place, f"the nut of {name}", exit_paths.nut)
        return replace(added, way_mm=way_mm, nut_mm=nut_mm, passes=passed_parts)

    def _insertion_path(self, place: str, name: str, exit_path: ExitPath) -> tuple[Vector, ...]:
        """Return a path out backwards. If there is none, add a finding and return no moves."""
        if exit_path.moves_mm is None:
            self._add_finding(place, f"{name} {_failure_message(exit_path)}")
            return ()
        return tuple(vector(-np.array(move)) for move in reversed(exit_path.moves_mm))

    def _plugs_onto(self, mount: Mount, present: Mapping[PartKey, Blocks]) -> bool:
        """Return whether a mount is a board that is plugged onto a board in place, header on header."""
        boards = self.roles.board_names
        names = {self.roles.mounts[name].part for kind, name, _ in present if kind == "mount"}
        return mount.part in boards and bool(names & (boards - {mount.part}))

    def _screw_paths(self, screw: Mount, standing: Blocks) -> ScrewPaths:
        """Return the paths on which a screw and its nut, if it has one, come out of the ``standing`` parts.

        The screw can only move straight towards its screwdriver.
        """
        head_and_shank, *nuts = self.scene.screw(screw, self.stage)
        # The screwdriver lies along z of its own frame. The third column of its pose has this direction in the car's
        # frame.
        driver_pose = np.array(compose(self.stage.mount(screw), screw.clearances[0].pose))
        towards_driver = driver_pose[:3, 2]
        screw_path = find_exit_path(head_and_shank, standing, [vector(towards_driver)], only_own=True)
        nut_path = self._nut_path(screw, merge_blocks(nuts), standing, vector(-towards_driver)) if nuts else None
        return ScrewPaths(screw_path, nut_path)

    def _nut_path(self, screw: Mount, nut: Blocks, standing: Blocks, along_shank: Vector) -> ExitPath:
        """Return the path on which a nut comes out of the car, past the ``standing`` parts, which do not move.

        First the nut moves straight off the screw's shank, in the direction ``along_shank``. From there it may take any
        path out. ``moves_mm`` of the result is None if there is no path.
        """
        off_shank_mm = vector(np.array(along_shank) * self.car.parts.tools.nut_room_mm.value)
        obstacle = first_obstacle(nut, standing, off_shank_mm)
        if obstacle is not None:
            return ExitPath(moves_mm=None, obstacles=((along_shank, obstacle),))
        nut_off_shank = nut.moved(translation(*off_shank_mm))
        further_path = find_exit_path(nut_off_shank, standing, _axes(screw))
        if further_path.moves_mm is None:
            return further_path
        return ExitPath(moves_mm=(off_shank_mm, *further_path.moves_mm))

    def _name(self, added: AddedPart) -> str:
        """Return the name of a part or unit in findings; a unit of the body is named by its first two parts."""
        if added.kind != "unit":
            return added.name
        if added.name in self.roles.wheel_units:
            return added.body
        return " with ".join(key.name for key in self._part_keys(added)[:2])

    def _check_tool_uses(self, place: str, tool_uses: Sequence[ToolUse], group: Group) -> None:
        """Add a finding for each tool whose clearance is obstructed by parts of ``group`` that are in place."""
        if not tool_uses:
            return
        standing = merge_blocks(self.standing[group].values())
        for tool_use in tool_uses:
            # The space that the tool needs is a cylinder, whose title is the name of the part or face that the tool
            # reaches.
            clearance, cylinder = self.scene.clearance(tool_use, self.stage)
            reached = cylinder.titles[0]
            touchable = [reached, *self._carriers_of_lever(tool_use)]
            ignored = frozenset((reached, touched) for touched in touchable)
            obstacle = first_obstacle(cylinder, standing, ignored=ignored)
            if obstacle is not None:
                self._add_finding(place, f"{reached} has no room for its {clearance.tool}: {obstacle} is in the way")

    def _carriers_of_lever(self, tool_use: ToolUse) -> list[str]:
        """Return the titles of the faces on which the face hangs that a finger pushes; none for a tool at a mount.

        A finger pushes the lever of a latch. The face on which the lever hangs moves with it, so it is no obstacle.
        """
        if not tool_use.piece:
            return []
        creases = self.roles.pieces[tool_use.piece].creases
        return [title(tool_use.piece, crease.parent.face) for crease in creases if crease.child.face == tool_use.name]

    def _check_swing(self, place: str, name: str, failure: str, path: Iterable[Mapping[str, float]]) -> None:
        """Add a finding if faces of a piece, or parts on them, meet others while the piece ``name`` folds.

        ``path`` says how far each crease is closed, in small steps from the beginning to the end. From each position to
        the next, the moving faces and parts must not meet anything that stands still. ``failure`` is the beginning of
        the finding's message.
        """
        fractions_by_position = list(path)
        stages = [self.stage.closed({name: fractions}) for fractions in fractions_by_position]
        # The parts in the car, and those in units outside the car, cannot meet each other.
        for standing in self.standing.values():
            swing = swing_of(name, first=stages[0], last=stages[-1], standing=standing)
            previous: Blocks | None = None
            for fractions, stage in zip(fractions_by_position, stages, strict=True):
                # What moves, at this position.
                faces = [self.scene.solid(key, stage).with_titles(swing.moving_faces) for key in swing.copies]
                parts = [self.scene.solid(key, stage) for key in swing.carried]
                current = merge_blocks([*faces, *parts])
                obstacle: str | None = None
                if previous is not None:
                    obstacle = swept_obstacle(previous, current, swing.obstacles, self.joined)
                if obstacle is not None:
                    closed = 100 * next(iter(fractions.values()))
                    self._add_finding(place, f"{failure}: {closed:.0f} % closed, it meets {obstacle}")
                    break
                previous = current


def _axes(mount: Mount, names: str = "xyz") -> list[Vector]:
    """Return both directions of the named axes of a part's own frame, in the car's frame: +x, -x, +y and so on."""
    directions = []
    for name in names:
        axis = np.array(mount.pose)[:3, "xyz".index(name)]
        directions += [vector(axis), vector(-axis)]
    return directions


def _failure_message(path: ExitPath) -> str:
    """Return why a part does not come out, or what it meets in each direction."""
    if path.overlapped:
        return f"does not fit: at its place it runs into {path.overlapped}"
    obstacles = []
    for move, obstacle in path.obstacles:
        axis = int(np.argmax(np.abs(move)))
        direction = "(" + ", ".join(f"{value:.2f}" for value in move) + ")"
        if abs(move[axis]) > 0.999:
            direction = f"{'+' if move[axis] > 0 else '-'}{'xyz'[axis]}"
        obstacles.append(f"along {direction} it meets {obstacle}")
    return "has no way out: " + ", ".join(obstacles)


def assembly_steps(car: FoldedCar) -> tuple[AssemblyStep, ...]:
    """Return all steps from the cut pieces to the car with its lid shut."""
    return prove(car).steps


def service_steps(car: FoldedCar) -> tuple[AssemblyStep, ...]:
    """Return the steps of service: plugs and buttons are reached, the lid is opened, and the battery is changed."""
    return prove(car).service
