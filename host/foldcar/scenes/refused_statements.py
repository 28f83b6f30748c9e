"""Refuses statements of a program that do not have the effect they seem to have; Scenic notices late or never.

Properties and parameters that resemble a known one (`heigth`): Scenic accepts any. Headings in degrees: Scenic's angles
are radians, and `facing -90` means -90 rad. Sets of classes or objects, whose order no process repeats. Names that are
defined nowhere: Python looks up those of a condition in a run. Statements about a run in an imported program: Scenic 3.1
takes over its objects, parameters and requirements (a modular scenario those of its file's top level), but no
`terminate`, `record` or `require monitor`.
"""

import ast
import builtins
import difflib
import dis
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

from scenic.core.errors import InvalidScenarioError, SpecifierError
from scenic.core.object_types import Constructible
from scenic.syntax import ast as scenic_ast

from foldcar.scenes import scenic_private
from foldcar.scenes.program import VOCABULARY, named_things, parsed_program
from foldcar.scenes.success import VERDICT
from foldcar.typed import did_you_mean, read_text

# Names at least this similar (difflib's ratio) count as mistakes: `heigth`, `lenght`, `stepheight`, `heights`.
SIMILARITY = 0.75
# A property that Scenic uses if an object has it, although no class declares it.
NAME = "name"
ANGLES = ("yaw", "pitch", "roll")
DROPPED = (
    *("_terminationConditions", "_terminateSimulationConditions", "_monitorRequirements"),
    *("_recordedExprs", "_recordedInitialExprs", "_recordedFinalExprs"),
)
# Properties that Scenic computes itself, and refuses with messages of its own.
SCENICS_FINAL = ("heading", "observations", "orientation")
# Properties without effect: the class that they belong to, their names, and why.
USELESS = (
    ("Robot", ("behavior",), "the firmware drives the car, as fast as the experiment's speed_m_s and yaw_rate_rad_s say"),
    ("Robot", ("consumedEnergy",), "it is 0 at the start"),
    ("Thing", ("speed", "velocity", "angularSpeed", "angularVelocity"), "everything stands still at the start"),
    ("Thing", ("shape",), "its class decides the shape; a Terrain class of your own has `pieces`"),
)
RUN_STATEMENTS = (
    *("TerminateWhen", "TerminateSimulationWhen", "Record", "RecordInitial", "RecordFinal", "Require", "RequireMonitor"),
)
DISTRIBUTIONS = ("Range", "DiscreteRange", "Normal", "TruncatedNormal", "Uniform")


def at(error: Any, file: str | None, line: int | None) -> Exception:
    """Return ``error`` with the file and line that Scenic's and foldcar's messages name."""
    error.filename, error.lineno = file, line
    return error  # type: ignore[no-any-return]


def refuse_useless_properties(cls: Any, specifiers: Sequence[Any], caller: FrameType) -> None:
    """Raise Scenic's SpecifierError if a program creates an object of class ``cls`` with a property that has no effect.

    ``specifiers`` give the object its properties. ``caller`` is the frame of the program, for the line of the error.
    There are four kinds of such properties: those that follow from others, or mean nothing in foldcar; those without
    effect on this class; those of another class; and misspelt ones. A property that the program itself reads has an
    effect.
    """
    names = [name for specifier in specifiers for name in specifier.priorities]
    is_of_vocabulary = _derives(cls, "Thing")
    known_properties = scenic_private.defaults(cls)
    for name in names:
        if name == NAME:
            continue
        if is_of_vocabulary and name not in SCENICS_FINAL and name in scenic_private.final_properties(cls):
            sources = scenic_private.sources_of(cls, name)
            remedy = f"follows from {', '.join(sources)}: set these" if sources else "has no meaning here"
            raise at(SpecifierError(f"{cls.__name__}: {name} {remedy}"), *_line_of(caller))
        for kind, useless_names, reason in USELESS:
            if name in useless_names and _derives(cls, kind) and not _reads(caller, name):
                raise at(SpecifierError(f"{cls.__name__}: {name} has no effect: {reason}"), *_line_of(caller))
        owners = _owners(name, caller) if is_of_vocabulary and name not in known_properties else []
        if owners and not _reads(caller, name):
            raise at(SpecifierError(f"{cls.__name__} has no property {name}; {owners[0]} has"), *_line_of(caller))
        _refuse_misspelt(SpecifierError, f"{cls.__name__} has no property {name}", name, known_properties, caller)


