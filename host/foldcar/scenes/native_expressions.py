"""Translates expressions of a Scenic program about the car to carsim's postfix order (docs/carsim.md).

Input: syntax trees, the program's names. Output: terms, some of which are known in a sample only. NotNativeError names
the part that needs Scenic beside the simulation. Expressions without the car are evaluated per sample (sampled_values).
"""

import ast
import builtins
import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from foldcar.scenes.program import named_things
from foldcar.scenes.reading import finite
from foldcar.scenes.sampled_values import (
    ARITHMETIC,
    FUNCTIONS,
    REGIONS,
    SIDES,
    SampledValues,
    Terms,
    is_code,
    is_plain,
    polygon_terms,
    shown,
)

MOTION = {
    "x": ("x_m",),
    "y": ("y_m",),
    "speed": ("speed_m_s",),
    "angularSpeed": ("yaw_rate_rad_s", "abs"),
    "consumedEnergy": ("energy_j",),
    "heading": ("heading_rad", math.pi / 2, "-", "wrap_rad"),
    "yaw": ("heading_rad", math.pi / 2, "-", "wrap_rad"),
    "pitch": ("pitch_rad",),
    "roll": ("roll_rad",),
}
# carsim's limit (program_input.cpp).
MAX_CORNERS = 1000
COMPARISONS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}
# Names that have a standard meaning, unless the program gives them another one.
STANDARD = (*FUNCTIONS, *REGIONS, "math", "simulation")


class NotNativeError(Exception):
    """The program needs Scenic beside the simulation; the message says what for."""


@dataclass(frozen=True)
class PerSample:
    """Terms that are known in a sample only: ``read`` computes them from the values of names."""

    read: Callable[["SampledValues"], Terms]


