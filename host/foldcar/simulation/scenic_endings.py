"""Conditions of a program that are evaluated at every step of carsim, not only where Scenic looks at the simulation.

They are those of the top-level scenario that are certain to change nothing (see pure_conditions.py): others are evaluated
once a look, by Scenic.
"""

from collections.abc import Callable
from typing import Any

import rv_ltl
from scenic.core.propositions import Next, PropositionMonitor

from foldcar.simulation.pure_conditions import changes_nothing


def is_pure(condition: Any) -> bool:
    """Whether evaluating a condition or requirement of Scenic changes nothing."""
    return all(changes_nothing(atom.closure) for atom in condition.proposition.atomics())


def is_traceable(requirement: Any) -> bool:
    """Whether a temporal requirement can be evaluated at every step: `next` is about the looks."""
    return is_pure(requirement) and not any(isinstance(part, Next) for part in requirement.proposition.flatten())


class ChangesMonitor(PropositionMonitor):  # type: ignore[misc]
    """Scenic's monitor of a temporal proposition without `next`, told of every state, remembering the changes only.

    Repeated states are of no consequence for such a proposition, and Scenic's monitor reads all it remembers each time.
    """

    def __init__(self, proposition: Any) -> None:
        super().__init__(proposition)
        self._latest: dict[str, bool] = {}
        self._verdict: rv_ltl.B4 = rv_ltl.B4.TRUE

    def update(self) -> rv_ltl.B4:
        """Take the state that is shown; the verdict so far."""
        state = {str(atom.syntax_id): bool(atom.closure()) for atom in self._proposition.atomics()}
        if state != self._latest:
            self._latest = state
            self._monitor.update(state)
            self._verdict = self._monitor.evaluate()
        return self._verdict


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