def _owners(name: str, caller: FrameType) -> list[str]:
    """Return the vocabulary's classes that have a property of that name and are visible to the program."""
    visible_classes = {value.__name__: value for value in caller.f_globals.values() if isinstance(value, type)}
    owners = []
    for class_name, cls in visible_classes.items():
        if _derives(cls, "Thing") and name in scenic_private.defaults(cls):
            owners.append(class_name)
    return sorted(owners)


def _derives(cls: Any, kind: str) -> bool:
    """Return whether a class is, or is derived from, a class of the name ``kind``."""
    return any(ancestor.__name__ == kind for ancestor in cls.__mro__)


def _line_of(caller: FrameType) -> tuple[str, int]:
    """Return the file and the line of the program that is being executed in the frame ``caller``."""
    return caller.f_code.co_filename, caller.f_lineno


def refuse_misspelt_parameters(names: Iterable[str], caller: FrameType) -> None:
    """Raise Scenic's InvalidScenarioError if ``caller`` defines a `param` that resembles one of the vocabulary's."""
    for name in names:
        _refuse_misspelt(InvalidScenarioError, f"nothing reads param {name}", name, _vocabularys_parameters(), caller)


def _refuse_misspelt(
    error: type[Exception], message: str, name: str, known_names: Iterable[str], caller: FrameType
) -> None:
    """Raise ``error`` if a name is unknown but resembles a known one.

    The program may have chosen such a name on purpose. Then it uses the name in another place, too, and this raises
    nothing.
    """
    if name in known_names:
        return
    similar_names = difflib.get_close_matches(name, known_names, n=1, cutoff=SIMILARITY)
    # The name may be one without its unit.
    similar_names += [other for other in known_names if other.startswith(f"{name}_")]
    if similar_names and not _reads(caller, name):
        raise at(error(f"{message}; did you mean {similar_names[0]}?"), *_line_of(caller))


def _reads(caller: FrameType, name: str) -> bool:
    """Return whether the program's file reads a property or parameter of that name: as `.name` or as a string."""
    file = Path(caller.f_code.co_filename)
    if not file.is_file():
        # Scenic also compiles programs that are in no file: nobody knows what they read.
        return True
    text = read_text(file)
    # `.name = …` assigns the property, but `.name == …` reads it.
    reads_attribute = False
    for mention in re.finditer(rf"\.\s*{name}\b\s*(?P<operator>=*)", text):
        if mention["operator"] != "=":
            reads_attribute = True
    has_string = f"'{name}'" in text or f'"{name}"' in text
    return reads_attribute or has_string


def refuse_misspelt_attributes(scenario: Any, program: Path) -> None:
    """Raise Scenic's InvalidScenarioError if a condition or record reads an attribute that its object does not have."""
    things = {**named_things(scenario), "ego": scenario.egoObject}
    for statement in ast.walk(parsed_program(read_text(program))):
        if type(statement).__name__ not in RUN_STATEMENTS:
            continue
        for node in ast.walk(statement):
            if not (isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)):
                continue
            thing = things.get(node.value.id)
            if isinstance(thing, Constructible) and not hasattr(thing, node.attr):
                suggestion = did_you_mean(node.attr, scenic_private.defaults(type(thing)))
                message = f"{node.value.id} has no property {node.attr}{suggestion}"
                raise at(InvalidScenarioError(message), str(program), node.lineno)


@cache
def _vocabularys_parameters() -> frozenset[str]:
    """Return the names of the parameters that the vocabulary declares."""
    return frozenset(re.findall(r"^param (\w+)", read_text(VOCABULARY), re.MULTILINE))


def refuse_undefined_names(code: CodeType, namespace: Mapping[str, Any]) -> None:
    """Raise NameError, with file and line, for the first undefined name in a function or condition within ``code``.

    Python itself would raise it only when the block runs. A name is defined if it is assigned anywhere in ``code``, is in
    ``namespace``, or built in.
    """
    blocks = list(_blocks(code))
    assigned_names = set()
    for block in blocks:
        for instruction in dis.get_instructions(block):
            if instruction.opname.startswith("STORE_"):
                assigned_names.add(instruction.argval)
    # The first block is the program's top level, which runs at once.
    for block in blocks[1:]:
        lines = dict(dis.findlinestarts(block))
        line: int | None = block.co_firstlineno
        for instruction in dis.get_instructions(block):
            line = lines.get(instruction.offset, line)
            if instruction.opname != "LOAD_GLOBAL":
                continue
            name = instruction.argval
            is_defined = name in assigned_names or name in namespace or hasattr(builtins, name)
            if not is_defined:
                raise at(NameError(f"name '{name}' is not defined", name=name), code.co_filename, line)