class Translator:
    """Translates the expressions of one program. Raises NotNativeError for those that need Scenic."""

    def __init__(self, tree: Any, scenario: Any) -> None:
        from scenic.syntax import veneer

        self._ego = scenario.egoObject
        self._params = scenario.params
        named_values = named_things(scenario)
        # What the names of STANDARD mean, unless the program gives them another meaning.
        standard_values = {"math": math, **vars(builtins), **vars(veneer)}
        # The names of STANDARD that the program has redefined.
        self._redefined = set()
        for name in STANDARD:
            if name in named_values and named_values[name] is not standard_values[name]:
                self._redefined.add(name)
        assignment_counts = Counter(
            node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and not isinstance(node.ctx, ast.Load)
        )
        # Names that are assigned once. The others may have had another value at an earlier line.
        self.names = {name: value for name, value in named_values.items() if assignment_counts[name] == 1}
        # Scenic measures the yaw, pitch and roll of an object from its parent's orientation, which is the world's unless
        # the program says otherwise.
        self._turned = not _stands_in_world(scenario.egoObject)

    def condition(self, node: Any) -> Terms:
        """Translate a condition to terms in postfix order, such as ["speed_m_s", 0.1, ">"].

        The simulator carsim evaluates these terms. A condition that does not change during a run becomes True or False
        as soon as a sample of the scene is known. Raises NotNativeError for forms that carsim does not have.
        """
        if self.is_constant(node):
            return [PerSample(lambda sample: [bool(sample.value(node))])]
        match node:
            case ast.BoolOp():
                operation = "and" if isinstance(node.op, ast.And) else "or"
                return joined([self._bool_operand(operand) for operand in node.values], operation)
            case ast.UnaryOp(op=ast.Not()):
                return [*self.condition(node.operand), "not"]
            case ast.Compare(ops=[ast.In() | ast.NotIn() as operator]):
                region_terms = self._inside(node.left, node.comparators[0])
                return region_terms if isinstance(operator, ast.In) else [*region_terms, "not"]
            case ast.Compare() if all(type(operator) in COMPARISONS for operator in node.ops):
                # `a < b < c` means `a < b and b < c`.
                sides = [self.number(side) for side in (node.left, *node.comparators)]
                comparisons = []
                for left, comparison, right in zip(sides, node.ops, sides[1:], strict=False):
                    comparisons.append([*left, *right, COMPARISONS[type(comparison)]])
                return joined(comparisons, "and")
        raise NotNativeError(shown(node))

    def _bool_operand(self, node: Any) -> Terms:
        """Translate an operand of `and` or `or`, which must be a condition or a constant that is true or false."""
        if self.is_constant(node):
            return [PerSample(lambda sample: sample.truth(node))]
        return self.condition(node)

    def number(self, node: Any) -> Terms:
        """Translate an expression that is a number to terms in postfix order, such as ["speed_m_s", "negate"].

        Raises NotNativeError for expressions that need Scenic.
        """
        if self.is_constant(node):
            return [PerSample(lambda sample: sample.number(node))]
        match node:
            # `simulation().currentRealTime`
            case ast.Attribute(value=ast.Call(func=ast.Name(id="simulation") as called), attr="currentRealTime") if (
                self._is_standard(called)
            ):
                return ["time_s"]
            # A property of the car, such as `ego.speed` or `ego.position.x`.
            case ast.Attribute() if self._is_ego(node.value) or self.is_position(node.value):
                return self._motion(node)
            case ast.UnaryOp(op=ast.USub()):
                return [*self.number(node.operand), "negate"]
            case ast.BinOp() if type(node.op) in ARITHMETIC:
                operator_term, _ = ARITHMETIC[type(node.op)]
                return [*self.number(node.left), *self.number(node.right), operator_term]
            case ast.Call(func=ast.Name() as function, keywords=[]) if self._is_standard(function):
                return self._call(node, function.id)
        if type(node).__name__ == "DistanceFromOp":
            return self._distance(node)
        raise NotNativeError(shown(node))

    def _call(self, node: Any, function: str) -> Terms:
        """Translate a call of `abs`, `min` or `max`. Raises NotNativeError for calls of other functions."""
        arguments = [self.number(argument) for argument in node.args] if function in ("abs", "min", "max") else []
        if function == "abs" and len(arguments) == 1:
            return [*arguments[0], "abs"]
        if function in ("min", "max") and len(arguments) > 1:
            return joined(arguments, function)
        raise NotNativeError(shown(node))

    def recorded(self, node: Any) -> Terms:
        """Translate a recorded value: a number, a boolean or the car's position."""
        if self.is_position(node):
            return ["x_m", "y_m", *self._height()]
        if _may_give_operand(node):
            # Python's `a > b and 1` gives False or 1, but carsim would give False or True.
            raise NotNativeError(shown(node))
        return self.condition(node) if is_condition(node) else self.number(node)

    def is_constant(self, node: Any) -> bool:
        """Return whether an expression does not depend on the drive, so that its value is known once a scene is sampled.

        Evaluating it must not run code of the program.
        """
        match node:
            case ast.Constant():
                return True
            case ast.Name():
                value = self.names.get(node.id)
                # A container of random values is not plain: Scenic samples such values only where the container is used.
                return node.id in self.names and value is not self._ego and is_plain(value)
            case ast.Attribute(value=ast.Name(id="globalParameters")):
                return self._params.get(node.attr) is not self._ego
            case ast.Attribute(value=ast.Name(id="math") as module):
                return self._is_standard(module) and hasattr(math, node.attr)
            case ast.Attribute():
                is_data = not node.attr.startswith("_") and not is_code(self._named_value(node.value), node.attr)
                return is_data and self.is_constant(node.value)
            case ast.Subscript():
                return self.is_constant(node.value) and self.is_constant(node.slice)
            case ast.Tuple() | ast.List():
                return all(map(self.is_constant, node.elts))
            case ast.UnaryOp(op=ast.USub() | ast.UAdd()):
                return self.is_constant(node.operand)
            case ast.BinOp():
                return type(node.op) in ARITHMETIC and self.is_constant(node.left) and self.is_constant(node.right)
            case ast.Call():
                parts = [*node.args, *(keyword.value for keyword in node.keywords)]
                return self._is_known_function(node.func) and all(map(self.is_constant, parts))
        if type(node).__name__ == "DegOp":
            return self.is_constant(node.operand)
        return type(node).__name__ == "VectorOp" and self.is_constant(node.left) and self.is_constant(node.right)

    def _named_value(self, node: Any) -> Any:
        """Return the value, before sampling, of a name or a parameter; None for other expressions."""
        match node:
            case ast.Name():
                return self.names.get(node.id)
            case ast.Attribute(value=ast.Name(id="globalParameters")):
                return self._params.get(node.attr)
        return None

    def _is_known_function(self, function: ast.expr) -> bool:
        """Whether an expression is a function of `math`, one of FUNCTIONS or a class of REGIONS."""
        if isinstance(function, ast.Attribute):
            module = function.value
            return isinstance(module, ast.Name) and module.id == "math" and self.is_constant(function)
        if not isinstance(function, ast.Name):
            return False
        return function.id in (*FUNCTIONS, *REGIONS) and self._is_standard(function)

    def _is_standard(self, name: ast.Name) -> bool:
        """Whether a name of STANDARD has its standard meaning in the program."""
        return name.id not in self._redefined

    def _is_ego(self, node: Any) -> bool:
        """Whether an expression is the car: `ego`, or another name of the same object."""
        return isinstance(node, ast.Name) and (node.id == "ego" or self.names.get(node.id) is self._ego)

    def is_position(self, node: Any) -> bool:
        """Whether an expression is `ego.position`."""
        return isinstance(node, ast.Attribute) and node.attr == "position" and self._is_ego(node.value)

    def _motion(self, node: ast.Attribute) -> Terms:
        """Translate a property of the car's motion, such as `ego.speed` or `ego.position.x`."""
        if node.attr == "z":
            return self._height()
        # `ego.x` and `ego.position.x` are the same, but a position has no other property.
        of_position = self.is_position(node.value)
        if node.attr not in MOTION or (of_position and node.attr not in ("x", "y")):
            raise NotNativeError(shown(node))
        if self._turned and node.attr in ("yaw", "pitch", "roll"):
            raise NotNativeError(f"{shown(node)} of a car whose parentOrientation is not the world's")
        return list(MOTION[node.attr])

    def _height(self) -> Terms:
        """Return the terms of `ego.position.z` (m): how far the car has risen, plus its height in the scene."""
        return ["rise_m", PerSample(lambda sample: [finite("z", sample.ego.position.z)]), "+"]

    def _distance(self, node: Any) -> Terms:
        """Translate `distance from A to B` to terms in postfix order.

        One of the two must be the car or a side of it, such as `front of ego`, and the other a constant place. Raises
        NotNativeError otherwise.
        """
        # `distance to B` leaves out the other point, which is then the ego.
        ego = ast.Name("ego", ast.Load())
        first: Any = ego if node.target is None else node.target
        second: Any = ego if node.base is None else node.base
        if self.is_constant(first) == self.is_constant(second):
            raise NotNativeError(shown(node))
        constant_point, car_point = (first, second) if self.is_constant(first) else (second, first)
        if self._is_region(constant_point):
            raise NotNativeError("the distance from a region")
        place_terms = PerSample(lambda sample: sample.place(constant_point))
        if self._is_ego(car_point) or self.is_position(car_point):
            return [place_terms, "distance_m"]
        # Scenic's syntax tree has a node PositionOfOp for `front of ego`, and a class for each side.
        if type(car_point).__name__ == "PositionOfOp" and self._is_ego(car_point.target):
            side = type(car_point.position).__name__
            if side in SIDES:
                return [PerSample(lambda sample: sample.side(side)), place_terms, "distance_from_m"]
        raise NotNativeError(shown(node))

    def _inside(self, thing: Any, region: Any) -> Terms:
        """Translate `ego.position in REGION` to terms that carsim evaluates.

        Raises NotNativeError if ``thing`` is not the car's position, or if the region changes during a drive.
        `ego in REGION` is another condition, which carsim cannot evaluate: it holds if the whole car is inside.
        """
        if not (self.is_position(thing) and self._is_region(region)):
            raise NotNativeError("a region")
        if not self.is_constant(region):
            raise NotNativeError(shown(region))
        value = self.names.get(region.id) if isinstance(region, ast.Name) else None
        if type(value).__name__ == "PolygonalRegion":
            return _polygonal(value)
        # Regions of other kinds, such as a circle, may have a random size. So their terms are computed for each sample.
        return [PerSample(lambda sample: sample.region(region))]

    def _is_region(self, node: Any) -> bool:
        """Whether an expression is the name of a region, or a call that makes one, such as `CircularRegion(…)`."""
        if isinstance(node, ast.Name):
            return type(self.names.get(node.id)).__name__ in REGIONS
        return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in REGIONS


