"""Dynamic programs over carsim against Scenic's own simulation, in which the ego replays the same motion."""

import json
import math
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from scenic.core.distributions import RejectionException
from scenic.core.dynamics import GuardViolation, RejectSimulationException
from scenic.core.object_types import disableDynamicProxyFor, enableDynamicProxyFor
from scenic.core.simulators import Simulation
from scenic.core.vectors import Orientation, Vector

from foldcar.scenes.source import open_environment
from foldcar.simulation.carsim_step import State, SteppedCarsim
from foldcar.simulation.scenic_objects import ShownEgo
from foldcar.simulation.scenic_simulator import CarSimulator
from foldcar.simulation.scenic_statements import to_json
from study_car import car_texts

STEP_S = 1 / 240
# Looks of Scenic, their interval (s) and number. At every step of the simulator nothing can lie between two looks.
LOOKS = {"every 0.1 s": (0.1, 12), "every step": (STEP_S, 85)}

HEAD = """model model
ego = new Robot at (0, 0), facing -90 deg
post = new Marker at (0.3, 0.4), facing 30 deg
base = new Marker at (0.2, -0.4), facing 10 deg
goal = new Goal at (1.9, 0), facing -90 deg
"""
RECORDS = "record ego.position as ego_place\nrecord post.position as place\nrecord post.yaw as yaw\n"

PROGRAMS = {
    "terminate when": "terminate when ego.position.x > 0.1\nrecord final ego.position.x as x\n",
    "terminate after seconds": "terminate after 0.5 seconds\nrecord final ego.speed as v\n",
    "require always fails": "require always ego.position.x < 0.05\n",
    "require eventually, which holds after the ending": (
        "require eventually ego.position.x > 0.112\nterminate when ego.position.x > 0.1\n"
    ),
    "require until": "require ego.position.x < 0.05 until ego.position.x > 0.04\nterminate after 0.5 seconds\n",
    "require implies next": "require always (ego.position.x > 0.05 implies next ego.position.x > 0.06)\n",
    "a monitor ends": (
        "monitor M():\n    while ego.position.x < 0.1:\n        wait\n    terminate simulation\nrequire monitor M()\n"
    ),
    "a monitor over all objects": (
        "monitor M():\n    while True:\n        for thing in simulation().objects:\n"
        "            if thing is not ego and distance from ego to thing < 0.38:\n"
        "                terminate simulation\n        wait\nrequire monitor M()\n"
        "record len(simulation().objects) as count\n"
        "record [distance from ego to thing for thing in simulation().objects] as distances\n"
    ),
    "a monitor changes an object": (
        "monitor M():\n    while True:\n        post.yaw = post.yaw + 0.3\n        wait\nrequire monitor M()\n"
        "record post.heading as heading\nrecord post.orientation as orientation\nrecord post.left.position as left\n"
        "record post.front.position as front\nrecord distance from post to base as apart\n"
    ),
    "a behavior moves": (
        "behavior B():\n    while True:\n        self.position = self.position + (0.01 @ 0.02)\n"
        "        self.yaw = self.yaw - 0.1\n        wait\n"
        "moving = new Marker at (1, 1), with behavior B()\n"
        "record [moving.heading, moving.orientation, moving.right.position, moving.back.position] as derived\n"
        "record [distance from moving to ego, moving.distanceTo(ego.position)] as apart\n"
        "record moving.relativePosition((1, 0, 0)) as beside\nrecord moving.occupiedSpace.position as space\n"
    ),
    "changed before the simulation": (
        "post.position = 0.5 @ 0.5\npost.yaw = 2\npost.width = 0.3\nrecord post.orientation as orientation\n"
        "record post.right.position as right\nrecord post.radius as radius\nrecord initial post.heading as heading\n"
    ),
    "a derived property": (
        "class Own(Marker):\n    gap[dynamic, final]: self.position.x - 1\n    load[dynamic]: 3\n"
        "monitor M():\n    while True:\n        own.load = own.load + 1\n        own.position = own.position + (1 @ 0)\n"
        "        wait\nrequire monitor M()\nown = new Own at (1, 1)\nrecord [own.gap, own.load] as values\n"
    ),
    "do for and until": (
        "behavior Turn(angle):\n    while True:\n        self.yaw = self.yaw + angle\n        wait\n"
        "behavior B():\n    do Turn(0.1) for 0.25 seconds\n    do Turn(-0.3) for 2 steps\n"
        "    do Turn(0.01) until ego.position.x > 0.1\n    terminate simulation\n"
        "moving = new Marker at (1, 1), with behavior B()\nrecord moving.yaw as moved\n"
    ),
    "try and interrupt": (
        "behavior Turn(angle):\n    while True:\n        self.yaw = self.yaw + angle\n        wait\n"
        "behavior B():\n    try:\n        do Turn(0.1)\n    interrupt when ego.position.x > 0.05:\n"
        "        do Turn(-0.2) for 0.1 seconds\n        abort\n    interrupt when self.yaw > 9:\n        wait\n"
        "    terminate simulation\nmoving = new Marker at (1, 1), with behavior B()\nrecord moving.yaw as moved\n"
    ),
    "actions": (
        "from scenic.core.dynamics.actions import Action\n"
        "class Push(Action):\n    def applyTo(self, agent, simulation):\n"
        "        agent.position = agent.position + (0.01 @ 0)\n"
        "behavior B():\n    while True:\n        take Push()\n        wait\n        take Push(), Push()\n"
        "moving = new Marker at (1, 1), with behavior B()\nrecord moving.position as moved\n"
        "record len(moving.lastActions) as last\nrecord final len(simulation().agents) as agents\n"
    ),
    "compose": (
        "scenario Leg(far):\n    compose:\n        while ego.position.x < far:\n            wait\n"
        "scenario Main():\n    setup:\n        @\n    compose:\n        do Leg(0.03)\n        do Leg(9) for 0.1 seconds\n"
        "        do Leg(9) until ego.position.x > 0.1\n"
    ),
    "an invariant of the top": (
        "scenario Leg():\n    compose:\n        while True:\n            wait\n"
        "scenario Main():\n    invariant: ego.position.x < 0.05\n    setup:\n        @\n"
        "    compose:\n        do Leg()\n"
    ),
    "do choose": (
        "behavior Turn(angle):\n    precondition: angle > 0\n    self.yaw = self.yaw + angle\n    wait\n"
        "behavior B():\n    while True:\n        do choose {Turn(0.1): 1, Turn(0.2): 2, Turn(-1): 5}\n"
        "        do shuffle Turn(0.01), Turn(0.02)\n"
        "moving = new Marker at (1, 1), with behavior B()\nrecord moving.yaw as moved\n"
    ),
    "records of each kind": (
        "record initial post.position as begin\nrecord final post.position as end\nrecord ego.speed as speed\n"
        "record final ego.consumedEnergy as energy\nterminate when ego.speed > 0.3\n"
    ),
}  # fmt: skip
# Regions of the ground that the car enters and leaves, and what a program can do with them.
REGIONS = {
    "circle": "CircularRegion((0.1, 0.01), 0.03)",
    "rectangle": "RectangularRegion((0.1, 0), 20 deg, 0.06, 0.2)",
    "polygon": "PolygonalRegion([(0.07, 0.1), (0.09, -0.1), (0.13, 0)])",
}
USES = {
    "terminate": "terminate when ego.position in area\n",
    "terminate outside": "terminate simulation when ego.x > 0.1 and ego.position not in area\n",
    "records": "record ego.position in area as inside\nrecord final ego.position not in area as outside\n",
    "require always": "require always ego.position not in area\n",
    "require until": "require ego.position not in area until ego.position in area\nterminate after 0.5 seconds\n",
    "a monitor": (
        "monitor M():\n    while ego.position not in area:\n        wait\n    while ego.position in area:\n        wait\n"
        "    terminate simulation\nrequire monitor M()\n"
    ),
}
PROGRAMS |= {
    f"{use} with a {region}": f"area = {text}\n{statements}"
    for region, text in REGIONS.items()
    for use, statements in USES.items()
}


