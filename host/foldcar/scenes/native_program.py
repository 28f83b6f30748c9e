"""What a Scenic program says of its runs, translated for carsim, so that Scenic need not run beside it.

Input: a compiled program, then its sampled scenes. Output: the member `program` of a scene (docs/carsim.md).

Translated are `terminate when`, `terminate after` and `record` of the top level. Their expressions may have numbers,
comparisons, `and`, `or`, `not`, distances of the car from a place, its position in a region, its motion and the time.
What does not mention the car is evaluated here, in each sample.
"""

import ast
import builtins
import inspect
import math
import operator
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy

from foldcar.scenes import scenic_private
from foldcar.scenes.program import named_things, parsed_program
from foldcar.scenes.reading import UnusableError, finite, outer_step_s, rounded
from foldcar.scenes.recorded import to_json
from foldcar.scenes.success import VERDICT, SuccessRule
from foldcar.typed import read_text

# A time limit beyond carsim's own, which ends every run, has no effect.
MAX_TIME_LIMIT_S = 3600.0
# As Scenic has it.
RADIANS_PER_DEGREE = 0.01745329252

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
ARITHMETIC: Mapping[type, tuple[str, Callable[[Any, Any], Any]]] = {
    ast.Add: ("+", operator.add),
    ast.Sub: ("-", operator.sub),
    ast.Mult: ("*", operator.mul),
    ast.Div: ("/", operator.truediv),
}
COMPARISONS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}
FUNCTIONS: Mapping[str, Callable[..., Any]] = {"abs": abs, "min": min, "max": max, "float": float, "int": int}
REGIONS = ("CircularRegion", "RectangularRegion", "PolygonalRegion")
# Names whose meaning is known unless the program gives them another one.
STANDARD = (*FUNCTIONS, *REGIONS, "math", "simulation")
# carsim's limits (program_input.cpp). Where an expression has at most this many terms before it is sampled, it has room
# for those that follow from a sample.
MAX_STATEMENTS, MAX_TERMS = 100, 400
RECORDS = {"RecordInitial": "initial", "RecordFinal": "final", "Record": "series"}
# The sides of an object that `front of` and its like name, as shares of its length, width and height: ahead, left, up.
SIDES = {"Front": (1, 0, 0), "Back": (-1, 0, 0), "Left": (0, 1, 0), "Right": (0, -1, 0), "Top": (0, 0, 1)} | {
    f"{end}{side}": (1 if end == "Front" else -1, 1 if side == "Left" else -1, 0)
    for end in ("Front", "Back")
    for side in ("Left", "Right")
}

# Numbers and names of operators, or what is evaluated in each sample and gives such.
Term = Any
Terms = list[Term]


class _NotNativeError(Exception):
    """The program needs Scenic beside the simulation; the message says what for."""


@dataclass(frozen=True)
class _PerSample:
    """Terms that are known in a sample only: ``read`` makes them of the values of names."""

    read: Callable[["_Sample"], Terms]


