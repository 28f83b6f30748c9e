"""Scenic's own simulations over `carsim step`: any program's records, conditions, monitors and requirements work.

Input: a car (body and settings of docs/carsim.md), then Scenic scenes. Output: Scenic's Simulation objects, or the
result of a run with what the program recorded. Scenic looks at the simulation once an outer step of
`param outer_step_s`; stops are traced back to the 1/240 s at which they happened.

For people who script with Scenic: ``CarSimulator(...).simulate(scene)`` is Scenic's own interface, and
``CarSimulator(...).run(scene)`` gives the result that a sweep stores.
"""

import math
from collections.abc import Callable, Collection
from typing import Any

from scenic.core.distributions import RejectionException
from scenic.core.dynamics import GuardViolation, RejectSimulationException
from scenic.core.requirements import RequirementType
from scenic.core.simulators import Simulation, SimulationCreationError, Simulator

from foldcar.errors import FoldcarError
from foldcar.scenes.success import VERDICT
from foldcar.simulation.carsim_step import State, SteppedTrial
from foldcar.simulation.recorded_values import to_json
from foldcar.simulation.scenic_ego import ShownEgo

OUTER_STEP_S = 0.25
OUTER_STEP_LIMITS_S = (1 / 240, 60.0)

Result = dict[str, Any]


class CarSimulator(Simulator):  # type: ignore[misc]
    """Simulates one car in any number of scenes, one at a time.

    ``body`` and ``settings`` are JSON texts as docs/carsim.md describes them, without ids; ``describe`` turns a
    Scenic scene into the text of carsim's scene. ``passing`` are the conditions, as Scenic names them, that end a run
    that has passed (``SceneSource.success.endings``).
    """

    def __init__(
        self,
        carsim: SteppedTrial,
        body: str,
        settings: str,
        describe: Callable[[Any], str],
        passing: Collection[str] = (),
    ) -> None:
        super().__init__()
        self._carsim = carsim
        self._body = body
        self._settings = settings
        self._describe = describe
        self._passing = frozenset(passing)

    def createSimulation(self, scene: Any, *, timestep: float | None, **options: Any) -> "CarSimulation":  # noqa: N802
        """Scenic's hook: run one simulation. ``timestep`` (s) takes precedence over the program's own."""
        if timestep is None:
            timestep = scene.params.get("outer_step_s", OUTER_STEP_S)
        scene_text = self._describe(scene)

        def start() -> Any:
            return self._carsim.start(self._body, scene_text, self._settings)

        return CarSimulation(scene, carsim=self._carsim, start=start, timestep=_outer_step(timestep), **options)

    def run(self, scene: Any) -> Result:
        """One run's result as carsim gives it, with ``recorded`` and two more outcomes.

        ``terminated``: the program ended the run. ``rejected``: it violated a requirement while it ran. Recorded
        values are {"kind": "initial"|"final"|"series", "value": JSON}. Raises FoldcarError for what cannot be
        stored, and whatever the program raises.
        """
        try:
            simulation = self.createSimulation(
                scene, maxSteps=None, name="run", timestep=None, enableReplay=False
            )
        except (RejectSimulationException, RejectionException, GuardViolation) as rejection:
            _refuse_misplaced(scene.dynamicScenario)
            return _result(rejection.simulation, "rejected")
        ended_itself = simulation.run_result is not None and simulation.run_result["outcome"] == "terminated"
        if ended_itself and self._has_passed(simulation):
            return _result(simulation, "passed")
        return _result(simulation, None)

    def _has_passed(self, simulation: "CarSimulation") -> bool:
        """Whether a run that the program ended has passed. A car that is not upright has been ended by carsim before."""
        verdict = simulation.recorded.get(VERDICT, {"kind": "initial"})
        if verdict["kind"] == "final":
            return bool(verdict["value"])
        if verdict["kind"] == "series":
            return bool(verdict["value"] and verdict["value"][-1][1])
        return simulation.result.terminationReason in self._passing


