"""Mutants of a Python source file, made by cosmic-ray: a sample of those in the bodies of functions.

Constants of a module and of a class are choices, annotations are no code: both are left alone.
"""

import ast
from random import Random

import cosmic_ray.plugins
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from mutants import Mutant

OPERATORS = (
    "NumberReplacer", "AddNot", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue", "ReplaceAndWithOr", "ReplaceOrWithAnd",
    "ReplaceBreakWithContinue", "ReplaceContinueWithBreak", "ZeroIterationForLoop",
    "ReplaceUnaryOperator_USub_UAdd", "ReplaceUnaryOperator_Delete_Not", "ReplaceUnaryOperator_Delete_Invert",
    *(f"ReplaceBinaryOperator_{pair}" for pair in (
        "Add_Sub", "Sub_Add", "Mul_Div", "Div_Mul", "FloorDiv_Mul", "Mod_Mul", "Pow_Mul", "BitAnd_BitOr", "BitOr_BitAnd",
    )),
    *(f"ReplaceComparisonOperator_{pair}" for pair in (
        "Lt_LtE", "Lt_Gt", "LtE_Lt", "LtE_GtE", "Gt_GtE", "Gt_Lt", "GtE_Gt", "GtE_LtE", "Eq_NotEq", "NotEq_Eq",
        "Is_IsNot", "IsNot_Is",
    )),
)  # fmt: skip


def sample_of(text: str, most: int | None, random: Random) -> list[Mutant]:
    """Up to ``most`` mutants of a source text, in random order; a larger sample begins with the smaller one."""
    tree = get_ast(text)
    operators = {name: cosmic_ray.plugins.get_operator(f"core/{name}")() for name in OPERATORS}
    places = []
    for name, operator in operators.items():
        starts = [start for node in ast_nodes(tree) for start, _ in operator.mutation_positions(node)]
        places += [(start[0], name, occurrence) for occurrence, start in enumerate(starts)]
    random.shuffle(places)
    found: dict[str, Mutant] = {}
    bodies, same = _bodies(text), _without_annotations(text)
    for line, name, occurrence in places:
        if most is not None and len(found) >= most:
            break
        if line not in bodies:
            continue
        mutated = mutate_code(text, operators[name], occurrence)
        # Some of what cosmic-ray takes for operators is not: the stars of {**a}.
        if mutated is None or mutated in found or _without_annotations(mutated) in (same, None):
            continue
        before, after = text.splitlines(), mutated.splitlines()
        # The place is that of the node, which may begin on an earlier line than the change.
        at = next(i for i, pair in enumerate(zip(before, after, strict=False)) if pair[0] != pair[1])
        found[mutated] = Mutant(at + 1, before[at].strip(), after[at].strip(), mutated)
    return list(found.values())


def _bodies(text: str) -> set[int]:
    """The lines of functions."""
    nodes = [node for node in ast.walk(ast.parse(text)) if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))]
    return {line for node in nodes for line in range(node.body[0].lineno, (node.end_lineno or 0) + 1)}


def _without_annotations(text: str) -> str | None:
    """The syntax tree without annotations; None if there is none."""
    try:
        tree = ast.parse(text)
    except SyntaxError:
        return None
    for node in ast.walk(tree):
        if isinstance(node, (ast.arg, ast.AnnAssign)):
            node.annotation = ast.Constant(None)
        elif isinstance(node, ast.FunctionDef):
            node.returns = None
    return ast.dump(tree)