class _Sample:
    """The values of a program's names in a sampled scene."""

    def __init__(self, scene: Any, names: Mapping[str, Any]) -> None:
        self.scene, self.ego, self._names = scene, scene.egoObject, names

    def value(self, node: Any) -> Any:
        """The value of an expression that :meth:`_Translator.is_constant` has admitted.

        Raises UnusableError if it cannot be evaluated, or if it is the car or a value whose code would run.
        """
        try:
            value = self._evaluated(node)
        except UnusableError:
            raise
        except Exception as error:
            raise UnusableError(f"line {node.lineno}: {type(error).__name__}: {error}") from error
        if value is self.ego:
            raise UnusableError(f"line {node.lineno}: {_shown(node)} is the car: name it `ego` in conditions and records")
        if not isinstance(value, list | tuple | dict) and not _is_plain(value):
            raise UnusableError(f"line {node.lineno}: a {type(value).__name__} cannot be used in a condition or record")
        return value

    def _evaluated(self, node: Any) -> Any:
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
                return _attribute(self.value(node.value), node)
            case ast.Subscript():
                return self.value(node.value)[self.value(node.slice)]
            case ast.Tuple() | ast.List():
                values = [self.value(part) for part in node.elts]
                return values if isinstance(node, ast.List) else tuple(values)
            case ast.UnaryOp():
                value = self.value(node.operand)
                return -value if isinstance(node.op, ast.USub) else value
            case ast.BinOp():
                return ARITHMETIC[type(node.op)][1](self.value(node.left), self.value(node.right))
            case ast.Call():
                return self._called(node)
        if type(node).__name__ == "DegOp":
            return self.value(node.operand) * RADIANS_PER_DEGREE
        from scenic.core.vectors import Vector

        return Vector(self.value(node.left), self.value(node.right))  # `left @ right`

    def _called(self, node: ast.Call) -> Any:
        from scenic.core import regions

        arguments = [self.value(argument) for argument in node.args]
        named = {keyword.arg: self.value(keyword.value) for keyword in node.keywords if keyword.arg}
        if isinstance(node.func, ast.Attribute):
            return getattr(math, node.func.attr)(*arguments, **named)
        assert isinstance(node.func, ast.Name)
        called = FUNCTIONS.get(node.func.id) or getattr(regions, node.func.id)
        return called(*arguments, **named)

    def number(self, node: Any) -> Terms:
        """A number."""
        return [finite("a value of the program", self.value(node))]

    def truth(self, node: Any) -> Terms:
        """A part of `and` or `or`, which Scenic computes bit by bit of what is no truth."""
        value = self.value(node)
        if not isinstance(value, bool | numpy.bool_ | int) or value not in (0, 1):
            raise UnusableError(f"line {node.lineno}: {value!r} beside `and` or `or` is neither True nor False")
        return [bool(value)]

    def place(self, node: Any) -> Terms:
        """Coordinates of a place (m), its height over the car's at the start."""
        from scenic.core.type_support import toVector

        value = self.value(node)
        try:
            x, y, z = (finite("a place", part) for part in toVector(value))
        except TypeError:
            raise UnusableError(f"line {node.lineno}: {value!r} is no place to measure a distance from") from None
        return [x, y, rounded(z - float(self.ego.position.z))]

    def region(self, node: Any) -> Terms:
        """Whether the car is in a region of the ground."""
        region = self.value(node)
        if type(region).__name__ == "CircularRegion":
            return [*(finite("a region", part) for part in (region.center.x, region.center.y, region.radius)), "in_disc"]
        polygons = region.polygons.geoms
        if any(polygon.interiors for polygon in polygons):
            raise UnusableError("a region with a hole cannot be used in a condition")
        terms: Terms = []
        for count, polygon in enumerate(polygons):
            corners = [finite("a region", part) for corner in polygon.exterior.coords[:-1] for part in corner[:2]]
            terms += [corners] if count == 0 else [corners, "or"]
        return terms

    def side(self, name: str) -> Terms:
        """The place on the car that `front of ego` and its like name: ahead, left and up of its middle (m)."""
        sizes = (self.ego.length, self.ego.width, self.ego.height)
        return [rounded(share * float(size) / 2) for share, size in zip(SIDES[name], sizes, strict=True)]


