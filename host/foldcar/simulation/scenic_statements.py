"""A Scenic program's conditions, requirements and records during a run.

Conditions and requirements of the top-level scenario are evaluated at every step of carsim. Scenic evaluates records,
which are kept as JSON by name: {"kind": "initial"|"final"|"series", "value": JSON}. A series is a list of
[time (s), value].
"""

from collections.abc import Callable
from typing import Any

import rv_ltl
from scenic.core.propositions import Next, PropositionMonitor
from scenic.core.requirements import RequirementType

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
        """Add the current values of the proposition's atoms; return the verdict so far."""
        state = {str(atom.syntax_id): bool(atom.closure()) for atom in self._proposition.atomics()}
        # A repeated state cannot change the verdict.
        if state != self._latest:
            self._latest = state
            self._monitor.update(state)
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
        """Evaluate the program's records at ``t_s`` (outer step ``steps``): series and, at the start, initial values.

        Each value is stored twice: in Scenic's dictionary, and as JSON in ``plain``.
        """
        refuse_misplaced(scenario)
        if steps == 0:
            for name, value in scenic_private.recorded(scenario, RequirementType.recordInitial, 0).items():
                self._scenic[name] = value
                self.plain[name] = {"kind": "initial", "value": to_json(value, name)}
        for name, value in scenic_private.recorded(scenario, RequirementType.record, steps).items():
            self._scenic[name].append((steps, value))
            series = self.plain.setdefault(name, {"kind": "series", "value": []})
            series["value"].append([t_s, to_json(value, name)])

    def finish(self) -> None:
        """Store the final values, which Scenic has evaluated after the end."""
        for name, value in self._scenic.items():
            if name not in self.plain:
                self.plain[name] = {"kind": "final", "value": to_json(value, name)}


def refuse_misplaced(scenario: Any) -> None:
    """Raise FoldcarError if a scenario that another one invokes has a condition or a record.

    Such a statement has an effect only in the top-level scenario. Scenic 3.1 wrongly treats it as a requirement.
    """
    for sub in scenic_private.invoked(scenario):
        for statement in scenic_private.temporal_requirements(sub):
            if statement.ty is not RequirementType.require:
                raise FoldcarError(
                    f"line {statement.line}: `{statement.ty.value}` has no effect in a scenario that another one "
                    "invokes; it works in the top-level scenario, and so does `do … until …`"
                )
        refuse_misplaced(sub)
