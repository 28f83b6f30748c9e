"""Refuses statements that Scenic 3.1 drops: those about a run, in a program that another one imports.

A program takes over objects, parameters and requirements of one that it imports, and a modular scenario those of the
top level of its file, but no `terminate`, `record` or `require monitor`.
"""

import re
from pathlib import Path
from typing import Any

from scenic.core.errors import InvalidScenarioError

DROPPED = (
    "_terminationConditions",
    "_terminateSimulationConditions",
    "_recordedExprs",
    "_recordedInitialExprs",
    "_recordedFinalExprs",
    "_monitorRequirements",
)


def refuse_lost_statements(inherited: Any) -> None:
    """Raise Scenic's InvalidScenarioError if ``inherited``, the scenario that another one inherits, has any of them."""
    file = (inherited._dummyNamespace or {}).get("__file__")
    lost = [(one.line, one.ty.value) for place in DROPPED for one in getattr(inherited, place)]
    if inherited._timeLimit is not None:
        lost.append((_line_of_time_limit(file), "terminate after"))
    if not lost:
        return
    named = ", ".join(f"`{kind}` (line {line})" for line, kind in sorted(lost))
    error: Any = InvalidScenarioError(
        f"{named}: Scenic drops such statements from an imported program, and from the top level beside a `scenario`; "
        "move them to the program, or into the scenario, that is run"
    )
    error.filename, error.lineno = file, min(lost)[0]
    raise error


def _line_of_time_limit(file: str | None) -> int:
    """The line of the first `terminate after`, which Scenic does not keep; 0 if it is not found."""
    lines = Path(file).read_text(encoding="utf-8").splitlines() if file else []
    found = (number for number, line in enumerate(lines, 1) if re.match(r"\s*terminate\s+after\b", line))
    return next(found, 0)
