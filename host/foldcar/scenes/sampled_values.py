"""Values of a Scenic program's expressions in a sampled scene, as numbers for carsim.

Input: a sampled scene, the program's names, syntax trees. Output: values, and terms of carsim's expressions
(docs/carsim.md). Only trees are evaluated that native_expressions has admitted; they do not mention the car.
"""

import ast
import inspect
import math
import operator
from collections.abc import Callable, Mapping
from typing import Any

import numpy

from foldcar.scenes.reading import UnusableError, finite, rounded

# Scenic's constant.
RADIANS_PER_DEGREE = 0.01745329252
ARITHMETIC: Mapping[type, tuple[str, Callable[[Any, Any], Any]]] = {
    ast.Add: ("+", operator.add),
    ast.Sub: ("-", operator.sub),
    ast.Mult: ("*", operator.mul),
    ast.Div: ("/", operator.truediv),
}
FUNCTIONS: Mapping[str, Callable[..., Any]] = {"abs": abs, "min": min, "max": max, "float": float, "int": int}
REGIONS = ("CircularRegion", "RectangularRegion", "PolygonalRegion")
# The sides of an object that `front of`, `left of` … name, as fractions of its length, width and height.
SIDES = {"Front": (1, 0, 0), "Back": (-1, 0, 0), "Left": (0, 1, 0), "Right": (0, -1, 0), "Top": (0, 0, 1)} | {
    f"{end}{side}": (1 if end == "Front" else -1, 1 if side == "Left" else -1, 0)
    for end in ("Front", "Back")
    for side in ("Left", "Right")
}

# Numbers, booleans, polygons and names of operators of carsim's expressions.
Terms = list[Any]


class SampledValues:
    """The values of a program's names in a sampled scene."""

    def __init__(self, scene: Any, names: Mapping[str, Any]) -> None:
        self.scene, self.ego, self._names = scene, scene.egoObject, names

    def value(self, node: Any) -> Any:
        """Return the value of an expression that :meth:`Translator.is_constant` has found to be constant during a run.

        Raises UnusableError if it cannot be evaluated, or if its value is the car, or an object of a class that may have
        code of its own.
        """
        try:
            value = self._evaluated(node)
        except UnusableError:
            raise
        except Exception as error:
            # Scenic's errors are sentences.
            error_class = "" if type(error).__module__.startswith("scenic.") else f"{type(error).__name__}: "
            raise UnusableError(f"line {node.lineno}: {error_class}{error}") from error
        if value is self.ego:
            raise UnusableError(f"line {node.lineno}: {shown(node)} is the car: name it `ego` in conditions and records")
        if not isinstance(value, list | tuple | dict) and not is_plain(value):
            raise UnusableError(f"line {node.lineno}: a {type(value).__name__} cannot be used in a condition or record")
        return value

    def _evaluated(self, node: Any) -> Any:
        """Evaluate one of the forms of expressions that :meth:`Translator.is_constant` admits."""
        match node:
            case ast.Constant():
                return node.value
            case ast.Name():
                return self.scene.sample[self._names[node.id]]
            case ast.Attribute(value=ast.Name(id="globalParameters")):
                return self.scene.params[node.attr]
            case ast.Attribute(value=ast.Name(id="math")):
                return getattr(math, node.attr)
            case ast.Attribute():
                return attribute_of(self.value(node.value), node)
            case ast.Subscript():
                return self.value(node.value)[self.value(node.slice)]
            case ast.Tuple() | ast.List():
                values = [self.value(part) for part in node.elts]
                return values if isinstance(node, ast.List) else tuple(values)
            case ast.UnaryOp():
                value = self.value(node.operand)
                return -value if isinstance(node.op, ast.USub) else value
            case ast.BinOp():
                _, operate = ARITHMETIC[type(node.op)]
                return operate(self.value(node.left), self.value(node.right))
            case ast.Call():
                return self._called(node)
        if type(node).__name__ == "DegOp":
            return self.value(node.operand) * RADIANS_PER_DEGREE
        from scenic.core.vectors import Vector

        return Vector(self.value(node.left), self.value(node.right))  # `left @ right`

    def _called(self, node: ast.Call) -> Any:
        """Evaluate a call of a function of `math`, a function of FUNCTIONS or a region of Scenic."""
        from scenic.core import regions

        arguments = [self.value(argument) for argument in node.args]
        keyword_arguments = {keyword.arg: self.value(keyword.value) for keyword in node.keywords if keyword.arg}
        if isinstance(node.func, ast.Attribute):
            return getattr(math, node.func.attr)(*arguments, **keyword_arguments)
        assert isinstance(node.func, ast.Name)
        function = FUNCTIONS.get(node.func.id) or getattr(regions, node.func.id)
        return function(*arguments, **keyword_arguments)

    def number(self, node: Any) -> Terms:
        """Return the value of an expression as carsim's term of a number."""
        return [finite("a value of the program", self.value(node))]

    def truth(self, node: Any) -> Terms:
        """Return an operand of `and` or `or` as a term for carsim: [True] or [False].

        Raises UnusableError if it is another value than True, False, 0 and 1. Scenic combines other numbers bit by bit.
        """
        value = self.value(node)
        if not isinstance(value, bool | numpy.bool_ | int) or value not in (0, 1):
            raise UnusableError(f"line {node.lineno}: {value!r} beside `and` or `or` is neither True nor False")
        return [bool(value)]

    def place(self, node: Any) -> Terms:
        """Return the coordinates x, y, z (m) of a place, as a part of carsim's expression.

        The height z is measured from the height at which the car starts. Raises UnusableError if the value is not a
        place.
        """
        from scenic.core.type_support import toVector

        value = self.value(node)
        try:
            x, y, z = (finite("a place", part) for part in toVector(value))
        except TypeError:
            raise UnusableError(f"line {node.lineno}: {value!r} is not a place to measure a distance from") from None
        return [x, y, rounded(z - float(self.ego.position.z))]

    def region(self, node: Any) -> Terms:
        """Return the terms of the condition that the car's position is in a region of the ground.

        A circle is x, y, radius and "in_disc"; see :func:`polygon_terms` for others.
        """
        region = self.value(node)
        if type(region).__name__ == "CircularRegion":
            numbers = (region.center.x, region.center.y, region.radius)
            return [*(finite("a region", number) for number in numbers), "in_disc"]
        return polygon_terms(region.polygons)

    def side(self, name: str) -> Terms:
        """Return the place on the car that `front of ego`, … name: ahead, left and up of its middle (m)."""
        sizes = (self.ego.length, self.ego.width, self.ego.height)
        return [rounded(fraction * float(size) / 2) for fraction, size in zip(SIDES[name], sizes, strict=True)]