class CarSimulation(Simulation):  # type: ignore[misc]
    """One trial. As with every Scenic simulation, making the object runs it.

    ``run_result`` is carsim's result, its outcome "terminated" if Scenic ended the trial; ``recorded`` what the
    program recorded, as plain JSON.
    """

    def __init__(
        self, scene: Any, *, carsim: SteppedTrial, start: Callable[[], Any], timestep: float, **options: Any
    ) -> None:
        self.run_result: Result | None = None
        self.recorded: dict[str, dict[str, Any]] = {}
        self._carsim = carsim
        self._start_trial = start
        self._state: State | None = None
        self._native: Result | None = None
        self._row: int | None = None  # of the last advance, if it is not its end that is shown
        self._steps: float = 0
        self._ending: Any = None  # the condition of the program that holds in the state that is shown
        super().__init__(scene, timestep=timestep, **options)
        # Known only now: records are evaluated after the simulation's end.
        for name, value in self.result.records.items():
            if name not in self.recorded:
                self.recorded[name] = {"kind": "final", "value": to_json(value, name)}

    @property
    def currentTime(self) -> float:  # noqa: N802
        """Outer steps since the start; not a whole number where a stop was traced back."""
        return self._steps

    @currentTime.setter
    def currentTime(self, steps: float) -> None:  # noqa: N802
        """Scenic counts its steps, but the trial's own clock is what tells the time."""

    @property
    def currentRealTime(self) -> float:  # noqa: N802
        """Seconds since the start of the trial."""
        return 0.0 if self._state is None else self._state.t_s

    def setup(self) -> None:
        """Put the car down and register what can change: the ego, and what has a behavior or senses."""
        self.agents: list[Any] = []
        scenario = self.scene.dynamicScenario
        # Scenic leaves those that were running when the last simulation was ended from outside.
        scenario._subScenarios = []
        advanced = self._start_trial()
        ego = self.scene.egoObject
        for thing in self.scene.objects:
            if thing is ego or thing.behavior or thing.sensors:
                self._createObject(thing)
        self._ego = ShownEgo(ego, advanced.state)
        self._native = advanced.result
        self._show(advanced.state, 0)
        self._conditions = tuple(scenario._terminationConditions)
        self._simulation_conditions = tuple(scenario._terminateSimulationConditions)
        scenario._terminateSimulationConditions = (*self._simulation_conditions, _NativeEnding(self))
        if self._conditions and scenario._compose is None:
            # Nothing runs between `step` and Scenic's own check, which would only repeat the evaluation.
            self._ending = self._program_ending()
            scenario._terminationConditions = (_ProgramEnding(self),)

    def createObjectInSimulator(self, obj: Any) -> None:  # noqa: N802
        """Scenic's hook. What the car meets is baked when it is put down, so only Markers can come later."""
        kinds = {ancestor.__name__ for ancestor in type(obj).__mro__}
        if self._state is not None and ("Marker" not in kinds or "Goal" in kinds):
            raise SimulationCreationError(
                f"a {type(obj).__name__} is created while the car drives: the world has to stand before, "
                "in the program itself or in its top-level `setup`"
            )

    def step(self) -> None:
        """Advance to the end of the outer step, or to the moment within it at which the program ends the run."""
        assert self._state is not None
        begun_s, begun_steps = self._state.t_s, self._steps
        to_s = (begun_steps + 1) * self.timestep
        limit_s = self._time_limit_s()
        advanced = self._carsim.advance(min(to_s, limit_s))
        self._native = advanced.result

        def show(state: State) -> None:
            whole = state is advanced.state and advanced.result is None and to_s <= limit_s
            self._show(state, begun_steps + (1 if whole else (state.t_s - begun_s) / self.timestep))

        show(advanced.state)
        self._ending = self._program_ending()
        if self._ending is None:
            return
        for row, state in enumerate(self._carsim.rows()[:-1]):
            show(state)
            ending = self._program_ending()
            if ending is not None:
                self._ending, self._native, self._row = ending, None, row
                return
        show(advanced.state)

    def updateObjects(self) -> None:  # noqa: N802
        """Nothing but the ego moves, and it is up to date; the first call comes when limits are known in steps."""
        scenario = self.scene.dynamicScenario
        if self._steps == 0 and scenario._timeLimitInSteps is not None:
            # 1.1 s in steps of 0.1 s is a little more than 11 steps in floating-point numbers.
            scenario._timeLimitInSteps = round(scenario._timeLimitInSteps, 9)

    def getProperties(self, obj: Any, properties: set[str]) -> dict[str, Any]:  # noqa: N802
        """Scenic's hook: the values that `updateObjects` has set."""
        return {name: getattr(obj, name) for name in properties}

    def recordCurrentState(self) -> None:  # noqa: N802
        """Evaluate the program's records, and keep each value as it is now."""
        scenario = self.scene.dynamicScenario
        _refuse_misplaced(scenario)
        if self.currentTime == 0:
            for name, value in scenario._evaluateRecordedExprs(RequirementType.recordInitial, 0).items():
                self.records[name] = value
                self.recorded[name] = {"kind": "initial", "value": to_json(value, name)}
        values = scenario._evaluateRecordedExprs(RequirementType.record, self.currentTime)
        for name, value in values.items():
            self.records[name].append((self.currentTime, value))
            series = self.recorded.setdefault(name, {"kind": "series", "value": []})
            series["value"].append([self.currentRealTime, to_json(value, name)])
        self.trajectory.append(self.currentState())

    def currentState(self) -> tuple[Any, ...]:  # noqa: N802
        """Scenic's hook: the positions of all that moves."""
        return (self._ego.position,)

    def destroy(self) -> None:
        """Scenic's hook: called in any case once the simulation is over."""
        if self._state is None or not self._carsim.alive:
            return
        if self._native is not None:
            self.run_result = self._native
        else:
            row = self._row if self._row is not None else len(self._carsim.rows()) - 1
            self.run_result = self._carsim.end(row)

    def _show(self, state: State, steps: float) -> None:
        self._state, self._steps = state, steps
        self._ego.show(state)

    def _program_ending(self) -> Any:
        """The condition of the top-level scenario that ends the run in the state that is shown, or None."""
        for condition in self._conditions:
            if condition.evaluate():
                return condition
        for condition in self._simulation_conditions:
            if condition.isTrue().is_truthy:
                return condition
        return None

    def _time_limit_s(self) -> float:
        """The top-level scenario's `terminate after`, which may lie within an outer step."""
        scenario = self.scene.dynamicScenario
        if scenario._timeLimit is None:
            return math.inf
        unit_s = 1.0 if scenario._timeLimitIsInSeconds else self.timestep
        return float(scenario._timeLimit * unit_s)