def _polygonal(region: Any) -> Terms:
    """Return the terms of the condition that the car's position is in a PolygonalRegion of the program.

    Raises NotNativeError if carsim cannot express the region: it has a hole, too many corners or is random.
    """
    from shapely import MultiPolygon

    # Scenic's region has a MultiPolygon of Shapely, unless its corners are random.
    polygons = region.polygons
    if not isinstance(polygons, MultiPolygon):
        raise NotNativeError("a random PolygonalRegion")
    # For Scenic, a point on the edge of a hole is inside the region. carsim's conditions cannot express this.
    if any(polygon.interiors for polygon in polygons.geoms):
        raise NotNativeError("a region with a hole")
    if any(len(polygon.exterior.coords) - 1 > MAX_CORNERS for polygon in polygons.geoms):
        raise NotNativeError(f"a polygon of more than {MAX_CORNERS} corners")
    return polygon_terms(polygons)


def _stands_in_world(ego: Any) -> bool:
    """Return whether the car's yaw, pitch and roll count from the world's orientation."""
    from scenic.core.vectors import alwaysGlobalOrientation

    return bool(alwaysGlobalOrientation(ego.parentOrientation))


def joined(operands: list[Terms], operation: str) -> Terms:
    """Return the terms that apply a binary operation to one operand after the other: a, b, op, c, op, …"""
    terms = list(operands[0])
    for operand in operands[1:]:
        terms += [*operand, operation]
    return terms


def _may_give_operand(node: Any) -> bool:
    """Return whether an expression is an `and` or `or` whose value may be something else than True or False.

    In Python these operators give one of their operands, so `a > b and 1` may be 1.
    """
    if not isinstance(node, ast.BoolOp):
        return False
    for operand in node.values:
        is_true_or_false = isinstance(operand, ast.Constant) and isinstance(operand.value, bool)
        if is_true_or_false:
            continue
        if not is_condition(operand) or _may_give_operand(operand):
            return True
    return False


def is_condition(node: Any) -> bool:
    """Return whether an expression has the form of a condition: a comparison, or `and`, `or` or `not`."""
    if isinstance(node, ast.UnaryOp):
        return isinstance(node.op, ast.Not)
    return isinstance(node, ast.BoolOp | ast.Compare)