def _blocks(code: CodeType) -> Iterator[CodeType]:
    """Yield the code and all code nested in it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _blocks(constant)


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
            message = f"`{statement}`: {number:g} is more than a turn of 2 pi radians; for degrees write {number:g} deg"
            raise at(InvalidScenarioError(message), file, getattr(node, "lineno", 0))


def refuse_unordered_sets(node: ast.AST, file: str) -> None:
    """Raise Scenic's InvalidScenarioError if ``node`` is a set that may have another order in the next process.

    Python orders classes, objects and None by their place in memory, so a loop over a set of these draws other scenes in
    each process. A set of texts and numbers that stand in the program has the same order in all processes. The order of a
    set after `in` does not matter. This function must be called for the parents of a node before the node. ``file`` is
    the program, for the error.
    """
    if isinstance(node, ast.Compare):
        for operator, operand in zip(node.ops, node.comparators, strict=True):
            if isinstance(operator, ast.In | ast.NotIn):
                # Mark the operand for its own call of this function.
                operand.stands_after_in = True  # type: ignore[attr-defined]
    if getattr(node, "stands_after_in", False):
        return
    # A set comprehension such as {kind for kind in kinds} has the loop's values, which may be classes or objects.
    is_unordered_comprehension = isinstance(node, ast.SetComp) and isinstance(node.elt, ast.Name)
    is_unordered_set = isinstance(node, ast.Set) and not all(map(_has_lasting_order, node.elts))
    if is_unordered_comprehension or is_unordered_set:
        message = "a set of names has another order in each process, and so would the scenes: write a list, [...]"
        raise at(InvalidScenarioError(message), file, getattr(node, "lineno", None))


def _has_lasting_order(element: ast.expr) -> bool:
    """Return whether an element of a set has the same hash in every process: a text, a number, or a tuple of these."""
    # An f-string is a text.
    if isinstance(element, ast.JoinedStr):
        return True
    try:
        return ast.literal_eval(element) is not None
    except (ValueError, TypeError):
        return False


def _numbers(angle: ast.AST) -> Iterator[float]:
    """Yield the number of a literal ``angle``, or the literal numbers in the arguments of a distribution."""
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


def refuse_lost_statements(inherited: Any) -> None:
    """Raise Scenic's InvalidScenarioError if a scenario that another one inherits has statements that Scenic drops.

    The error names the last of these statements.
    """
    statements = [statement for attribute in DROPPED for statement in getattr(inherited, attribute)]
    dropped = [(statement.line, statement.ty.value) for statement in statements]
    if scenic_private.is_limited(inherited):
        # Scenic does not keep the line of this statement. It gets the line 0, so that another one is named if there is
        # any.
        dropped.append((0, "terminate after"))
    if dropped:
        line, kind = max(dropped)
        reason = "Scenic drops such statements from an imported program, and from the top level beside a `scenario`"
        error = InvalidScenarioError(f"`{kind}`: {reason}; move them to the program, or into the scenario, that is run")
        raise at(error, scenic_private.file_of(inherited), line)


def refuse_misleading_records(scenario: Any) -> None:
    """Raise Scenic's InvalidScenarioError, with the line, if a record would not be what it seems to be.

    Of two records with the same name Scenic keeps one. A record of the beginning of a run cannot say how the run ended.
    """
    for record in scenario.recordedInitialExprs:
        if record.name == VERDICT:
            message = f"`record initial … as {VERDICT}` says nothing about the end of a run: write `record final`"
            raise at(InvalidScenarioError(message), None, record.line)
    line_of_name: dict[str, int] = {}
    records = [*scenario.recordedExprs, *scenario.recordedInitialExprs, *scenario.recordedFinalExprs]
    for record in sorted(records, key=lambda record: int(record.line)):
        if record.name in line_of_name:
            earlier_line = line_of_name[record.name]
            message = f"`{record.ty.value} … as {record.name}`: line {earlier_line} records under this name already"
            raise at(InvalidScenarioError(message), None, record.line)
        line_of_name[record.name] = record.line
