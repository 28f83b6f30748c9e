"""A Scenic program's conditions, requirements and records during a run.

Conditions and requirements of the top-level scenario are evaluated at every step of carsim. Scenic evaluates records,
which are kept as JSON by name: {"kind": "initial"|"final"|"series", "value": JSON}. A series is a list of
[time (s), value].
"""

import contextlib
from collections.abc import Callable, Iterator
from typing import Any

import rv_ltl
from scenic.core.propositions import Next, PropositionMonitor
from scenic.core.requirements import RequirementType
from scenic.syntax import veneer

from foldcar.errors import FoldcarError
from foldcar.scenes import scenic_private
from foldcar.scenes.recorded import to_json


def has_next(requirement: Any) -> bool:
    """Return whether a temporal requirement has a `next`, which refers to Scenic's next outer step."""
    return any(isinstance(part, Next) for part in requirement.proposition.flatten())


class ChangesMonitor(PropositionMonitor):  # type: ignore[misc]
    """Monitors a temporal proposition without `next`, faster than Scenic's monitor: it stores only changed states.

    Repeated states do not matter for such a proposition, and Scenic's monitor evaluates all stored states each time.
    """

    def __init__(self, proposition: Any) -> None:
        super().__init__(proposition)
        self._latest: dict[str, bool] = {}
        self._verdict: rv_ltl.B4 = rv_ltl.B4.TRUE

    def update(self) -> rv_ltl.B4:
        """Evaluate the proposition in the present state of the simulation, and return the verdict so far.

        A proposition such as ``always (a implies eventually b)`` is built from conditions, here ``a`` and ``b``. Their
        truth values are all that the verdict depends on.
        """
        truth_values: dict[str, bool] = {}
        for condition in self._proposition.atomics():
            truth_values[str(condition.syntax_id)] = bool(condition.closure())
        # If the conditions are as they were at the last update, the verdict is, too.
        if truth_values != self._latest:
            self._latest = truth_values
            self._monitor.update(truth_values)
            self._verdict = self._monitor.evaluate()
        return self._verdict


class NativeEnding:
    """A condition of `terminate simulation when` that becomes true when carsim has ended the trial with a result."""

    def __init__(self, result: Callable[[], dict[str, Any] | None]) -> None:
        self._result = result

    def isTrue(self) -> "NativeEnding":  # noqa: N802
        """Return itself as the value."""
        return self

    @property
    def is_truthy(self) -> bool:
        """Whether the trial has ended."""
        return self._result() is not None

    def __str__(self) -> str:
        return f"the trial ended: {(self._result() or {}).get('outcome')}"


class Records:
    """What a program records in one simulation: ``plain`` has the values as JSON by name.

    ``scenic`` is Scenic's own dictionary of them, which is updated, too.
    """

    def __init__(self, scenic: dict[str, Any]) -> None:
        self.plain: dict[str, dict[str, Any]] = {}
        self._scenic = scenic

    def take(self, scenario: Any, steps: float, t_s: float) -> None:
        """Evaluate and store what the program records at the time ``t_s``, which is ``steps`` of Scenic's steps.

        These are the next values of all `record` statements and, at the start, the values of `record initial`. Each value
        is stored twice: in Scenic's dictionary, and as JSON in ``plain``.
        """
        refuse_misplaced(scenario)
        if steps == 0:
            initial_values = scenic_private.recorded(scenario, RequirementType.recordInitial, 0)
            for name, value in initial_values.items():
                self._scenic[name] = value
                self.plain[name] = {"kind": "initial", "value": to_json(value, name)}
        present_values = scenic_private.recorded(scenario, RequirementType.record, steps)
        for name, value in present_values.items():
            self._scenic[name].append((steps, value))
            if name not in self.plain:
                self.plain[name] = {"kind": "series", "value": []}
            self.plain[name]["value"].append([t_s, to_json(value, name)])

    def finish(self) -> None:
        """Store the final values, which Scenic has evaluated after the end."""
        for name, value in self._scenic.items():
            if name not in self.plain:
                self.plain[name] = {"kind": "final", "value": to_json(value, name)}


def refuse_misplaced(scenario: Any) -> None:
    """Raise FoldcarError if a scenario that another one invokes has a statement such as `terminate when` or `record`.

    Such a statement has an effect only in the top-level scenario. Scenic 3.1 wrongly lists it among the temporal
    requirements of the invoked scenario.
    """
    for sub in scenic_private.invoked(scenario):
        for statement in scenic_private.temporal_requirements(sub):
            if statement.ty is not RequirementType.require:
                raise FoldcarError(
                    f"line {statement.line}: `{statement.ty.value}` has no effect in a scenario that another one "
                    "invokes; it works in the top-level scenario, and so does `do … until …`"
                )
        refuse_misplaced(sub)


@contextlib.contextmanager
def imported_requirements() -> Iterator[None]:
    """Let Scenic evaluate requirements of imported programs within the block.

    Scenic evaluates a requirement in the scenario of its program. The scenario of an imported program does not run, so
    Scenic would fail with an assertion. Within the block it uses the running scenario instead: Scenic's function
    ``veneer.executeInRequirement`` is replaced, and put back afterwards.
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
