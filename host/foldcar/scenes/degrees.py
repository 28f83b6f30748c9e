"""Refuses headings that are surely meant in degrees: Scenic's angles are radians, and `facing -90` means -90 rad.

Input: nodes of Scenic's syntax tree. Only numbers that stand in the program as such are looked at, above one turn.
"""

import ast
import math
from collections.abc import Iterator

from scenic.core.errors import InvalidScenarioError
from scenic.syntax import ast as scenic_ast

ANGLES = ("yaw", "pitch", "roll")
DISTRIBUTIONS = ("Range", "DiscreteRange", "Normal", "TruncatedNormal", "Uniform")


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
            error = InvalidScenarioError(
                f"`{statement}`: {number:g} is more than a turn of 2 pi radians; angles are in radians: "
                f"for degrees write {number:g} deg"
            )
            error.filename, error.lineno = file, getattr(node, "lineno", 0)
            raise error


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
