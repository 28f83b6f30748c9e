"""Changes to Scenic's compiler while it compiles a program.

`mutate` accepts Points, and misleading statements are refused (see refused_statements). Statements keep their own lines,
whereas Scenic gives `ego = …` the line of the block around it. The vocabulary is parsed once. The names of Scenic 3.1
that are used here are not public; tests fail when they change.
"""

import ast
import contextlib
import os
import pickle
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import CodeType
from typing import Any

from scenic.core.dynamics.scenarios import DynamicScenario
from scenic.core.object_types import Constructible
from scenic.core.requirements import PendingRequirement
from scenic.syntax import translator, veneer
from scenic.syntax.compiler import ScenicToPythonTransformer
from scenic.syntax.parser import parse_string

from foldcar.scenes.mutation import Mutations
from foldcar.scenes.program import VOCABULARY_DIR
from foldcar.scenes.refused_statements import (
    refuse_degrees,
    refuse_lost_statements,
    refuse_misspelt_parameters,
    refuse_undefined_names,
    refuse_unordered_sets,
    refuse_useless_properties,
)


@contextlib.contextmanager
def hooks(mutations: Mutations) -> Iterator[None]:
    """Within the block, Scenic compiles with these changes and reports to ``mutations`` what it creates and mutates.

    The program keeps `new` and `mutate` for its simulations, in which they act like Scenic's.
    """
    # Each function below replaces the one of Scenic's with the same name, and calls it.
    compiler, scenario = ScenicToPythonTransformer, DynamicScenario
    scenics_new, scenics_mutate, scenics_visit = veneer.new, veneer.mutate, compiler.visit
    scenics_execute, scenics_inherit = translator.executeCodeIn, scenario._inherit
    scenics_param, scenics_compile = veneer.param, PendingRequirement.compile
    compiling = True

    def new(cls: Any, specifiers: list[Any]) -> Any:
        """Create an object, like Scenic's `new`. Raises SpecifierError if a property has no effect."""
        if not (isinstance(cls, type) and issubclass(cls, Constructible)):
            return scenics_new(cls, specifiers)
        refuse_useless_properties(cls, specifiers, sys._getframe(1))
        return mutations.create(cls, specifiers) if compiling else scenics_new(cls, specifiers)

    def mutate(*things: Any, scale: Any = 1) -> None:
        """Add noise to objects, like Scenic's `mutate`, and to Points; without arguments, to all objects."""
        objects = mutations.mutate_points(things, scale) if compiling else list(things)
        if objects or not things:
            scenics_mutate(*objects, scale=scale)

    def param(params: dict[str, Any]) -> None:
        """Define parameters, like Scenic's `param`. Raises InvalidScenarioError if a name seems to be misspelt."""
        refuse_misspelt_parameters(params, sys._getframe(1))
        scenics_param(params)

    def visit(transformer: Any, node: Any) -> Any:
        """Translate a node of a program's syntax tree to Python, like Scenic's method of its ``transformer``.

        Raises InvalidScenarioError if the node seems to have another meaning than its author believes. Some nodes of the
        translation have no line. They get the line of the node, so that errors can name it.
        """
        refuse_degrees(node, transformer.filename)
        refuse_unordered_sets(node, transformer.filename)
        translation = scenics_visit(transformer, node)
        translated_nodes = translation if isinstance(translation, list) else [translation]
        if isinstance(node, ast.AST) and hasattr(node, "lineno"):
            for translated_node in translated_nodes:
                if isinstance(translated_node, ast.AST) and not hasattr(translated_node, "lineno"):
                    ast.copy_location(translated_node, node)
        return translation

    def parse(source: str, mode: str, filename: str) -> Any:
        """Parse a program, like Scenic's parser; also one with a byte order mark, or with Windows' ends of lines."""
        if Path(filename).parent == VOCABULARY_DIR:
            return pickle.loads(_vocabulary(source, mode, filename))
        return parse_string(source.removeprefix("\ufeff").replace("\r\n", "\n"), mode, filename=filename)

    def execute(code: CodeType, namespace: dict[str, Any]) -> None:
        """Execute a program's code, like Scenic. Raises NameError if a later part of it uses an undefined name."""
        scenics_execute(code, namespace)
        refuse_undefined_names(code, namespace)

    def inherit(self: Any, other: Any) -> None:
        """Take over an imported program, like Scenic. Raises InvalidScenarioError if statements would be lost."""
        refuse_lost_statements(other)
        scenics_inherit(self, other)

    def compile_requirement(self: Any, namespace: Any, scenario: Any, syntax: Any = None) -> Any:
        """Compile a requirement, like Scenic, but hide the syntax of one that does not concern sampling.

        From the syntax Scenic infers where samples can be, even from conditions that end a run.
        """
        return scenics_compile(self, namespace, scenario, syntax if self.ty.constrainsSampling else None)

    # What is changed: a module or class of Scenic, the name in it, the function in its place.
    changes: list[tuple[Any, str, Any]] = [
        (veneer, "new", new),
        (veneer, "mutate", mutate),
        (veneer, "param", param),
        (veneer, "localPath", _local_path),
        (translator, "executeCodeIn", execute),
        (translator, "parse_string", parse),
        (compiler, "visit", visit),
        (scenario, "_inherit", inherit),
        (PendingRequirement, "compile", compile_requirement),
    ]
    originals = [(owner, name, getattr(owner, name)) for owner, name, _ in changes]
    for owner, name, changed in changes:
        setattr(owner, name, changed)
    try:
        yield
    finally:
        compiling = False
        for owner, name, original in originals:
            setattr(owner, name, original)


def _local_path(relative: Any) -> Path:
    """Return a path relative to the calling file, as Scenic's localPath, which also follows symbolic links.

    The link must be opened itself, so that it is known among the program's files and leads elsewhere one day.
    """
    folder = Path(sys._getframe(1).f_code.co_filename).parent
    return Path(os.path.normpath(folder.joinpath(relative).absolute()))


@cache
def _vocabulary(source: str, mode: str, filename: str) -> bytes:
    """Return a vocabulary file's pickled syntax tree. Parsing takes half the time of compiling a small program."""
    return pickle.dumps(parse_string(source, mode, filename=filename))
