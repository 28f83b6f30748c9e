"""The proof that a car can be assembled: every part has an insertion path, every tool, plug and finger has clearance.

Input: a FoldedCar. Output: its steps with the insertion paths, and findings that name the step and the parts. Fixed film
bends, tongues snap, rims are wound, tyres stretched: for these no path is searched.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

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
from foldcar.car.proof.roles import Lid, roles_of
from foldcar.car.proof.scene import CarSolids, Stage, title
from foldcar.car.proof.step import AddedPart, AssemblyStep, Folds, PartKey, ToolUse, Vector

CAR = ("", "")
# Steps of a lid's turn: film 100 mm from the fold leaves the convex hull of two successive positions by 0.02 mm only.
SWING_STEPS = 40


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
    steps = tuple(prover.step(f"step {n}", step) for n, step in enumerate(planned_steps, 1))
    serviced = tuple(prover.service_step(f"service {n}", step) for n, step in enumerate(plan_service(car), 1))
    return Proof(steps, serviced, tuple(prover.findings))


class _Prover:
    """The state of the assembly: the solids that are in place."""

    def __init__(self, car: FoldedCar) -> None:
        self.car, self.roles = car, roles_of(car)
        self.scene = CarSolids(self.roles)
        self.joined = self.scene.ignored()
        self.stage = Stage(self.roles, {})
        # Solids in the car (CAR), and in units by the unit's name and body.
        self.standing: dict[tuple[str, str], dict[PartKey, Blocks]] = {CAR: {}}
        self.findings: list[Finding] = []

    def step(self, number: str, step: AssemblyStep) -> AssemblyStep:
        """Prove one step, carry it out, and return it with the insertion paths of its parts.

        Findings name it by ``number``.
        """
        place = f"{number}, {step.title}"
        self._fold(place, step)
        proved: list[AddedPart] = []
        for added in step.adds:
            group = (step.unit, added.body) if step.unit else CAR
            first_body = step.adds[0].body
            if step.unit in self.roles.wheel_units and added.body != first_body:
                # Wheels are alike: the insertion path is that of the first wheel's part, turned with the wheel.
                own_adds = [add for add in step.adds if add.body == added.body]
                first_part = [earlier for earlier in proved if earlier.body == first_body][own_adds.index(added)]
                moves = tuple(self._rotated(move, first_body, added.body) for move in first_part.way_mm)
                proved_part = replace(added, way_mm=moves)
            else:
                proved_part, present = added, self.standing.get(group, {})
                if present and not self._is_bent(added):
                    proved_part = self._with_insertion_path(place, added, present)
            self.standing.setdefault(group, {}).update({key: self._solid(key) for key in self._part_keys(added)})
            if proved_part.body == first_body or step.unit not in self.roles.wheel_units:
                self._check_tool_uses(place, [use for use in step.tool_uses if use.name == added.name], group)
            proved.append(proved_part)
        return replace(step, adds=tuple(proved))

    def check_lead_order(self, planned_steps: Sequence[AssemblyStep]) -> None:
        """Add a finding if the leads of a battery on the lid are soldered before they pass through the lid.

        The leads are soldered to the switch and to wires, so these must be added after the battery.
        """
        numbers = {added.name: n for n, step in enumerate(planned_steps, 1) for added in step.adds}
        parts = self.car.parts
        soldered = [m for m in self.car.mounts if m.part in (parts.switch.name, parts.wiring.name) and m.name in numbers]
        for mount in (m for m in self.car.mounts if m.name in numbers and self.roles.is_on_lid(m)):
            soldered_before = [m.name for m in soldered if numbers[m.name] < numbers[mount.name]]
            if mount.part == parts.battery.name and soldered_before:
                place = f"step {numbers[mount.name]}, {planned_steps[numbers[mount.name] - 1].title}"
                message = f"leads of {mount.name} must pass the lid, but are joined to {soldered_before[0]} already"
                self._add_finding(place, message)

    def service_step(self, number: str, step: AssemblyStep) -> AssemblyStep:
        """Prove one step of service, and return it with the paths of its parts.

        Tools must reach what they use, folds must open, and parts must come out; parts that are taken out stay out. A
        lid opens on the path on which it was shut. If a part is on the lid, this is checked again, because the wheels
        were added after the lid was shut.
        """
        place = f"{number}, {step.title}"
        self._check_tool_uses(place, step.tool_uses, CAR)
        if any(self.roles.is_on_lid(mount) for mount in self.car.mounts):
            for name in step.folds:
                self._check_lid(place, name, "open")
        self._close(step.folds)
        proved = []
        for added in step.adds:
            for key in self._part_keys(added):
                self.standing[CAR].pop(key, None)
            proved.append(self._with_insertion_path(place, added, self.standing[CAR]))
        return replace(step, adds=tuple(proved))

    def _add_finding(self, place: str, message: str) -> None:
        self.findings.append(Finding("assembly", place, message))

    def _rotated(self, move: Vector, first: str, other: str) -> Vector:
        """Return a move relative to the wheel ``first`` turned as the wheel ``other`` is."""
        a, b = (np.array(self.roles.placed(body)[0].pose)[:3, :3] for body in (first, other))
        return vector(b @ a.T @ np.array(move))

    def _fold(self, place: str, step: AssemblyStep) -> None:
        """Close the folds of a step. Add a finding if a face that swings meets its own piece or other parts in place."""
        for name, fractions in step.folds.items():
            earlier_fractions = self.stage.folds.get(name, {})
            lid = self.roles.lids.get(name)
            if lid is not None and lid.creases and set(fractions) == set(lid.creases):
                self._check_lid(place, name, "shut")
            elif any(key[1] == name for standing in self.standing.values() for key in standing):
                path = [
                    {crease: earlier_fractions.get(crease, 0.0) * (1 - t) + end * t for crease, end in fractions.items()}
                    for t in (i / SWING_STEPS for i in range(SWING_STEPS + 1))
                ]
                self._check_swing(place, name, f"{name} does not fold", path)
        self._close(step.folds)

    def _check_lid(self, place: str, name: str, action: str) -> None:
        """Add a finding if the lid of a beam, or a part on it, meets other parts on its way between open and shut."""
        angles = {crease.name: crease.angle_rad for crease in self.roles.pieces[name].creases}
        path = list(_closing(self.roles.lids[name], angles))
        self._check_swing(place, name, f"the lid of {name} does not {action}", path)

    def _close(self, folds: Folds) -> None:
        if not folds:
            return
        self.stage = self.stage.closed(folds)
        for standing in self.standing.values():
            standing.update({key: self._solid(key) for key in standing})

    def _solid(self, key: PartKey) -> Blocks:
        return self.scene.solid(key, self.stage)

    def _part_keys(self, added: AddedPart) -> list[PartKey]:
        if added.kind == "unit":
            return list(self.standing.get((added.name, added.body), {}))
        return [(added.kind, added.name, added.copy)]

    def _is_bent(self, added: AddedPart) -> bool:
        """Return whether a part is laid out, wound or stretched, so that it has no straight insertion path."""
        if added.kind == "piece":
            return added.name in self.roles.bases or self.roles.is_wound(added.name)
        if added.kind == "unit":
            return False
        return self.roles.mounts[added.name].part in (self.car.parts.wiring.name, self.car.parts.tyre.name)

    def _with_insertion_path(self, place: str, added: AddedPart, present: Mapping[PartKey, Blocks]) -> AddedPart:
        """Return the part with its insertion path, which is its path out of the ``present`` parts, backwards.

        The nut of a screw has a path of its own. If there is no path out, a finding is added, and the path stays
        empty.
        """
        moving = merge_blocks(self._solid(key) for key in self._part_keys(added))
        standing = merge_blocks(present.values())
        own_axes: list[Vector] = []
        mount = self.roles.mounts[added.name] if added.kind == "mount" else None
        if mount is not None:
            # The columns of the rotation are the part's axes in the car: +x, -x, +y, -y, +z, -z.
            axes = np.array(mount.pose)[:3, :3].T
            own_axes = [vector(sign * axis) for axis in axes for sign in (1.0, -1.0)]
        nut_path: ExitPath | None = None
        if mount is not None and self.roles.is_fastener(mount):
            exit_path, nut_path = self._screw_ways(mount, standing, own_axes)
            added = replace(added, passes=self.roles.passed_by(mount))
            for _, missing_name, _ in (key for key in added.passes if key not in present):
                self._add_finding(place, f"{self._name(added)} passes {missing_name}, which is not there yet")
        elif mount is not None and self._plugs_onto(mount, present):
            # Pins go straight into their sockets, along the part's +z or -z.
            exit_path = find_exit_path(moving, standing, own_axes[4:], self.joined, only_own=True)
        else:
            exit_path = find_exit_path(moving, standing, own_axes, self.joined)
        # The paths of the part and of its nut, each backwards; empty for a part without a nut.
        insertion_paths = []
        for subject, path in (("", exit_path), ("the nut of ", nut_path)):
            if path is not None and path.moves_mm is None:
                self._add_finding(place, f"{subject}{self._name(added)} {_failure_message(path)}")
            moves = (path.moves_mm or ()) if path is not None else ()
            insertion_paths.append(tuple(vector(-np.array(move)) for move in reversed(moves)))
        return replace(added, way_mm=insertion_paths[0], nut_mm=insertion_paths[1])

    def _plugs_onto(self, mount: Mount, present: Mapping[PartKey, Blocks]) -> bool:
        """Return whether a mount is a board that is plugged onto a board in place, header on header."""
        boards = self.roles.board_names
        names = {self.roles.mounts[name].part for kind, name, _ in present if kind == "mount"}
        return mount.part in boards and bool(names & (boards - {mount.part}))

    def _screw_ways(self, screw: Mount, standing: Blocks, own_axes: Sequence[Vector]) -> tuple[ExitPath, ExitPath | None]:
        """Return how a screw comes out along the axis of the driver, and how its nut comes out, if it has one.

        The nut moves along the axis until it is off the shank. Then it may take any path out.
        """
        head, *nuts = self.scene.screw(screw, self.stage)
        axis = np.array(compose(self.stage.mount(screw), screw.clearances[0].pose))[:3, 2]
        screw_path = find_exit_path(head, standing, [vector(axis)], only_own=True)
        if not nuts:
            return screw_path, None
        nut, nut_clearance = merge_blocks(nuts), vector(-axis * self.car.parts.tools.nut_room_mm.value)
        obstacle = first_obstacle(nut, standing, nut_clearance)
        if obstacle is not None:
            return screw_path, ExitPath(None, ((vector(-axis), obstacle),))
        rest = find_exit_path(nut.moved(translation(*nut_clearance)), standing, own_axes)
        return screw_path, rest if rest.moves_mm is None else ExitPath((nut_clearance, *rest.moves_mm))

    def _name(self, added: AddedPart) -> str:
        if added.kind == "unit" and added.name not in self.roles.wheel_units:
            return " with ".join(key[1] for key in self._part_keys(added)[:2])
        return added.body if added.kind == "unit" else added.name

    def _check_tool_uses(self, place: str, tool_uses: Sequence[ToolUse], group: tuple[str, str]) -> None:
        """Add a finding for each tool whose clearance is obstructed by parts of ``group`` that are in place."""
        standing = merge_blocks(self.standing[group].values()) if tool_uses else merge_blocks(())
        for tool_use in tool_uses:
            clearance, clearance_blocks = self.scene.clearance(tool_use, self.stage)
            name = clearance_blocks.titles[0]
            # A pressed tongue moves together with its flap and its lever (the face that it hangs on), so these do not
            # obstruct the tool.
            own_faces = {name}
            if tool_use.piece:
                creases = self.roles.pieces[tool_use.piece].creases
                own_faces |= {title(tool_use.piece, c.parent.face) for c in creases if c.child.face == tool_use.name}
            obstacle = first_obstacle(
                clearance_blocks, standing, ignored=frozenset((name, face_title) for face_title in own_faces)
            )
            if obstacle is not None:
                self._add_finding(place, f"{name} has no room for its {clearance.tool}: {obstacle} is in the way")

    def _check_swing(self, place: str, name: str, failure: str, path: Sequence[Mapping[str, float]]) -> None:
        """Add a finding if faces of a piece, or parts on them, meet others while its creases close along ``path``.

        ``path`` has the closed fraction of each crease, step by step. The solids that are swept from one step to the
        next must be free of all that stands still.
        """
        stages = [self.stage.closed({name: fractions}) for fractions in path]
        first, last = stages[0], stages[-1]
        for standing in self.standing.values():
            keys = [key for key in standing if first.poses(key) != last.poses(key)]
            piece_keys = [key for key in keys if key[:2] == ("piece", name)]
            faces: set[str] = set()
            for key in piece_keys:
                last_poses = last.poses(key)
                faces |= {title(name, face) for face, pose in first.poses(key).items() if pose != last_poses[face]}
            still_faces = [standing[key].without_titles(faces) for key in piece_keys]
            obstacles = merge_blocks([*still_faces, *(blocks for key, blocks in standing.items() if key not in keys)])
            start: Blocks | None = None
            for fractions_of_creases, stage in zip(path, stages, strict=True):
                swinging_faces = [self.scene.solid(key, stage).with_titles(faces) for key in piece_keys]
                end = merge_blocks(
                    [*swinging_faces, *(self.scene.solid(key, stage) for key in keys if key not in piece_keys)]
                )
                obstacle = None if start is None else swept_obstacle(start, end, obstacles, self.joined)
                if obstacle is not None:
                    closed = 100 * next(iter(fractions_of_creases.values()))
                    self._add_finding(place, f"{failure}: {closed:.0f} % closed, it meets {obstacle}")
                    break
                start = end


def _closing(lid: Lid, angles_rad: Mapping[str, float]) -> Iterator[dict[str, float]]:
    """Yield how far the folds of a lid are closed, step by step, while it shuts: fractions by crease.

    First the flap is bent inwards. Over the first half of the way, while the lid turns down, the flap is bent
    further, by the angle of the lid. Over the second half it is bent back until it is upright. So it passes the wall.
    """
    hinge, *flaps = lid.creases
    if not flaps:
        yield from ({hinge: i / SWING_STEPS} for i in range(SWING_STEPS + 1))
        return
    flap, *others = flaps
    all_fractions = dict.fromkeys(others, 1.0)
    yield from ({hinge: 0.0, flap: i / SWING_STEPS, **all_fractions} for i in range(SWING_STEPS))
    ratio = angles_rad[hinge] / angles_rad[flap]
    for i in range(SWING_STEPS + 1):
        closed = i / SWING_STEPS
        yield {hinge: closed, flap: 1.0 + ratio * min(closed, 1.0 - closed), **all_fractions}


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
