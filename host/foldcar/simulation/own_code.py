"""Finds whether a Scenic program can change something that outlives a run.

Input: a program's path. Output: a truth value. Certain to change nothing is a program of places, parameters and
expressions, in which nothing is called but FUNCTIONS and functions and monitors of its own that obey the same rules.
Running it leaves its memory as it was.
"""

import ast
from pathlib import Path

from foldcar.scenes.program import VOCABULARY_DIR

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
    from scenic.syntax.parser import parse_string

    own_model = program.with_name("model.scenic")
    if own_model.exists() and own_model.resolve().parent != VOCABULARY_DIR:
        return True
    tree = parse_string(program.read_text(encoding="utf-8"), "exec", filename=str(program))
    nodes = list(ast.walk(tree))
    defined = {str(vars(node)["name"]) for node in nodes if _is(node, "FunctionDef", "MonitorDef")}
    callables = FUNCTIONS | defined | {PURE_MODULE}
    return any(_changes(node, callables) for node in nodes)


def _changes(node: ast.AST, callables: frozenset[str]) -> bool:
    if isinstance(node, ast.Call):
        return not _is_pure(node.func, callables)
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


def _is_pure(function: ast.expr, callables: frozenset[str]) -> bool:
    if isinstance(function, ast.Attribute):
        return isinstance(function.value, ast.Name) and function.value.id == PURE_MODULE
    return isinstance(function, ast.Name) and function.id in callables


def _is(node: ast.AST, *names: str) -> bool:
    return type(node).__name__ in names