class _Translator:
    """Translates the expressions of one program; raises _NotNativeError."""

    def __init__(self, tree: Any, scenario: Any) -> None:
        from scenic.syntax import veneer

        self._ego, known = scenario.egoObject, named_things(scenario)
        standard = {name: getattr(veneer, name, getattr(builtins, name, math)) for name in STANDARD}
        self._redefined = {name for name, value in standard.items() if known.get(name, value) is not value}
        stored = Counter(
            node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and not isinstance(node.ctx, ast.Load)
        )
        # A name that is assigned twice may have had another value where the expression stands.
        self.names = {name: value for name, value in known.items() if stored[name] == 1}
        self._turned = not _stands_in_world(scenario.egoObject)

    def truth(self, node: Any) -> Terms:
        """A condition."""
        if self.is_constant(node):
            return [_PerSample(lambda sample: [bool(sample.value(node))])]
        match node:
            case ast.BoolOp():
                joined = "and" if isinstance(node.op, ast.And) else "or"
                return _folded([self._part(part) for part in node.values], joined)
            case ast.UnaryOp(op=ast.Not()):
                return [*self.truth(node.operand), "not"]
            case ast.Compare(ops=[ast.In() | ast.NotIn() as asked]):
                inside = self._inside(node.left, node.comparators[0])
                return inside if isinstance(asked, ast.In) else [*inside, "not"]
            case ast.Compare() if all(type(one) in COMPARISONS for one in node.ops):
                sides = [self.number(side) for side in (node.left, *node.comparators)]
                pairs = zip(sides, node.ops, sides[1:], strict=False)
                return _folded([[*left, *right, COMPARISONS[type(one)]] for left, one, right in pairs], "and")
        raise _NotNativeError(_shown(node))

    def _part(self, node: Any) -> Terms:
        return [_PerSample(lambda sample: sample.truth(node))] if self.is_constant(node) else self.truth(node)

    def number(self, node: Any) -> Terms:
        """A number."""
        if self.is_constant(node):
            return [_PerSample(lambda sample: sample.number(node))]
        match node:
            case ast.Attribute(value=ast.Call(func=ast.Name(id="simulation") as called), attr="currentRealTime") if (
                self._is_standard(called)
            ):
                return ["time_s"]
            case ast.Attribute() if self._is_ego(node.value) or self.is_position(node.value):
                return self._motion(node)
            case ast.UnaryOp(op=ast.USub()):
                return [*self.number(node.operand), "negate"]
            case ast.BinOp() if type(node.op) in ARITHMETIC:
                return [*self.number(node.left), *self.number(node.right), ARITHMETIC[type(node.op)][0]]
            case ast.Call(func=ast.Name(id="abs") as called, args=[argument], keywords=[]) if self._is_standard(called):
                return [*self.number(argument), "abs"]
            case ast.Call(func=ast.Name(id="min" | "max" as name) as called, keywords=[]) if (
                len(node.args) > 1 and self._is_standard(called)
            ):
                return _folded([self.number(argument) for argument in node.args], name)
        if type(node).__name__ == "DistanceFromOp":
            return self._distance(node)
        raise _NotNativeError(_shown(node))

    def recorded(self, node: Any) -> Terms:
        """A number, a truth or the car's position."""
        if self.is_position(node):
            return ["x_m", "y_m", *self._height()]
        return self.truth(node) if _is_truth(node) else self.number(node)

    def is_constant(self, node: Any) -> bool:
        """Whether an expression is known once the scene is sampled, and evaluating it runs no code of the program."""
        match node:
            case ast.Constant():
                return True
            case ast.Name():
                value = self.names.get(node.id)
                # Of a container Scenic samples the members only where it is used as a value.
                return node.id in self.names and value is not self._ego and _is_plain(value)
            case ast.Attribute(value=ast.Name(id="globalParameters")):
                return True
            case ast.Attribute(value=ast.Name(id="math") as module):
                return self._is_standard(module) and hasattr(math, node.attr)
            case ast.Attribute():
                return not node.attr.startswith("_") and self.is_constant(node.value)
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

    def _is_known_function(self, function: ast.expr) -> bool:
        if isinstance(function, ast.Attribute):
            return isinstance(function.value, ast.Name) and function.value.id == "math" and self.is_constant(function)
        return isinstance(function, ast.Name) and function.id in (*FUNCTIONS, *REGIONS) and self._is_standard(function)

    def _is_standard(self, name: ast.Name) -> bool:
        """Whether a name of STANDARD stands for what Python and Scenic mean by it."""
        return name.id not in self._redefined

    def _is_ego(self, node: Any) -> bool:
        return isinstance(node, ast.Name) and (node.id == "ego" or self.names.get(node.id) is self._ego)

    def is_position(self, node: Any) -> bool:
        """Whether it is `ego.position`."""
        return isinstance(node, ast.Attribute) and node.attr == "position" and self._is_ego(node.value)

    def _motion(self, node: ast.Attribute) -> Terms:
        if node.attr == "z":
            return self._height()
        of_position = self.is_position(node.value)
        if node.attr not in MOTION or (of_position and node.attr not in ("x", "y")):
            raise _NotNativeError(_shown(node))
        if self._turned and node.attr in ("yaw", "pitch", "roll"):
            raise _NotNativeError(f"{_shown(node)} of a car whose parentOrientation is not the world's")
        return list(MOTION[node.attr])

    def _height(self) -> Terms:
        return ["rise_m", _PerSample(lambda sample: [finite("z", sample.ego.position.z)]), "+"]

    def _distance(self, node: Any) -> Terms:
        # Without the other end it is the distance from the ego.
        ends: list[Any] = [end if end is not None else ast.Name("ego", ast.Load()) for end in (node.target, node.base)]
        places = [end for end in ends if self.is_constant(end)]
        others = [end for end in ends if not self.is_constant(end)]
        if len(places) != 1:
            raise _NotNativeError(_shown(node))
        (place,), (car,) = places, others
        if self._is_region(place):
            raise _NotNativeError("the distance from a region")
        where = _PerSample(lambda sample: sample.place(place))
        if self._is_ego(car) or self.is_position(car):
            return [where, "distance_m"]
        if type(car).__name__ == "PositionOfOp" and self._is_ego(car.target):
            side = type(car.position).__name__
            if side in SIDES:
                return [_PerSample(lambda sample: sample.side(side)), where, "distance_from_m"]
        raise _NotNativeError(_shown(node))

    def _inside(self, thing: Any, region: Any) -> Terms:
        # `ego in region` asks for the whole car.
        if not (self.is_position(thing) and self._is_region(region)):
            raise _NotNativeError("a region")
        if not self.is_constant(region):
            raise _NotNativeError(_shown(region))
        return [_PerSample(lambda sample: sample.region(region))]


    def _is_region(self, node: Any) -> bool:
        known = self.names.get(node.id) if isinstance(node, ast.Name) else None
        called = node.func.id if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) else ""
        return type(known).__name__ in REGIONS or called in REGIONS


