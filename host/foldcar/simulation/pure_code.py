"""Finds whether running a Scenic program, or evaluating one of its conditions, can change something.

A program that is certain to change nothing leaves its memory as it was: it is one of places, parameters and expressions,
in which nothing is called but FUNCTIONS and functions and monitors of its own that obey the same rules.

A condition that is certain to change nothing may be evaluated at any number of moments; one that counts its calls, prints
or draws at random may not. Certain are expressions that call nothing but Scenic's operators, queries of Python and
Scenic, and functions that obey the same rules, on data of Python, numpy and Scenic: an object of another class may run
any code when an attribute is read or it is printed. Scenic makes a function of the condition, of which this reads the
bytecode.
"""

import ast
import builtins
import dis
import functools
import inspect
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

from scenic.core.distributions import Options
from scenic.core.dynamics.invocables import Invocable
from scenic.core.object_types import Constructible
from scenic.core.vectors import Vector
from scenic.syntax.parser import parse_string

from foldcar.scenes.program import VOCABULARY_DIR
from foldcar.typed import read_text

# Functions of Scenic and Python that change nothing and return nothing that can be used up, as an iterator can.
FUNCTIONS = frozenset(
    {"DiscreteRange", "Discrete", "Normal", "Options", "Range", "TruncatedNormal", "Uniform"}
    | {"CircularRegion", "PolygonalRegion", "PolylineRegion", "RectangularRegion"}
    | {"abs", "bool", "float", "int", "len", "max", "min", "range", "round", "simulation", "str", "sum"}
    | {"cos", "hypot", "sin"}
)
PURE_MODULE = "math"
# What changes a value in place, makes something that can be used up, or calls without being a call.
CHANGES = frozenset(
    {"AsyncFunctionDef", "AugAssign", "ClassDef", "Delete", "GeneratorExp", "Global", "ImportFrom", "Lambda", "Match"}
    | {"NamedExpr", "Nonlocal", "With", "Yield", "YieldFrom"}
    | {"BehaviorDef", "Override", "ScenarioDef", "Simulator"}
)


def may_change_state(program: Path) -> bool:
    """Whether the program has more in it than what is certain to change nothing."""
    own_model = program.with_name("model.scenic")
    if own_model.exists() and own_model.resolve().parent != VOCABULARY_DIR:
        return True
    tree = parse_string(read_text(program), "exec", filename=str(program))
    nodes = list(ast.walk(tree))
    defined = {str(vars(node)["name"]) for node in nodes if _is(node, "FunctionDef", "MonitorDef")}
    callables = FUNCTIONS | defined | {PURE_MODULE}
    return any(_changes(node, callables) for node in nodes)


def _changes(node: ast.AST, callables: frozenset[str]) -> bool:
    if isinstance(node, ast.Call):
        return not _is_pure_call(node.func, callables)
    if isinstance(node, ast.Name):
        return not isinstance(node.ctx, ast.Load) and node.id in callables
    if isinstance(node, ast.Attribute | ast.Subscript):
        return not isinstance(node.ctx, ast.Load)
    if isinstance(node, ast.arg):
        return node.arg in callables
    if isinstance(node, ast.Import):
        return any(one.name != PURE_MODULE or one.asname for one in node.names)
    if _is(node, "Model"):
        return bool(vars(node)["name"] != "model")
    if isinstance(node, ast.FunctionDef):
        return bool(node.decorator_list)
    if _is(node, "MonitorDef"):
        # Scenic keeps a monitor's variables for the next run.
        return any(isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store) for one in ast.walk(node))
    return _is(node, *CHANGES)


def _is_pure_call(function: ast.expr, callables: frozenset[str]) -> bool:
    if isinstance(function, ast.Attribute):
        return isinstance(function.value, ast.Name) and function.value.id == PURE_MODULE
    return isinstance(function, ast.Name) and function.id in callables


def _is(node: ast.AST, *names: str) -> bool:
    return type(node).__name__ in names


BUILTINS = frozenset(
    {"abs", "all", "any", "bool", "dict", "enumerate", "float", "int", "isinstance", "len", "list"}
    | {"max", "min", "range", "reversed", "round", "set", "sorted", "str", "sum", "tuple", "type", "zip"}
)
# Of numbers, vectors, regions, objects, texts and containers.
METHODS = frozenset(
    {"angleTo", "angleWith", "azimuthTo", "altitudeTo", "cross", "distanceTo", "dot", "norm", "normalized", "rotatedBy"}
    | {"canSee", "containsObject", "containsPoint", "distanceFrom", "intersects"}
    | {"copy", "count", "endswith", "get", "index", "items", "keys", "lower", "split", "startswith", "strip", "values"}
)
# The method of a program's own terrain, which only making a scene calls.
TERRAIN = "pieces"
# A container's other methods change it, also when they are not called where they are named.
CHANGING = frozenset(name for kind in (list, dict, set) for name in dir(kind) if name[0] != "_") - METHODS | {TERRAIN}
# Modules without state, but for numpy's random numbers.
MODULES = ("math", "numpy")
# Those whose objects run no code of a program when they are read.
PLAIN = frozenset({"builtins", "math", "numpy", "scenic", "weakref"})
SIMPLE = frozenset({bool, float, int, str, type(None), Vector})
# Scenic's functions that draw at random or create.
DRAWING = frozenset({"new", "mutate", "resample"})
STORES = ("STORE_GLOBAL", "STORE_ATTR", "STORE_SUBSCR", "STORE_SLICE", "DELETE_", "IMPORT_", "INPLACE_")
LOADS = ("LOAD_GLOBAL", "LOAD_NAME", "LOAD_DEREF", "LOAD_CLASSDEREF")


