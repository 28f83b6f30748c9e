"""Scenic's own simulations over `carsim step`: any program's records, conditions, monitors and requirements work.

Input: a car (body and settings of docs/carsim.md), then Scenic scenes. Output: Scenic's Simulation objects, or the
result of a run with what the program recorded.

carsim simulates in steps of 1/240 s. Scenic evaluates the program's conditions and records only at times that are called
*looks*: at the start, and then once every outer step, which is `param outer_step_s`. If the program would end the run
between two looks, the second look is moved back to the step at which this happens.

For people who script with Scenic: ``CarSimulator(...).simulate(scene)`` is Scenic's own interface, and
``CarSimulator(...).run(scene)`` gives the result that a sweep stores.
"""

import math
from collections.abc import Callable, Collection
from types import FrameType
from typing import Any

from rv_ltl import B4
from scenic.core.distributions import RejectionException
from scenic.core.dynamics import GuardViolation, RejectSimulationException
from scenic.core.dynamics.actions import Action
from scenic.core.errors import InvalidScenarioError
from scenic.core.requirements import RequirementType
from scenic.core.simulators import Simulation, SimulationCreationError, Simulator

from foldcar.errors import FoldcarError
from foldcar.scenes import scenic_private
from foldcar.scenes.reading import outer_step_s
from foldcar.scenes.success import VERDICT
from foldcar.simulation.carsim_step import Advanced, State, SteppedCarsim
from foldcar.simulation.scenic_objects import ShownEgo
from foldcar.simulation.scenic_statements import (
    ChangesMonitor,
    NativeEnding,
    Records,
    has_next,
    imported_requirements,
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
        """Run one simulation and return it. Scenic calls this for every simulation.

        ``timestep`` is the time (s) between two evaluations of the program; None takes it from the program.
        """
        scene_text = self._describe(scene)

        def start_trial() -> Advanced:
            """Place the car and start the trial; :meth:`CarSimulation.setup` calls this."""
            return self._carsim.start(self._body, scene_text, self._settings)

        return CarSimulation(
            scene,
            carsim=self._carsim,
            start_trial=start_trial,
            timestep=outer_step_s(scene.params, timestep),
            **options,
        )

    def run(self, scene: Any) -> Result:
        """Simulate a scene and return carsim's result, with the program's records in ``recorded``.

        If carsim has ended the run, for example because the car tipped over, the outcome is that of carsim. If a
        condition of the program has ended the run, the outcome is "passed" or "terminated". If the run has violated a
        requirement of the program, the outcome is "rejected".

        A record is {"kind": "initial"|"final"|"series", "value": JSON}. Raises FoldcarError if a record cannot be stored,
        and every exception of the program.
        """
        try:
            simulation = self.createSimulation(scene, maxSteps=None, name="run", timestep=None, enableReplay=False)
        except (RejectSimulationException, RejectionException, GuardViolation) as rejection:
            # A misplaced statement can be the reason; then this raises an error that says so.
            refuse_misplaced(scene.dynamicScenario)
            return _result(rejection.simulation, "rejected")
        program_ended_run = simulation.run_result is not None and simulation.run_result["outcome"] == "terminated"
        if program_ended_run and self._has_passed(simulation):
            return _result(simulation, "passed")
        return _result(simulation, None)

    def _has_passed(self, simulation: "CarSimulation") -> bool:
        """Return whether a run that the program ended has passed.

        If the program records a value under the name VERDICT, its last value decides. Otherwise the condition that ended
        the run decides. The car is upright, because carsim itself ends the run of a car that tips over.
        """
        verdict = simulation.recorded.get(VERDICT)
        if verdict is not None and verdict["kind"] == "final":
            return bool(verdict["value"])
        if verdict is not None and verdict["kind"] == "series":
            # A series is a list of (time, value).
            series = verdict["value"]
            if not series:
                return False
            _, last_value = series[-1]
            return bool(last_value)
        return simulation.result.terminationReason in self._passing


class CarSimulation(Simulation):  # type: ignore[misc]
    """One trial. As with every Scenic simulation, creating the object runs it.

    ``run_result`` is carsim's result, with the outcome "terminated" if Scenic ended the trial; ``recorded`` is what the
    program recorded, as plain JSON.
    """

    objects: list[Any]
    timestep: float

    def __init__(
        self, scene: Any, *, carsim: SteppedCarsim, start_trial: Callable[[], Advanced], timestep: float, **options: Any
    ) -> None:
        """Run the simulation; ``start_trial`` places the car and returns its first state.

        Scenic evaluates the program's conditions and records at times called *looks*: at the start, then every
        ``timestep`` (s), which is called an *outer step*. carsim's own steps are shorter: 1/240 s.
        """
        self.run_result: Result | None = None
        self._carsim = carsim
        self._start_trial = start_trial
        # The state of the car at the last look, and the time of that look as a number of outer steps.
        self._state: State | None = None
        self._outer_steps: float = 0.0
        # carsim's result, if carsim has ended the trial.
        self._carsim_result: Result | None = None
        # The time (s, and in outer steps) at which the last advance began.
        self._advance_began_s: float = 0.0
        self._advance_began_at_step: float = 0.0
        # If the program ends the run between two looks, the second look is moved back to that time. This is then the
        # index of carsim's step among those of the last advance; otherwise it is None.
        self._moved_back_to: int | None = None
        # The program's conditions that end the run, and its requirements.
        self._ending_conditions: list[Any] = []
        self._requirements: list[Any] = []
        with imported_requirements():
            super().__init__(scene, timestep=timestep, **options)
        self._records.finish()

    @property
    def recorded(self) -> dict[str, dict[str, Any]]:
        """What the program recorded, by name (see scenic_statements)."""
        return self._records.plain

    @property
    def currentTime(self) -> float:  # noqa: N802
        """Outer steps since the start; not an integer if the look was moved back."""
        return self._outer_steps

    @currentTime.setter
    def currentTime(self, steps: float) -> None:  # noqa: N802
        """Ignore Scenic's own count of steps: the trial's clock decides."""

    @property
    def currentRealTime(self) -> float:  # noqa: N802
        """Time since the start of the trial (s)."""
        return 0.0 if self._state is None else self._state.t_s

    def setup(self) -> None:
        """Place the car, and create all objects of the scene. Scenic calls this at the start of a simulation."""
        # The objects that have a behavior; _createObject adds them.
        self.agents: list[Any] = []
        scenario = self.scene.dynamicScenario
        scenic_private.forget_last_simulation(scenario)
        start = self._start_trial()
        # Objects must be created before the first state is shown, because from then on createObjectInSimulator refuses
        # them.
        for obj in self.scene.objects:
            self._createObject(obj)
        self._ego = ShownEgo(self.scene.egoObject, start.state)
        self._show(start.state, outer_steps=0)
        # `records` is Scenic's own dictionary of what the program records.
        self._records = Records(self.records)
        self._ending_conditions = scenic_private.endings(scenario)
        # As soon as carsim ends the run and gives its result, Scenic ends its simulation, too.
        self._carsim_result = start.result
        scenic_private.end_simulation_when(scenario, NativeEnding(lambda: self._carsim_result))

    def createObjectInSimulator(self, obj: Any) -> None:  # noqa: N802
        """Refuse an object that the program creates while the car drives. Scenic calls this for every new object.

        carsim gets the ground, the obstacles and the goal once, before the start. A Marker is allowed, because it is
        neither; a Goal is a Marker that carsim would have to know, so it is refused.
        """
        class_names = {ancestor.__name__ for ancestor in type(obj).__mro__}
        is_plain_marker = "Marker" in class_names and "Goal" not in class_names
        is_driving = self._state is not None
        if is_driving and not is_plain_marker:
            raise SimulationCreationError(
                f"a {type(obj).__name__} is created while the car drives; create it before, "
                "in the program itself or in its top-level `setup`"
            )

    def step(self) -> None:
        """Advance to the next look, or to the end of the run if that is earlier. Scenic calls this at each outer step.

        A *look* is a time at which Scenic evaluates the program: every whole number of outer steps.
        """
        assert self._state is not None
        self._advance_began_s, self._advance_began_at_step = self._state.t_s, self._outer_steps
        self._moved_back_to = None
        # If the last look was moved back, the present number of outer steps has a fraction.
        next_look = math.floor(self._outer_steps + ROUNDING_S) + 1
        advanced = self._carsim.advance(next_look * self.timestep)
        self._carsim_result = advanced.result
        has_reached_look = advanced.result is None
        self._show(advanced.state, next_look if has_reached_look else self._outer_steps_at(advanced.state))
        # Between two looks, the program can end the run by its time limit or a condition, or reject it by a requirement.
        limit_s = self._time_limit_s() - ROUNDING_S
        is_limit_passed = limit_s < advanced.state.t_s - 2 * ROUNDING_S
        if is_limit_passed or self._ending_conditions or self._requirements:
            self._move_look_back(limit_s)

    def _move_look_back(self, limit_s: float) -> None:
        """Let Scenic see the state at which the program ends or rejects the run, or else the last state.

        The simulator carsim has advanced by many steps, and Scenic sees only the state after the last of them. So this
        method shows the earlier states to Scenic, one after another. If the program's time limit ``limit_s`` is
        reached, a condition ends the run or a requirement is violated, Scenic keeps seeing that state and evaluates the
        program there.
        """
        assert self._state is not None
        last_state, last_outer_steps = self._state, self._outer_steps
        earlier_states = self._carsim.rows()[:-1]
        for index, state in enumerate(earlier_states):
            self._show(state, self._outer_steps_at(state))
            # Monitors must see every state, so each requirement is evaluated, even after a violated one.
            verdicts = [requirement.value() for requirement in self._requirements]
            is_violated = any(verdict is B4.FALSE for verdict in verdicts)
            is_ended = self._ending_holds()
            if is_ended:
                # Scenic examines its time limit before the conditions, and would give it as the reason for the end.
                scenic_private.defer_time_limit(self.scene.dynamicScenario)
            if is_ended or is_violated or state.t_s >= limit_s:
                self._moved_back_to = index
                # If carsim ended the run at a later step, that no longer counts.
                self._carsim_result = None
                return
        self._show(last_state, last_outer_steps)

    def _ending_holds(self) -> bool:
        """Return whether a condition that ends the run holds in the state that is shown to the program."""
        for condition in self._ending_conditions:
            if condition.ty is RequirementType.terminateSimulationWhen:
                holds = condition.isTrue().is_truthy
            else:
                holds = condition.evaluate()
            if holds:
                return True
        return False

    def updateObjects(self) -> None:  # noqa: N802
        """Collect the program's requirements at the first look, and make their evaluation faster.

        Scenic calls this at each look, to update its objects. The car needs no update, because :meth:`step` has shown its
        state already.
        """
        super().updateObjects()
        is_first_look = self._outer_steps == 0
        if not is_first_look:
            return
        # Scenic has just started the scenario, so its requirements exist now.
        scenario = self.scene.dynamicScenario
        scenic_private.round_time_limit(scenario)
        for requirement in scenic_private.requirement_monitors(scenario):
            # The operator `next` means Scenic's next look. Such a requirement must not be evaluated between looks, so it
            # stays as it is.
            if has_next(requirement):
                continue
            # This monitor computes the verdict again only if a condition has changed.
            requirement.monitor = ChangesMonitor(requirement.proposition)
            self._requirements.append(requirement)

    def actionsAreCompatible(self, agent: Any, actions: tuple[Any, ...]) -> bool:  # noqa: N802
        """Return whether an agent can take these actions together.

        Scenic calls this at each of its time steps, before the agent takes the actions. Raises InvalidScenarioError
        if one of them is not an action.
        """
        for action in actions:
            if not isinstance(action, Action):
                error: Any = InvalidScenarioError(f"a {type(agent).__name__} takes {action!r}, which is no action")
                # Scenic prints these with the error.
                frame = _innermost_scenic_frame(agent.behavior)
                error.filename = None if frame is None else frame.f_code.co_filename
                error.lineno = None if frame is None else frame.f_lineno
                raise error
        return bool(super().actionsAreCompatible(agent, actions))

    def getProperties(self, obj: Any, properties: set[str]) -> dict[str, Any]:  # noqa: N802
        """Return an object's properties (Scenic's hook): only the car moves, so they are those of the program."""
        return {name: getattr(obj, name) for name in properties}

    def recordCurrentState(self) -> None:  # noqa: N802
        """Evaluate the program's records at this look."""
        assert self._state is not None
        self._records.take(self.scene.dynamicScenario, self._outer_steps, self._state.t_s)
        self.trajectory.append(self.currentState())

    def currentState(self) -> tuple[Any, ...]:  # noqa: N802
        """Return the positions of all objects, the ego's first (Scenic's hook)."""
        return tuple(thing.position for thing in self.objects)

    def destroy(self) -> None:
        """End the trial and keep carsim's result. Scenic calls this after every simulation."""
        is_trial_running = self._state is not None and self._carsim.alive
        if not is_trial_running:
            return
        if self._carsim_result is not None:
            self.run_result = self._carsim_result
            return
        # The program has ended the run at the state that Scenic saw last. This is the state after the last of carsim's
        # steps, or an earlier one, if _move_look_back has found that the run ended before.
        last_index = len(self._carsim.rows()) - 1
        self.run_result = self._carsim.end(last_index if self._moved_back_to is None else self._moved_back_to)

    def _outer_steps_at(self, state: State) -> float:
        """Return the time of a state of the last advance as a number of outer steps, which may have a fraction."""
        return self._advance_began_at_step + (state.t_s - self._advance_began_s) / self.timestep

    def _show(self, state: State, outer_steps: float) -> None:
        """Set the ego's properties to a state, whose time is that number of outer steps."""
        self._state, self._outer_steps = state, outer_steps
        self._ego.show(state)

    def _time_limit_s(self) -> float:
        """Return the time limit (s) of the top-level scenario's `terminate after`, which may lie within an outer step."""
        return scenic_private.time_limit_s(self.scene.dynamicScenario, self.timestep)


def _innermost_scenic_frame(behavior: Any) -> FrameType | None:
    """Return the frame of the Scenic statement that a running behavior executes; None if it executes none.

    A frame has the file and the line. If the behavior does another behavior, which may do a third one, and so on, the
    statement is that of the last of them: the generator of each behavior yields from the generator of the next one.
    """
    innermost: FrameType | None = None
    generator = scenic_private.running_generator(behavior)
    while generator is not None:
        frame = getattr(generator, "gi_frame", None)
        if frame is not None and frame.f_code.co_filename.endswith(".scenic"):
            innermost = frame
        generator = getattr(generator, "gi_yieldfrom", None)
    return innermost


def _result(simulation: CarSimulation, outcome: str | None) -> Result:
    """Return carsim's result with the recorded values, and with ``outcome`` instead of its own unless None."""
    if simulation.run_result is None:
        raise FoldcarError("the simulation ended before the car was placed")
    result = {**simulation.run_result, "recorded": simulation.recorded}
    if outcome is not None:
        result["outcome"] = outcome
    return result