def polygon_terms(polygons: Any) -> Terms:
    """Return the terms of the condition that the car's position is in one of the polygons, which have no holes.

    Each polygon is one term, the list of its corners' coordinates x0, y0, x1, y1, …; several polygons are joined by
    "or", in postfix order.
    """
    terms: Terms = []
    for count, polygon in enumerate(polygons.geoms):
        corners = polygon.exterior.coords[:-1]
        coordinates = [finite("a region", coordinate) for corner in corners for coordinate in corner[:2]]
        terms += [coordinates] if count == 0 else [coordinates, "or"]
    return terms


def attribute_of(value: Any, node: ast.Attribute) -> Any:
    """Return the attribute's value. Raises UnusableError if a class defined in the program computes it."""
    if is_code(value, node.attr):
        kind = type(value).__name__
        raise UnusableError(
            f"line {node.lineno}: `{node.attr}` of a {kind} is code, which a condition or record cannot use"
        )
    return getattr(value, node.attr)


def is_code(value: Any, attribute: str) -> bool:
    """Whether a class that the program defines computes this attribute of an object of Scenic."""
    defining_classes = [cls for cls in type(value).__mro__ if attribute in vars(cls)]
    is_of_program = any(not cls.__module__.startswith("scenic.") for cls in defining_classes)
    return is_of_program and is_scenic(value)


def is_scenic(value: Any) -> bool:
    """Whether a value is of one of Scenic's classes, or of a class derived from one."""
    return any(cls.__module__.startswith("scenic.") for cls in type(value).__mro__)


def is_plain(value: Any) -> bool:
    """Whether using the value runs no code of the program: a value of Python, numpy or a class of Scenic."""
    # Scenic samples the members of a container only where the container is used as a value.
    is_builtin = isinstance(value, bool | int | float | str | numpy.generic | numpy.ndarray | None)
    return is_builtin or (is_scenic(value) and not isinstance(value, type) and not inspect.isroutine(value))


def shown(node: Any) -> str:
    """Return the name of an expression in messages."""
    if isinstance(node, ast.Name):
        return f"`{node.id}`"
    if isinstance(node, ast.Attribute):
        return f"`….{node.attr}`"
    return type(node).__name__
