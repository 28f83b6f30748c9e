"""Refuses statements about a run that can only fail or lose something in it, before the first run.

Input: what Scenic's compiler comes across. Scenic itself would notice in each run, or never.
"""

import ast
import math
from typing import Any

from scenic.core.errors import InvalidScenarioError
from scenic.syntax import ast as scenic_ast


def refuse_actions(node: ast.AST, file: str) -> None:
    """Raise Scenic's InvalidScenarioError, with file and line, if ``node`` takes a literal: `take [3]`."""
    if not isinstance(node, scenic_ast.Take):
        return
    lists = (ast.List, ast.Tuple)
    for action in [one for part in node.elts for one in (part.elts if isinstance(part, lists) else [part])]:
        if isinstance(action, ast.Constant | ast.Dict | ast.JoinedStr | ast.List | ast.Set | ast.Tuple):
            error: Any = InvalidScenarioError(
                f"`take {ast.unparse(action)}`: an action is an object of a class of actions"
            )
            error.filename, error.lineno = file, getattr(node, "lineno", 0)
            raise error


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
            error: Any = InvalidScenarioError(
                f"`{record.ty.value} … as {record.name}`: line {lines[record.name]} records under this name already"
            )
            error.lineno = record.line
            raise error
        lines[record.name] = record.line