class _ProgramEnding:
    """The program's `terminate when` conditions, as the simulation has evaluated them for the shown state."""

    def __init__(self, simulation: CarSimulation) -> None:
        self._simulation = simulation

    def evaluate(self) -> bool:
        return self._simulation._ending in self._simulation._conditions

    def __str__(self) -> str:
        return str(self._simulation._ending)


class _NativeEnding:
    """A `terminate simulation when` that holds once carsim has ended the trial."""

    def __init__(self, simulation: CarSimulation) -> None:
        self._simulation = simulation

    def isTrue(self) -> "_NativeEnding":  # noqa: N802
        return self

    @property
    def is_truthy(self) -> bool:
        return self._simulation._native is not None

    def __str__(self) -> str:
        return f"the trial ended: {(self._simulation._native or {}).get('outcome')}"


def _refuse_misplaced(scenario: Any) -> None:
    """Refuse what Scenic 3.1 takes for a requirement when a running scenario invokes the one it stands in."""
    for sub in scenario._subScenarios:
        for statement in sub._temporalRequirements:
            if statement.ty is not RequirementType.require:
                raise FoldcarError(
                    f"line {statement.line}: `{statement.ty.value}` has no effect in a scenario that another one "
                    "invokes; it works in the top-level scenario, and so does `do … until …`"
                )
        _refuse_misplaced(sub)


def _result(simulation: CarSimulation, outcome: str | None) -> Result:
    if simulation.run_result is None:
        raise FoldcarError("the simulation ended before the car was put down")
    result = {**simulation.run_result, "recorded": simulation.recorded}
    if outcome is not None:
        result["outcome"] = outcome
    return result


def _outer_step(value: Any) -> float:
    low, high = OUTER_STEP_LIMITS_S
    try:
        outer_step_s = float(value)
    except (TypeError, ValueError):
        raise FoldcarError(f"param outer_step_s: {value} is no number") from None
    if not low - 1e-9 <= outer_step_s <= high:
        raise FoldcarError(f"param outer_step_s: {value} is not within {low:.4g} to {high:g} s")
    return outer_step_s
