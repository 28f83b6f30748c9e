"""Scenic's own simulations over `carsim step`: any program's records, conditions, monitors and requirements work.

Input: a car (body and settings of docs/carsim.md), then Scenic scenes. Output: Scenic's Simulation objects, or the
result of a run with what the program recorded.

carsim simulates in steps of 1/240 s. Scenic evaluates the program's conditions and records only at times that are called
*looks*: at the start, and then once every outer step, which is `param outer_step_s`. If the program would end the run
between two looks, the second look is moved back to the step at which this happens.

For people who script with Scenic: ``CarSimulator(...).simulate(scene)`` is Scenic's own interface, and
``CarSimulator(...).run(scene)`` gives the result that a sweep stores.
"""

import contextlib
import math
from collections.abc import Callable, Collection, Iterator
from typing import Any

from rv_ltl import B4
from scenic.core.distributions import RejectionException
from scenic.core.dynamics import GuardViolation, RejectSimulationException
from scenic.core.dynamics.actions import Action
from scenic.core.errors import InvalidScenarioError
from scenic.core.requirements import RequirementType
from scenic.core.simulators import Simulation, SimulationCreationError, Simulator
from scenic.syntax import veneer

from foldcar.errors import FoldcarError
from foldcar.scenes import scenic_private
from foldcar.scenes.reading import outer_step_s
from foldcar.scenes.success import VERDICT
from foldcar.simulation.carsim_step import State, SteppedCarsim
from foldcar.simulation.scenic_objects import ShownEgo
from foldcar.simulation.scenic_statements import (
    ChangesMonitor,
    NativeEnding,
    Records,
    has_next,
    refuse_misplaced,
)

ROUNDING_S = 1e-9

Result = dict[str, Any]


