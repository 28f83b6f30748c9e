"""The success rule of a Scenic program, in words: when a run has passed.

A run that reaches the Goal has passed. A run that the program ends has passed if its record `passed` is true. Without
such a record, it has passed if it was ended by a `terminate when` whose condition is that the car is close to its target.
A program with none of these defines no success.
"""

import ast
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from foldcar.scenes.program import named_things, parsed_program
from foldcar.scenes.reading import is_a
from foldcar.typed import read_text

# The name of the record with which a program decides whether a run that it ends has passed.
VERDICT = "passed"
# If conditions measure the distance to several places, the place of this name is the target.
TARGET = "target"
# Syntax of a place without a name: `(0, -1)`, `0 @ -1`, `-1`.
LITERALS = (ast.Tuple, ast.Constant, ast.UnaryOp, ast.USub, ast.UAdd, ast.Load)


@dataclass(frozen=True, slots=True)
class SuccessRule:
    """The rule by which a run has passed. ``text`` states it as a sentence, or why no rule is ``defined``.

    ``endings`` are the conditions, as Scenic names them, that end a run as passed.
    """

    defined: bool
    text: str
    endings: frozenset[str] = frozenset()


class _Approach(NamedTuple):
    """A condition that the car is close to a place: the condition's line and text, and the place's text."""

    line: int
    text: str
    place: str


def success_rule(scenario: Any, program: Path) -> SuccessRule:
    """Return the rule by which a run of a compiled program has passed, as the head of this file describes it."""
    has_goal = any(is_a(thing, "Goal") for thing in scenario.objects)
    # A run has passed if one of these holds. Each text completes the words "a run has passed if".
    alternatives = ["it reaches its Goal"] if has_goal else []
    records = [*scenario.recordedFinalExprs, *scenario.recordedExprs]
    if any(record.name == VERDICT for record in records):
        alternatives.append(f"the program ends it and its record `{VERDICT}` is true then")
        return _rule(alternatives, endings=frozenset())
    conditions = [*scenario.terminationConditions, *scenario.terminateSimulationConditions]
    approaches = _approaches(program, scenario, has_goal, {condition.line for condition in conditions})
    has_several_places = len({approach.place for approach in approaches}) > 1
    if has_several_places:
        approaches = [approach for approach in approaches if approach.place.lower() == TARGET]
    for approach in approaches:
        alternatives.append(f"`{approach.text}` (line {approach.line}) ends it with the car upright")
    if alternatives:
        approach_lines = {approach.line for approach in approaches}
        passing = frozenset(str(condition) for condition in conditions if condition.line in approach_lines)
        return _rule(alternatives, endings=passing)
    several = " (it measures the distance to several places, and none is named `target`)" if has_several_places else ""
    return SuccessRule(
        defined=False,
        text=f"success is undefined: {program.name} has no Goal, no `record final … as {VERDICT}` and no "
        f"`terminate when` on the distance of the car to its target{several}; no fraction of passed runs is reported",
    )


def _rule(alternatives: Sequence[str], endings: frozenset[str]) -> SuccessRule:
    """Return the rule that a run has passed if one of the ``alternatives`` holds within the time limit."""
    text = ", or if ".join(alternatives)
    return SuccessRule(defined=True, text=f"a run has passed if {text}, within the time limit", endings=endings)


def _approaches(program: Path, scenario: Any, has_goal: bool, lines: Collection[int]) -> list[_Approach]:
    """Return the statements that end a run when the car has come close to its target.

    The target is the Goal. In a program without a Goal, it is a place. Only statements in these ``lines`` count.
    """
    if not lines:
        return []
    source = read_text(program)
    things = named_things(scenario)
    approaches: list[_Approach] = []
    statements: list[Any] = list(ast.walk(parsed_program(source)))
    for statement in statements:
        is_ending = type(statement).__name__ in ("TerminateWhen", "TerminateSimulationWhen")
        if not is_ending or statement.lineno not in lines:
            continue
        for conjunct in _conjuncts(statement.cond):
            place = _approached_place(conjunct)
            if place is not None and _is_target(place, things, has_goal):
                place_text = ast.get_source_segment(source, place) or ast.dump(place)
                text = " ".join((ast.get_source_segment(source, statement) or "").split())
                approaches.append(_Approach(statement.lineno, text, place_text))
    return approaches


def _conjuncts(condition: ast.AST) -> list[ast.AST]:
    """Return the parts of a condition that are joined by `and`."""
    if isinstance(condition, ast.BoolOp) and isinstance(condition.op, ast.And):
        return [part for value in condition.values for part in _conjuncts(value)]
    return [condition]


def _approached_place(condition: ast.AST) -> ast.expr | None:
    """Return the PLACE of a condition `distance from ego to PLACE <= …`, also written `… >= distance to PLACE`.

    Returns None for other conditions.
    """
    if not isinstance(condition, ast.Compare) or len(condition.ops) != 1:
        return None
    operator = condition.ops[0]
    if isinstance(operator, ast.Lt | ast.LtE):
        smaller, greater = condition.left, condition.comparators[0]
    elif isinstance(operator, ast.Gt | ast.GtE):
        smaller, greater = condition.comparators[0], condition.left
    else:
        return None
    if type(smaller).__name__ != "DistanceFromOp" or type(greater).__name__ == "DistanceFromOp":
        return None
    distance: Any = smaller
    # The two ends of the distance. If only one is given, the other one is the ego.
    ends = [end for end in (distance.target, distance.base) if end is not None]
    places = [end for end in ends if not (isinstance(end, ast.Name) and end.id == "ego")]
    return places[0] if len(places) == 1 else None


def _is_target(place: ast.expr, things: dict[str, Any], has_goal: bool) -> bool:
    """Return whether a place can be the target of the car, at which a run has succeeded.

    The program ends a run when the car is near ``place``, an expression. ``things`` are the program's variables by name.
    If the program has a Goal, only the Goal can be the target. Otherwise the target can be coordinates that are written
    in the program, a point or a Marker, but not terrain or a car.
    """
    root = place
    while isinstance(root, ast.Attribute):
        root = root.value
    if not isinstance(root, ast.Name):
        # The place has no name, so it must be written as coordinates.
        is_coordinates = all(isinstance(part, LITERALS) or _is_vector(part) for part in ast.walk(place))
        return is_coordinates and not has_goal
    if root.id not in things:
        return False
    thing = things[root.id]
    if has_goal:
        return is_a(thing, "Goal")
    is_several_things = isinstance(thing, list | tuple | dict | set)
    return not (is_a(thing, "Terrain") or is_a(thing, "Robot") or is_several_things)


def _is_vector(part: ast.AST) -> bool:
    """Return whether a part of an expression is Scenic's `x @ y`, or an operator in it."""
    return type(part).__name__ == "VectorOp" or isinstance(part, ast.operator)