class NativeProgram:
    """What a program says of its runs, in a form that :meth:`of_scene` completes for each sampled scene."""

    def __init__(self, translator: _Translator, endings: list[tuple[Terms, bool]], limits: list[Any],
                 records: list[tuple[str, str, Any, Terms]]) -> None:  # fmt: skip
        self._names, self._endings, self._limits, self._records = translator.names, endings, limits, records

    def of_scene(self, scene: Any) -> dict[str, Any]:
        """The member `program` of a scene of docs/carsim.md. Raises UnusableError or FoldcarError."""
        sample = _Sample(scene, self._names)
        step_s = outer_step_s(scene.params)
        endings = [
            {"when": _resolved(terms, sample), "outcome": "passed" if passed else "terminated"}
            for terms, passed in self._endings
        ]
        records: list[dict[str, Any]] = []
        verdict: Any = None
        for name, kind, node, terms in self._records:
            if terms:
                value: dict[str, Any] = {"value": _resolved(terms, sample)}
            else:
                value = {"constant": to_json(sample.value(node), name)}
            records.append({"name": name, "kind": kind, **value})
            if name == VERDICT and kind != "initial":
                verdict = [bool(value["constant"])] if "constant" in value else _as_truth(node, value["value"])
        return {
            "endings": endings,
            "time_limit_s": self._time_limit_s(sample, step_s),
            "verdict": verdict,
            "records": records,
            "step_s": step_s,
        }

    def _time_limit_s(self, sample: _Sample, step_s: float) -> float | None:
        if not self._limits:
            return None
        duration = self._limits[-1]
        unit_s = 1.0 if type(duration).__name__ == "Seconds" else step_s
        limit_s = finite("terminate after", sample.value(duration.value)) * unit_s
        if limit_s <= 0:
            raise UnusableError(f"terminate after {limit_s:g} s: is not above 0")
        return limit_s if limit_s < MAX_TIME_LIMIT_S else None


