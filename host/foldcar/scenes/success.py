"""When a run of a Scenic program has passed: what the program says of it, as a rule that people can read.

A run that reaches the Goal has passed. A run that the program ends itself has passed if its record `passed` is true; in a
program without such a record, if a `terminate when` ended it that says that the car is close to its target. A program
with none of these defines no success.
"""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from foldcar.scenes.program import named_things, parsed_program
from foldcar.scenes.reading import is_a
from foldcar.typed import read_text

# A program that records its verdict under this name decides about runs that it ends itself.
VERDICT = "passed"
# Of several places that conditions measure the distance to, the one of this name is the target.
TARGET = "target"
# What may stand for a place beside a name: `(0, -1)`, `0 @ -1`, `-1`.
LITERALS = (ast.Tuple, ast.Constant, ast.UnaryOp, ast.USub, ast.UAdd, ast.Load)


@dataclass(frozen=True, slots=True)
class SuccessRule:
    """``defined`` says whether runs can pass at all; ``text`` is the rule, or why there is none, as a sentence.

    ``endings`` are the conditions, as Scenic names them, with which a run that the program ends has passed.
    """

    defined: bool
    text: str
    endings: frozenset[str] = frozenset()


def success_rule(scenario: Any, program: Path) -> SuccessRule:
    """The rule of a compiled program."""
    goal = any(is_a(thing, "Goal") for thing in scenario.objects)
    ways = ["it reaches its Goal"] if goal else []
    endings: frozenset[str] = frozenset()
    ambiguous = ""
    records = [*scenario.recordedFinalExprs, *scenario.recordedExprs]
    if any(record.name == VERDICT for record in records):
        ways.append(f"the program ends it and its record `{VERDICT}` is true then")
    else:
        conditions = [*scenario.terminationConditions, *scenario.terminateSimulationConditions]
        lines = {condition.line for condition in conditions}
        # Without conditions, as in most programs, it need not be parsed. Of each its line, its text, the place's text.
        found = [approach for approach in _approaches(program, scenario, goal) if approach[0] in lines] if lines else []
        if len({place for _, _, place in found}) > 1:
            found = [one for one in found if one[2].lower() == TARGET]
            if not found:
                ambiguous = " (it measures the distance to several places, and none is named `target`)"
        ways += [f"`{text}` (line {line}) ends it with the car upright" for line, text, _ in found]
        endings = frozenset(str(c) for c in conditions if c.line in {line for line, _, _ in found})
    if ways:
        return SuccessRule(True, f"a run has passed if {', or if '.join(ways)}, within the time limit", endings)
    return SuccessRule(
        False,
        f"success is undefined: {program.name} has no Goal, no `record final … as {VERDICT}` and no "
        f"`terminate when` on the distance of the car to its target{ambiguous}; no share of passed runs is given",
    )


def _approaches(program: Path, scenario: Any, goal: bool) -> Iterator[tuple[int, str, str]]:
    """The program's conditions to terminate that hold when the car is close to its Goal or, without one, to a place.

    Of each its line, its text and the place's text.
    """
    source = read_text(program)
    things = named_things(scenario)
    for node in ast.walk(parsed_program(source)):
        if type(node).__name__ not in ("TerminateWhen", "TerminateSimulationWhen"):
            continue
        condition: Any = node
        for part in _all_of(condition.cond):
            place = _approached(part)
            if place is not None and _is_target(place, things, goal):
                text = " ".join((ast.get_source_segment(source, node) or "").split())
                yield condition.lineno, text, ast.get_source_segment(source, place) or ast.dump(place)


def _all_of(condition: ast.AST) -> list[ast.AST]:
    """The parts that all hold when the condition does."""
    if isinstance(condition, ast.BoolOp) and isinstance(condition.op, ast.And):
        return [part for value in condition.values for part in _all_of(value)]
    return [condition]


def _approached(condition: ast.AST) -> ast.expr | None:
    """The place of `distance from ego to PLACE <= …` in any order and form; None if the condition is another one."""
    if not isinstance(condition, ast.Compare) or len(condition.ops) != 1:
        return None
    (operator,), left, right = condition.ops, condition.left, condition.comparators[0]
    if isinstance(operator, ast.Gt | ast.GtE):
        left, right = right, left
    elif not isinstance(operator, ast.Lt | ast.LtE):
        return None
    if type(left).__name__ != "DistanceFromOp" or type(right).__name__ == "DistanceFromOp":
        return None
    distance: Any = left
    # Without the other end it is the distance from the ego.
    ends = [end for end in (distance.target, distance.base) if end is not None]
    places = [end for end in ends if not (isinstance(end, ast.Name) and end.id == "ego")]
    return places[0] if len(places) == 1 else None


def _is_target(place: ast.expr, things: dict[str, Any], goal: bool) -> bool:
    """Whether the car is to go there: to the Goal if there is one, else to a place where no terrain is."""
    root = place
    while isinstance(root, ast.Attribute):
        root = root.value
    if not isinstance(root, ast.Name):
        return not goal and all(isinstance(part, LITERALS) or _is_vector(part) for part in ast.walk(place))
    if root.id not in things:
        return False
    thing = things[root.id]
    if goal:
        return is_a(thing, "Goal")
    return not (is_a(thing, "Terrain") or is_a(thing, "Robot") or isinstance(thing, list | tuple | dict | set))


def _is_vector(part: ast.AST) -> bool:
    return type(part).__name__ == "VectorOp" or isinstance(part, ast.operator)
