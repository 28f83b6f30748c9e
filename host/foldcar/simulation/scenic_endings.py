"""Conditions to end a run, as Scenic evaluates them when it looks at a simulation."""

from collections.abc import Callable
from typing import Any, NamedTuple

from scenic.core.simulators import TerminationType

from foldcar.simulation.carsim_step import State


class TracedEnding:
    """A condition of the program. Calls ``trace_back`` where Scenic finds that it holds."""

    def __init__(self, condition: Any, kind: TerminationType, trace_back: Callable[[], None]) -> None:
        self.kind = kind
        self._condition = condition
        self._trace_back = trace_back

    def holds(self) -> bool:
        """Whether it holds in the state that is shown."""
        if self.kind is TerminationType.scenarioComplete:
            return bool(self._condition.evaluate())
        return bool(self._condition.isTrue().is_truthy)

    def evaluate(self) -> Any:
        """Scenic's evaluation of a `terminate when`."""
        value = self._condition.evaluate()
        if value:
            self._trace_back()
        return value

    def isTrue(self) -> Any:  # noqa: N802
        """Scenic's evaluation of a `terminate simulation when`."""
        value = self._condition.isTrue()
        if value.is_truthy:
            self._trace_back()
        return value

    def __str__(self) -> str:
        return str(self._condition)


class Moment(NamedTuple):
    """A state between two looks at which the program ends the run.

    ``steps`` is its time in the program's steps, ``row`` its place in the last advance, ``condition`` what holds there;
    None is the time limit.
    """

    state: State
    steps: float
    row: int
    condition: TracedEnding | None

    @property
    def ending(self) -> tuple[TerminationType, str]:
        """How Scenic names this ending."""
        if self.condition is None:
            return TerminationType.scenarioComplete, "reached time limit"
        return self.condition.kind, str(self.condition)


class NativeEnding:
    """A `terminate simulation when` that holds once there is a result of the trial."""

    def __init__(self, result: Callable[[], dict[str, Any] | None]) -> None:
        self._result = result

    def isTrue(self) -> "NativeEnding":  # noqa: N802
        """Itself, as a value."""
        return self

    @property
    def is_truthy(self) -> bool:
        """Whether the trial has ended."""
        return self._result() is not None

    def __str__(self) -> str:
        return f"the trial ended: {(self._result() or {}).get('outcome')}"