class Replay(Simulation):  # type: ignore[misc]
    """Scenic's simulation; the ego has the states of a list, one a time step, everything else what it was given."""

    def __init__(self, scene: Any, path: list[State], **options: Any) -> None:
        self.path = path
        super().__init__(scene, **options)

    def createObjectInSimulator(self, obj: Any) -> None:  # noqa: N802
        pass

    def step(self) -> None:
        pass

    def getProperties(self, obj: Any, properties: set[str]) -> dict[str, Any]:  # noqa: N802
        values = {name: getattr(obj, name) for name in properties}
        if obj is self.scene.egoObject:
            state = self.path[self.currentTime]
            cos, sin = math.cos(state.heading_rad), math.sin(state.heading_rad)
            values.update(
                position=Vector(state.x_m, state.y_m, state.z_m - self.path[0].z_m),
                yaw=state.heading_rad - math.pi / 2,
                pitch=state.pitch_rad,
                roll=state.roll_rad,
                speed=state.speed_m_s,
                velocity=Vector(state.speed_m_s * cos, state.speed_m_s * sin, 0),
                angularVelocity=Vector(0, 0, state.yaw_rate_rad_s),
                angularSpeed=abs(state.yaw_rate_rad_s),
                consumedEnergy=state.consumed_energy_j,
            )
        return values


@pytest.fixture(scope="module")
def stepped(carsim_binary: Path) -> Iterator[SteppedCarsim]:
    with SteppedCarsim([str(carsim_binary)]) as carsim:
        yield carsim


def text_of(name: str) -> str:
    body = PROGRAMS[name]
    if "@\n" not in body.replace(" @\n", "@\n") or "scenario Main" not in body:
        return HEAD + body + RECORDS
    model, *statements = (HEAD + RECORDS).splitlines()
    return f"{model}\n{body.replace('        @', chr(10).join('        ' + line for line in statements))}"