@functools.lru_cache(maxsize=256)
def changes_nothing(function: Callable[..., Any]) -> bool:
    """Whether ``function``, its calls included, is certain to leave everything as it was."""
    return _is_pure(function, set())


def _is_pure(function: Any, seen: set[Any]) -> bool:
    if function in seen:
        return True
    seen.add(function)
    variables = {**vars(builtins), **function.__globals__, **inspect.getclosurevars(function).nonlocals}
    return all(_changes_nothing(code, variables, seen) for code in _blocks(function.__code__))


def _blocks(code: CodeType) -> Iterator[CodeType]:
    """The code and that of what is nested in it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _blocks(constant)


def _changes_nothing(code: CodeType, variables: Mapping[str, Any], seen: set[Any]) -> bool:
    own = {*code.co_varnames, *code.co_cellvars}
    module: ModuleType | None = None  # whose member the next instruction takes
    for one in dis.get_instructions(code):
        value: Any = None
        if one.opname.startswith(STORES) or (one.opname == "BINARY_OP" and one.argrepr.endswith("=")):
            return False
        if one.opname in LOADS and one.argval not in own:
            if one.argval not in variables:
                return False
            value = variables[one.argval]
        elif one.opname in ("LOAD_ATTR", "LOAD_METHOD"):
            if module is not None:
                value = getattr(module, one.argval, None)
            elif one.argval in CHANGING or (_is_called(one) and one.argval not in METHODS):
                return False
        module = value if isinstance(value, ModuleType) else None
        if not (_may_be_used(value, seen) if module is None else _is_known(module.__name__)):
            return False
    return True


def _is_called(attribute: dis.Instruction) -> bool:
    """Whether it is the method of a call. From Python 3.12 on, the lowest bit says so."""
    return attribute.opname == "LOAD_METHOD" or (sys.version_info >= (3, 12) and bool((attribute.arg or 0) & 1))


def _is_known(module: str) -> bool:
    return module.split(".")[0] in MODULES and not module.startswith("numpy.random")


def _may_be_used(value: Any, seen: set[Any]) -> bool:
    """Whether calling ``value`` changes nothing, or it is data that reading does not use up."""
    if isinstance(value, FunctionType):
        module = value.__module__ or ""
        if module.startswith("scenic."):
            return module != "scenic.core.distributions" and value.__name__ not in DRAWING
        return _is_known(module) or _is_pure(value, seen)
    if isinstance(value, type):
        return value is Vector or (value.__module__ == "builtins" and value.__name__ in BUILTINS)
    if isinstance(value, BuiltinFunctionType):
        if value.__self__ is builtins:
            return value.__name__ in BUILTINS
        return isinstance(value.__self__, ModuleType) and _is_known(value.__self__.__name__)
    return is_data(value)


@functools.lru_cache(maxsize=1)
def is_plain(scene: Any) -> bool:
    """Whether no object of a Scenic scene runs code of its program when it is read.

    Remembered for the last scene, in which many cars drive.
    """
    return is_data(scene.objects)


def is_data(value: Any) -> bool:
    """Whether reading ``value``, its parts included, runs no code of a program and uses nothing up."""
    parts, seen = [value], {id(value)}
    for one in parts:
        own: Any = type(one)
        if isinstance(one, Constructible):
            if not _has_no_code(own):
                return False
            more = one._allProperties().values()
        elif own in (dict, list, tuple, set, frozenset):
            more = [*one, *one.values()] if isinstance(one, dict) else one
        elif isinstance(one, Options):
            more = one.options
        elif isinstance(one, Invocable) or _is_plain_class(own):
            continue
        else:
            return False
        # Numbers and texts, most of an object's values, have no parts. The list grows, which also keeps what the ids
        # belong to.
        new = {id(part): part for part in more if type(part) not in SIMPLE and id(part) not in seen}
        seen.update(new)
        parts += new.values()
    return True


@functools.lru_cache(maxsize=256)
def _is_plain_class(cls: type) -> bool:
    module = cls.__module__.partition(".")[0]
    # Functions and iterators are Python's own as well.
    used = any(name in vars(one) for one in cls.__mro__ for name in ("__call__", "__next__"))
    return module in PLAIN and not (module == "builtins" and used)


@functools.lru_cache(maxsize=256)
def _has_no_code(cls: type) -> bool:
    """Whether a class of Scenic objects has no methods and properties (`@property`) but Scenic's and TERRAIN."""
    own = [one for one in cls.__mro__ if one.__module__.partition(".")[0] not in PLAIN]
    members = [(name, member) for one in own for name, member in vars(one).items()]
    return all(
        not hasattr(type(member), "__get__")
        or name in ("__dict__", "__weakref__")
        or (name == TERRAIN and isinstance(member, FunctionType))
        for name, member in members
    )
