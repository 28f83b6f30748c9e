"""What a program records while it runs, by Scenic's own evaluation, also as plain JSON with the time in seconds.

Input: the running top-level scenario. Output: {"kind": "initial"|"final"|"series", "value": JSON} by name; a series is
a list of [time (s), value].
"""

from typing import Any

from scenic.core.requirements import RequirementType

from foldcar.errors import FoldcarError
from foldcar.simulation.recorded_values import to_json


class Records:
    """The records of one simulation. ``scenic`` is Scenic's own dictionary of them, which it keeps up to date."""

    def __init__(self, scenic: dict[str, Any]) -> None:
        self.plain: dict[str, dict[str, Any]] = {}
        self._scenic = scenic

    def take(self, scenario: Any, steps: float, t_s: float) -> None:
        """Evaluate and keep the values of a series at that time, and the initial ones at the start."""
        refuse_misplaced(scenario)
        if steps == 0:
            for name, value in scenario._evaluateRecordedExprs(RequirementType.recordInitial, 0).items():
                self._scenic[name] = value
                self.plain[name] = {"kind": "initial", "value": to_json(value, name)}
        for name, value in scenario._evaluateRecordedExprs(RequirementType.record, steps).items():
            self._scenic[name].append((steps, value))
            series = self.plain.setdefault(name, {"kind": "series", "value": []})
            series["value"].append([t_s, to_json(value, name)])

    def finish(self) -> None:
        """Keep the final values, which Scenic has evaluated after the end."""
        for name, value in self._scenic.items():
            if name not in self.plain:
                self.plain[name] = {"kind": "final", "value": to_json(value, name)}


def refuse_misplaced(scenario: Any) -> None:
    """Refuse what Scenic 3.1 takes for a requirement when a running scenario invokes the one it stands in."""
    for sub in scenario._subScenarios:
        for statement in sub._temporalRequirements:
            if statement.ty is not RequirementType.require:
                raise FoldcarError(
                    f"line {statement.line}: `{statement.ty.value}` has no effect in a scenario that another one "
                    "invokes; it works in the top-level scenario, and so does `do … until …`"
                )
        refuse_misplaced(sub)
