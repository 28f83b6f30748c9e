"""Refuses statements of a program that do not mean what they say: Scenic would notice in each run, or never.

Headings in degrees: Scenic's angles are radians, and `facing -90` means -90 rad. Statements about a run in a program that
another one imports: Scenic 3.1 takes over its objects, parameters and requirements, and a modular scenario those of the
top level of its file, but no `terminate`, `record` or `require monitor`. What can only fail or lose something in a run.
"""

import ast
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from scenic.core.errors import InvalidScenarioError
from scenic.syntax import ast as scenic_ast

ANGLES = ("yaw", "pitch", "roll")
DROPPED = (
    *("_terminationConditions", "_terminateSimulationConditions", "_monitorRequirements"),
    *("_recordedExprs", "_recordedInitialExprs", "_recordedFinalExprs"),
)
DISTRIBUTIONS = ("Range", "DiscreteRange", "Normal", "TruncatedNormal", "Uniform")


def at(error: Any, file: str | None, line: int | None) -> Exception:
    """``error`` with the place at which Scenic's messages, and foldcar's, say that it is."""
    error.filename, error.lineno = file, line
    return error  # type: ignore[no-any-return]


def refuse_degrees(node: ast.AST, file: str) -> None:
    """Raise Scenic's InvalidScenarioError, with file and line, if ``node`` gives a heading of more than one turn."""
    if isinstance(node, scenic_ast.FacingSpecifier):
        statement, angle = "facing", node.heading
    elif isinstance(node, scenic_ast.WithSpecifier) and node.prop in ANGLES:
        statement, angle = f"with {node.prop}", node.value
    else:
        return
    for number in _numbers(angle):
        if abs(number) > 2 * math.pi:
            what = f"`{statement}`: {number:g} is more than a turn of 2 pi radians; angles are in radians: "
            error = InvalidScenarioError(f"{what}for degrees write {number:g} deg")
            raise at(error, file, getattr(node, "lineno", 0))


def _numbers(angle: ast.AST) -> Iterator[float]:
    """The number that ``angle`` is, or those that a distribution is given."""
    if isinstance(angle, ast.Call) and isinstance(angle.func, ast.Name) and angle.func.id in DISTRIBUTIONS:
        for argument in angle.args:
            yield from _numbers(argument)
        return
    try:
        value = ast.literal_eval(angle)
    except (ValueError, TypeError):
        return
    if isinstance(value, int | float):
        yield float(value)


def refuse_lost_statements(inherited: Any) -> None:
    """Raise Scenic's InvalidScenarioError if ``inherited``, the scenario that another one inherits, has any of them."""
    file = (inherited._dummyNamespace or {}).get("__file__")
    lost = [(one.line, one.ty.value) for place in DROPPED for one in getattr(inherited, place)]
    if inherited._timeLimit is not None:
        lost.append((_line_of_time_limit(file), "terminate after"))
    if not lost:
        return
    named = ", ".join(f"`{kind}` (line {line})" for line, kind in sorted(lost))
    error = InvalidScenarioError(
        f"{named}: Scenic drops such statements from an imported program, and from the top level beside a `scenario`; "
        "move them to the program, or into the scenario, that is run"
    )
    raise at(error, file, min(lost)[0])


def _line_of_time_limit(file: str | None) -> int:
    """The line of the first `terminate after`, which Scenic does not keep; 0 if it is not found."""
    lines = Path(file).read_text(encoding="utf-8").splitlines() if file else []
    found = (number for number, line in enumerate(lines, 1) if re.match(r"\s*terminate\s+after\b", line))
    return next(found, 0)


def refuse_actions(node: ast.AST, file: str) -> None:
    """Raise Scenic's InvalidScenarioError, with file and line, if ``node`` takes a literal: `take [3]`."""
    if not isinstance(node, scenic_ast.Take):
        return
    lists = (ast.List, ast.Tuple)
    for action in [one for part in node.elts for one in (part.elts if isinstance(part, lists) else [part])]:
        if isinstance(action, ast.Constant | ast.Dict | ast.JoinedStr | ast.List | ast.Set | ast.Tuple):
            what = f"`take {ast.unparse(action)}`: an action is an object of a class of actions"
            raise at(InvalidScenarioError(what), file, getattr(node, "lineno", 0))


def refuse_time_limit(limit: Any) -> None:
    """Raise Scenic's InvalidScenarioError if ``limit`` is a number with which `terminate after` makes no sense."""
    if isinstance(limit, int | float) and not (math.isfinite(limit) and limit > 0):
        raise InvalidScenarioError(f"`terminate after {limit}`: the time must be above 0")


def refuse_same_names(scenario: Any) -> None:
    """Raise Scenic's InvalidScenarioError, with the line, if two records have one name: only one would be kept."""
    lines: dict[str, int] = {}
    records = [*scenario.recordedExprs, *scenario.recordedInitialExprs, *scenario.recordedFinalExprs]
    for record in sorted(records, key=lambda one: int(one.line)):
        if record.name in lines:
            what = f"`{record.ty.value} … as {record.name}`: line {lines[record.name]} records under this name already"
            raise at(InvalidScenarioError(what), None, record.line)
        lines[record.name] = record.line