def native_program(scenario: Any, program: Path, success: SuccessRule) -> tuple[NativeProgram | None, str]:
    """The program's translation, or None and what it needs Scenic beside the simulation for, with its line."""
    tree = parsed_program(read_text(program))
    line = 0
    try:
        _check_only_translatable_parts(scenario)
        translator = _Translator(tree, scenario)
        endings, limits, records = [], [], []
        conditions = (*scenario.terminationConditions, *scenario.terminateSimulationConditions)
        passing = {condition.line for condition in conditions if str(condition) in success.endings}
        for kind in ("TerminateWhen", "TerminateSimulationWhen"):
            for node in _statements(tree, kind):
                line = node.lineno
                endings.append((translator.truth(node.cond), line in passing))
        for node in _statements(tree, "TerminateAfter"):
            line = node.lineno
            if not translator.is_constant(node.duration.value):
                raise _NotNativeError(_shown(node.duration.value))
            limits.append(node.duration)
        for kind, name in RECORDS.items():
            for node in _statements(tree, kind):
                line = node.lineno
                constant = translator.is_constant(node.value)
                terms = [] if constant else translator.recorded(node.value)
                record = _record_name(scenario, node)
                if record == VERDICT and translator.is_position(node.value):
                    raise _NotNativeError(f"a position as `{VERDICT}`")
                records.append((record, name, node.value, terms))
        expressions = (*scenario.recordedExprs, *scenario.recordedInitialExprs, *scenario.recordedFinalExprs)
        line = 0
        if len(endings) > MAX_STATEMENTS or len(records) > MAX_STATEMENTS:
            raise _NotNativeError(f"more than {MAX_STATEMENTS} conditions or records")
        if any(len(terms) > MAX_TERMS for terms in (*(ending[0] for ending in endings), *(one[3] for one in records))):
            raise _NotNativeError(f"an expression of more than {MAX_TERMS} terms")
        if (len(endings), len(records)) != (len(conditions), len(expressions)) or len(limits) > 1:
            raise _NotNativeError("statements that do not stand at the top level")
    except _NotNativeError as reason:
        return None, f"line {line}: {reason}" if line else str(reason)
    return NativeProgram(translator, endings, limits, records), ""


def _check_only_translatable_parts(scenario: Any) -> None:
    dynamic = scenario.dynamicScenario
    parts = {
        "a modular scenario": scenic_private.is_modular(dynamic) or scenic_private.has_compose(dynamic),
        "monitors": bool(scenario.monitors),
        "behaviors": bool(scenic_private.agents(dynamic)),
        "a requirement on the run": any(one.proposition.has_temporal_operator for one in scenario.requirements),
    }
    for name, present in parts.items():
        if present:
            raise _NotNativeError(name)


def _statements(tree: Any, kind: str) -> Iterator[Any]:
    return (node for node in tree.body if type(node).__name__ == kind)


def _record_name(scenario: Any, node: Any) -> str:
    """The name under which Scenic keeps a record: its own where the statement gives none."""
    expressions = (*scenario.recordedExprs, *scenario.recordedInitialExprs, *scenario.recordedFinalExprs)
    return str(next(one.name for one in expressions if one.line == node.lineno and node.name in (None, one.name)))


def _stands_in_world(ego: Any) -> bool:
    from scenic.core.vectors import alwaysGlobalOrientation

    return bool(alwaysGlobalOrientation(ego.parentOrientation))


def _folded(parts: list[Terms], operation: str) -> Terms:
    terms = list(parts[0])
    for part in parts[1:]:
        terms += [*part, operation]
    return terms


def _resolved(terms: Iterable[Term], sample: _Sample) -> Terms:
    resolved: Terms = []
    for term in terms:
        resolved += term.read(sample) if isinstance(term, _PerSample) else [term]
    return resolved


def _as_truth(node: Any, terms: Terms) -> Terms:
    return terms if _is_truth(node) else [*terms, "abs", 0.0, ">"]


def _is_truth(node: Any) -> bool:
    return isinstance(node, ast.BoolOp | ast.Compare) or (isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not))


def _attribute(value: Any, node: ast.Attribute) -> Any:
    """The attribute's value; UnusableError if a class of the program computes it."""
    written = [cls for cls in type(value).__mro__ if node.attr in vars(cls) and not cls.__module__.startswith("scenic.")]
    if written and _is_scenic(value):
        kind = type(value).__name__
        raise UnusableError(
            f"line {node.lineno}: `{node.attr}` of a {kind} is code, which a condition or record cannot use"
        )
    return getattr(value, node.attr)


def _is_scenic(value: Any) -> bool:
    return any(cls.__module__.startswith("scenic.") for cls in type(value).__mro__)


def _is_plain(value: Any) -> bool:
    """Whether no code of the program runs where the value is used: Python's and numpy's, or one of Scenic's classes."""
    # Of a container Scenic samples the members only where it is used as a value.
    plain = isinstance(value, bool | int | float | str | numpy.generic | numpy.ndarray | None)
    return plain or (_is_scenic(value) and not isinstance(value, type) and not inspect.isroutine(value))


def _shown(node: Any) -> str:
    names = {"Name": "`{id}`", "Attribute": "`….{attr}`"}
    text = names.get(type(node).__name__)
    return text.format(**vars(node)) if text else type(node).__name__