def outcome(make: Any) -> tuple[Any, dict[str, Any]]:
    """The simulation, and what it came to as plain data."""
    random.seed(5)
    try:
        simulation = make()
    except (RejectSimulationException, RejectionException, GuardViolation) as rejection:
        simulation, end = rejection.simulation, ["rejected", str(rejection)]
    except Exception as error:
        return None, {"end": [type(error).__name__, str(error)]}
    else:
        end = [simulation.result.terminationType.name, simulation.result.terminationReason]
    return simulation, {
        "end": end,
        "actions": [
            [
                [simulation.objects.index(agent), [type(action).__name__ for action in taken]]
                for agent, taken in step.items()
            ]
            for step in simulation.actionSequence
        ],
        "records": {name: to_json(value, name) for name, value in simulation.records.items()},
        "trajectory": to_json([[tuple(place) for place in places] for places in simulation.trajectory], "trajectory"),
    }


def alike(ours: Any, theirs: Any) -> bool:
    if isinstance(ours, list) and isinstance(theirs, list):
        return len(ours) == len(theirs) and all(map(alike, ours, theirs))
    if isinstance(ours, float | int) and isinstance(theirs, float | int):
        return math.isclose(ours, theirs, rel_tol=1e-9, abs_tol=1e-9)
    return bool(ours == theirs)


@pytest.mark.parametrize("name", PROGRAMS)
def test_programs_do_what_they_do_in_scenics_own_simulation(tmp_path: Path, stepped: SteppedCarsim, name: str) -> None:
    program = tmp_path / "program.scenic"
    program.write_text(text_of(name))
    source = open_environment(program, {}, 1)
    for step_s, most in LOOKS.values():
        if "holds after" in name and step_s > STEP_S:
            continue
        scene = source.scenic_scene(0)
        (body, settings), described = car_texts(), json.dumps(source.describe(scene, 0))
        path = [stepped.start(body, described, settings).state]
        path += [stepped.advance((k + 1) * step_s).state for k in range(most)]
        options: dict[str, Any] = {"maxSteps": most, "name": "run", "timestep": step_s}

        simulator = CarSimulator(stepped, body, settings, lambda _, text=described: text)
        run, shown = outcome(lambda simulator=simulator, scene=scene, o=options: simulator.createSimulation(scene, **o))
        other = source.scenic_scene(0)
        # Scenic leaves a scenario whose precondition is violated in the state of a running one.
        other.dynamicScenario._isRunning = False
        reference, expected = outcome(lambda other=other, path=path, o=options: Replay(other, path, **o))

        assert shown["end"] == expected["end"]
        if run is None:
            continue
        steps = run.currentTime
        assert math.ceil(steps - 1e-9) == reference.currentTime
        whole = abs(steps - reference.currentTime) < 1e-9
        assert whole or step_s > STEP_S
        assert shown["actions"] == expected["actions"]
        if not whole:
            # The moment of the ending lies before Scenic's last look: the last values are those of that moment.
            for result in (shown, expected):
                result["trajectory"].pop()
                result["records"] = {
                    key: value[:-1] if isinstance(value, list) and isinstance(value[0], list) else None
                    for key, value in result["records"].items()
                }
        assert list(shown["records"]) == list(expected["records"])
        for key, value in expected["records"].items():
            assert alike(shown["records"][key], value), (key, shown["records"][key], value)
        assert alike(shown["trajectory"], expected["trajectory"])


def test_the_ego_is_shown_as_scenic_would(tmp_path: Path) -> None:
    """What the comparison with Scenic's own simulation does not read: orientations, derived properties, caches."""
    program = tmp_path / "program.scenic"
    program.write_text(
        "model model\nbase = new Marker at (1, 1), facing 30 deg\n"
        "class Own(Robot):\n    double[dynamic, final]: 2 * self.position.x\n"
        "ego = new Own ahead of base by 0.5, with yaw 20 deg\nnew Goal at (9, 9)\n"
        "param course_x_max = 20, course_y_max = 20\n"
    )
    ego = open_environment(program, {}, 1).scenic_scene(0).egoObject
    assert set(ego._cache_clearers) >= {"left", "visibleRegion"}
    enableDynamicProxyFor(ego)
    before = ego.left.position
    state = State(1.0, 0.3, -0.2, 0.09, 2.5, 0.3, -0.4, 0.5, -0.6, 7.0)
    shown = ShownEgo(ego, state._replace(z_m=0.06))
    shown.show(state._replace(heading_rad=1.0, x_m=0.5))
    assert ego.orientation.approxEq(Orientation.fromEuler(1.0 - math.pi / 2, 0.3, -0.4), tol=1e-9)
    shown.show(state)

    expected = Orientation.fromEuler(2.5 - math.pi / 2, 0.3, -0.4)
    assert ego.orientation.approxEq(expected, tol=1e-9)
    own = ego.parentOrientation * Orientation.fromEuler(ego.yaw, ego.pitch, ego.roll)
    assert own.approxEq(expected, tol=1e-9)
    assert ego.heading == pytest.approx(2.5 - math.pi / 2)
    assert tuple(ego.position) == pytest.approx((0.3, -0.2, 0.03))
    assert ego.double == 0.6
    assert before != ego.left.position == ego.relativePosition((-ego.width / 2, 0, 0))
    disableDynamicProxyFor(ego)
    assert ego.consumedEnergy == 0