class CarSimulator(Simulator):  # type: ignore[misc]
    """Simulates one car in any number of scenes, one at a time.

    ``body`` and ``settings`` are JSON texts as docs/carsim.md describes them, without ids; ``describe`` turns a
    Scenic scene into the text of carsim's scene. ``passing`` are the conditions, as Scenic names them, that end a run
    that has passed (``SceneSource.success.endings``).
    """

    def __init__(
        self,
        carsim: SteppedCarsim,
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
        """Run one simulation (Scenic's hook). ``timestep`` (s) takes precedence over the program's outer step."""
        scene_text = self._describe(scene)

        def start() -> Any:
            """Start the trial; called when Scenic sets the simulation up."""
            return self._carsim.start(self._body, scene_text, self._settings)

        step_s = outer_step_s(scene.params, timestep)
        return CarSimulation(scene, carsim=self._carsim, start=start, timestep=step_s, **options)

    def run(self, scene: Any) -> Result:
        """Simulate a scene and return carsim's result, with ``recorded`` and two more outcomes.

        These are ``terminated``, if the program ended the run, and ``rejected``, if the run violated a requirement of the
        program. Recorded values are {"kind": "initial"|"final"|"series", "value": JSON}. Raises FoldcarError if a value
        cannot be stored, and all exceptions of the program.
        """
        try:
            simulation = self.createSimulation(scene, maxSteps=None, name="run", timestep=None, enableReplay=False)
        except (RejectSimulationException, RejectionException, GuardViolation) as rejection:
            refuse_misplaced(scene.dynamicScenario)
            return _result(rejection.simulation, "rejected")
        program_ended_run = simulation.run_result is not None and simulation.run_result["outcome"] == "terminated"
        if program_ended_run and self._has_passed(simulation):
            return _result(simulation, "passed")
        # The outcome remains that of carsim, or "terminated".
        return _result(simulation, None)

    def _has_passed(self, simulation: "CarSimulation") -> bool:
        """Return whether a run that the program ended has passed.

        If the program records a verdict, its last value decides. Otherwise the condition that ended the run decides. The
        car is upright, because carsim itself ends the run of a car that tips over.
        """
        verdict = simulation.recorded.get(VERDICT, {"kind": "initial"})
        if verdict["kind"] == "final":
            return bool(verdict["value"])
        if verdict["kind"] == "series":
            # A series is a list of (time, value).
            return bool(verdict["value"] and verdict["value"][-1][1])
        return simulation.result.terminationReason in self._passing


class CarSimulation(Simulation):  # type: ignore[misc]
    """One trial. As with every Scenic simulation, creating the object runs it.

    ``run_result`` is carsim's result, with the outcome "terminated" if Scenic ended the trial; ``recorded`` is what the
    program recorded, as plain JSON.
    """

    objects: list[Any]
    timestep: float

    def __init__(
        self, scene: Any, *, carsim: SteppedCarsim, start: Callable[[], Any], timestep: float, **options: Any
    ) -> None:
        self.run_result: Result | None = None
        self._carsim = carsim
        self._start_trial = start
        self._state: State | None = None
        # carsim's result, if it has ended the trial itself.
        self._native: Result | None = None
        # Outer steps since the start.
        self._steps: float = 0.0
        # Time (s) and outer steps at the beginning of the last advance.
        self._begun: tuple[float, float] = (0.0, 0.0)
        # If the look was moved back: the row of the last advance that it was moved to. A row is a step of 1/240 s.
        self._row: int | None = None
        self._endings: list[Any] = []
        self._requirements: list[Any] = []
        with _imported_requirements():
            super().__init__(scene, timestep=timestep, **options)
        self._records.finish()

    @property
    def recorded(self) -> dict[str, dict[str, Any]]:
        """What the program recorded, by name (see scenic_statements)."""
        return self._records.plain

    @property
    def currentTime(self) -> float:  # noqa: N802
        """Outer steps since the start; not an integer if the look was moved back."""
        return self._steps

    @currentTime.setter
    def currentTime(self, steps: float) -> None:  # noqa: N802
        """Ignore Scenic's own count of steps: the trial's clock decides."""

    @property
    def currentRealTime(self) -> float:  # noqa: N802
        """Time since the start of the trial (s)."""
        return 0.0 if self._state is None else self._state.t_s

    def setup(self) -> None:
        """Place the car, and create all objects of the scene. Scenic calls this at the start of a simulation."""
        self.agents: list[Any] = []
        scenario = self.scene.dynamicScenario
        scenic_private.forget_last_simulation(scenario)
        first_step = self._start_trial()
        ego = self.scene.egoObject
        # Objects must be created now: after the first state is shown, createObjectInSimulator refuses them.
        for obj in self.scene.objects:
            self._createObject(obj)
        self._ego = ShownEgo(ego, first_step.state)
        # carsim's result, as soon as carsim ends the run. Then Scenic ends its simulation, too.
        self._native = first_step.result
        self._show(first_step.state, 0)
        self._records = Records(self.records)
        self._endings = scenic_private.endings(scenario)
        scenic_private.end_simulation_when(scenario, NativeEnding(lambda: self._native))

    def createObjectInSimulator(self, obj: Any) -> None:  # noqa: N802
        """Refuse objects that are created during the run, except Markers (Scenic's hook).

        carsim gets ground, obstacles and goal once, before the start. So Goals, which are Markers, are refused, too.
        """
        kinds = {ancestor.__name__ for ancestor in type(obj).__mro__}
        if self._state is not None and ("Marker" not in kinds or "Goal" in kinds):
            raise SimulationCreationError(
                f"a {type(obj).__name__} is created while the car drives; create it before, "
                "in the program itself or in its top-level `setup`"
            )

    def step(self) -> None:
        """Advance to the next look, or to the end of the run if that is earlier. Scenic calls this at each outer step."""
        assert self._state is not None
        self._begun, self._row = (self._state.t_s, self._steps), None
        # The next whole number of outer steps. If the last look was moved back, the present number has a fraction.
        look = math.floor(self._steps + ROUNDING_S) + 1
        advanced = self._carsim.advance(look * self.timestep)
        self._native = advanced.result
        self._show(advanced.state, self._steps_at(advanced.state) if advanced.result else look)
        # The program can end or reject the run before the look by its time limit, its endings and its requirements.
        limit_s = self._time_limit_s() - ROUNDING_S
        limit_is_before_look = limit_s < advanced.state.t_s - 2 * ROUNDING_S
        if limit_is_before_look or self._endings or self._requirements:
            self._move_back(limit_s)

    def _move_back(self, limit_s: float) -> None:
        """Go back to the first step of the last advance at which the program ends or rejects the run, if there is one.

        carsim advances by several steps at once, and Scenic sees only the state after the last of them. A condition may
        hold at a step between. This shows Scenic the state at that step, so that it evaluates everything there.
        ``limit_s`` is the program's time limit.
        """
        assert self._state is not None
        last_state, last_steps = self._state, self._steps
        for row, state in enumerate(self._carsim.rows()[:-1]):
            self._show(state, self._steps_at(state))
            violated = [requirement for requirement in self._requirements if requirement.value() is B4.FALSE]
            ended = self._ending_holds()
            if violated or ended or state.t_s >= limit_s:
                self._row, self._native = row, None
                if ended:
                    # Scenic checks the time limit first, and would name it as the reason of the end.
                    scenic_private.defer_time_limit(self.scene.dynamicScenario)
                return
        self._show(last_state, last_steps)

    def _ending_holds(self) -> bool:
        """Return whether a condition that ends the run holds in the state that is shown to the program."""
        return any(
            ending.isTrue().is_truthy if ending.ty is RequirementType.terminateSimulationWhen else ending.evaluate()
            for ending in self._endings
        )

    def updateObjects(self) -> None:  # noqa: N802
        """Prepare the requirements at the start of a simulation. Scenic calls this at each look, to update its objects.

        The ego needs no update, because step() has shown it the state of the car. At the start, the requirements are
        collected. Their monitors are replaced by monitors that evaluate only what has changed, which is faster.
        """
        super().updateObjects()
        scenario = self.scene.dynamicScenario
        if self._steps > 0:
            return
        # Scenic has just started the scenario, so its requirements exist now.
        scenic_private.round_time_limit(scenario)
        # A requirement with `next` depends on Scenic's own steps, so it keeps its monitor.
        self._requirements = [
            monitor for monitor in scenic_private.requirement_monitors(scenario) if not has_next(monitor)
        ]
        for requirement in self._requirements:
            requirement.monitor = ChangesMonitor(requirement.proposition)

    def actionsAreCompatible(self, agent: Any, actions: tuple[Any, ...]) -> bool:  # noqa: N802
        """Return whether an agent can take these actions together. Scenic calls this at each look.

        Raises InvalidScenarioError if one of them is not an action.
        """
        for action in actions:
            if not isinstance(action, Action):
                error: Any = InvalidScenarioError(f"a {type(agent).__name__} takes {action!r}, which is no action")
                error.filename, error.lineno = _place(agent.behavior)
                raise error
        return bool(super().actionsAreCompatible(agent, actions))

    def getProperties(self, obj: Any, properties: set[str]) -> dict[str, Any]:  # noqa: N802
        """Return an object's properties (Scenic's hook): only the car moves, so they are those of the program."""
        return {name: getattr(obj, name) for name in properties}

    def recordCurrentState(self) -> None:  # noqa: N802
        """Evaluate the program's records at this look."""
        assert self._state is not None
        self._records.take(self.scene.dynamicScenario, self._steps, self._state.t_s)
        self.trajectory.append(self.currentState())

    def currentState(self) -> tuple[Any, ...]:  # noqa: N802
        """Return the positions of all objects, the ego's first (Scenic's hook)."""
        return tuple(thing.position for thing in self.objects)

    def destroy(self) -> None:
        """End the trial and keep carsim's result. Scenic calls this after every simulation."""
        if self._state is None or not self._carsim.alive:
            return
        if self._native is not None:
            self.run_result = self._native
        else:
            # The trial ends at the last look. This is the last row of the advance, unless the look was moved back.
            look_row = len(self._carsim.rows()) - 1 if self._row is None else self._row
            self.run_result = self._carsim.end(look_row)

    def _steps_at(self, state: State) -> float:
        """Return the outer steps since the start, with a fraction, at the time of a state of the last advance."""
        begun_s, begun_steps = self._begun
        return begun_steps + (state.t_s - begun_s) / self.timestep

    def _show(self, state: State, steps: float) -> None:
        """Set the ego's properties to a state, at that number of outer steps."""
        self._state, self._steps = state, steps
        self._ego.show(state)

    def _time_limit_s(self) -> float:
        """Return the time limit (s) of the top-level scenario's `terminate after`, which may lie within an outer step."""
        return scenic_private.time_limit_s(self.scene.dynamicScenario, self.timestep)


@contextlib.contextmanager
def _imported_requirements() -> Iterator[None]:
    """Let Scenic evaluate requirements of imported programs within the block.

    Scenic evaluates a requirement in the scenario of its program. The scenario of an imported program does not run, so
    Scenic would fail with an assertion. Within the block it uses the running scenario instead.
    """
    evaluate = veneer.executeInRequirement

    def evaluate_in_running_scenario(scenario: Any, ego: Any, values: Any) -> Any:
        """Evaluate a requirement in the running scenario, or in its own one if none runs."""
        return evaluate(veneer.currentScenario or scenario, ego, values)

    veneer.executeInRequirement = evaluate_in_running_scenario
    try:
        yield
    finally:
        veneer.executeInRequirement = evaluate


def _place(behavior: Any) -> tuple[str | None, int | None]:
    """Return the file and line of the innermost Scenic statement that a behavior executes; (None, None) outside one.

    A behavior may do another behavior: its generator then yields from the generator of the other one.
    """
    generator, place = scenic_private.running_generator(behavior), (None, None)
    while generator is not None:
        frame = getattr(generator, "gi_frame", None)
        if frame is not None and frame.f_code.co_filename.endswith(".scenic"):
            place = (frame.f_code.co_filename, frame.f_lineno)
        generator = getattr(generator, "gi_yieldfrom", None)
    return place


def _result(simulation: CarSimulation, outcome: str | None) -> Result:
    """Return carsim's result with the recorded values, and with ``outcome`` instead of its own unless None."""
    if simulation.run_result is None:
        raise FoldcarError("the simulation ended before the car was placed")
    result = {**simulation.run_result, "recorded": simulation.recorded}
    if outcome is not None:
        result["outcome"] = outcome
    return result
