"""The modules that type strings may name, the table of their parameters, a user's own modules (``--components FILE``).

A shared parameter has one value for the whole car; the other ones belong to a module and hold for every module of that
letter. In listings a parameter is found under its module (``{"W": {"length": 60}}``) or, if shared, under ``common``;
its key here is ``width`` or ``W.length``. An error in a user's file is a message of one line that names file and line.
"""

import importlib.util
import inspect
import sys
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from foldcar.car.components.brain_module import BrainModule, ElectronicsModule
from foldcar.car.components.component import Component
from foldcar.car.components.hinge_module import HingeModule
from foldcar.car.components.module import Module, WheelModule
from foldcar.car.components.parameter import ComponentError, Parameter
from foldcar.errors import FoldcarError

HINGE = HingeModule.letter
# Every car has these.
REQUIRED_MODULES = (WheelModule.letter, BrainModule.letter)
_MODULES: dict[str, type[Module] | type[HingeModule]] = {
    kind.letter: kind for kind in (WheelModule, BrainModule, HingeModule)
}


@dataclass(frozen=True, slots=True)
class DesignParameter:
    """A parameter of the car: its key in designs, the modules that have it, its declaration."""

    key: str
    modules: frozenset[str]
    declared: Parameter

    @property
    def column(self) -> str:
        """Its column name in results, which ends in its unit."""
        return f"{self.key.replace('.', '_')}_{self.declared.unit}"


def modules() -> Mapping[str, type[Module] | type[HingeModule]]:
    """Every known module by its letter or name."""
    return _MODULES


def register(kind: type[Module]) -> None:
    """Register a module; ComponentError if its letter is taken or a parameter contradicts one of the same name."""
    letter = kind.letter
    if not letter.isalnum() or letter == "common":
        raise ComponentError(kind.__name__, f'letter "{letter}" is not made of letters and digits')
    if letter in _MODULES:
        raise ComponentError(kind.__name__, f'letter "{letter}" is that of {_MODULES[letter].__name__} already')
    if issubclass(kind, WheelModule | ElectronicsModule):
        raise ComponentError(kind.__name__, "carries wheels or electronics, which W and B do; derive it from Module")
    known = {key: parameter.declared for key, parameter in parameters().items()}
    for parameter in kind.parameters:
        if known.get(parameter.name, parameter) != parameter:
            told = f'its parameter "{parameter.name}" is declared otherwise than that of the whole car'
            raise ComponentError(kind.__name__, told)
    _MODULES[letter] = kind
    parameters.cache_clear()


@cache
def parameters() -> dict[str, DesignParameter]:
    """Every parameter by key, in the order of the results' columns: shared ones first."""
    having: dict[str, tuple[Parameter, set[str]]] = {}
    for shared in (True, False):
        for letter, kind in _MODULES.items():
            for parameter in declared(kind):
                if parameter.shared == shared:
                    key = parameter.name if shared else f"{letter}.{parameter.name}"
                    having.setdefault(key, (parameter, set()))[1].add(letter)
    return {key: DesignParameter(key, frozenset(letters), one) for key, (one, letters) in having.items()}


def declared(kind: type[Component]) -> list[Parameter]:
    """The parameters that a design may set."""
    return [parameter for parameter in kind.parameters if not parameter.internal]


def find_parameter(group: str, name: str) -> DesignParameter | None:
    """The parameter that ``{group: {name: …}}`` of a listing sets, or None; ``group`` is ``common`` or a letter."""
    shared = parameters().get(name)
    if shared is not None and (group == "common" or group in shared.modules):
        return shared
    return parameters().get(f"{group}.{name}")


def names_in(group: str) -> list[str]:
    """The parameter names that ``group`` (``common`` or a module letter) may set."""
    names = {parameter.declared.name for parameter in parameters().values()}
    return sorted(name for name in names if find_parameter(group, name) is not None)


_loaded: dict[Path, list[str]] = {}


def load_components(file: Path) -> list[str]:
    """Register the modules that the file defines and return their letters; FoldcarError if it fails or has none."""
    path = file.resolve()
    if path in _loaded:
        return _loaded[path]
    spec = importlib.util.spec_from_file_location(f"foldcar_components_{path.stem}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise FoldcarError(f"--components {file}: is no Python file")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except SyntaxError as error:
        raise FoldcarError(f"{file}:{error.lineno}: {error.msg}") from error
    except Exception as error:
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename) == path]
        raise FoldcarError(f"{file}:{(lines or [1])[-1] or 1}: {type(error).__name__}: {error}") from error
    kinds = [
        kind for kind in vars(module).values()
        if inspect.isclass(kind) and issubclass(kind, Module) and kind.__module__ == module.__name__
    ]  # fmt: skip
    if not kinds:
        raise FoldcarError(f"{file}:1: defines no subclass of foldcar.car.components.module.Module")
    sys.modules[module.__name__] = module
    for kind in kinds:
        line = inspect.getsourcelines(kind)[1]
        for attribute in ("letter", "title"):
            if not isinstance(getattr(kind, attribute, None), str):
                raise FoldcarError(f'{file}:{line}: {kind.__name__} has no text "{attribute}"')
        try:
            register(kind)
        except FoldcarError as error:
            raise FoldcarError(f"{file}:{line}: {error}") from error
    _loaded[path] = [kind.letter for kind in kinds]
    return _loaded[path]


def loaded_files() -> list[Path]:
    """The files that were loaded."""
    return list(_loaded)


def place_of(error: BaseException) -> str | None:
    """File and line of the user's component that raised the exception, or None if none did."""
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        if Path(frame.filename) in _loaded:
            return f"{frame.filename}:{frame.lineno}"
    return None
